"""Advice for a red object of a drive."""

from __future__ import annotations

import pytest

from drivers.interfaces.servo_axes import DriveSetting
from rid_daq.preflight.drive_advice import next_action

GUARDED = "set watch: life_guarding in the axis's servo, if the drive has 100Ch and 100Dh"


def red_setting(name: str, found: str) -> DriveSetting:
    return DriveSetting(
        joint="axis1",
        node_id=1,
        object_name=name,
        name="an object",
        required="80",
        found=found,
        verdict="red",
    )


@pytest.mark.parametrize("name", ["1016h:01", "1017h:00"])
def test_the_advice_for_a_drive_without_heartbeats_is_life_guarding(name: str) -> None:
    assert GUARDED in next_action(red_setting(name, "not in this drive"))


@pytest.mark.parametrize("name", ["1016h:01", "100Ch:00", "100Dh:00"])
def test_the_advice_for_a_missing_watchdog_warns_of_a_drive_that_continues(name: str) -> None:
    advice = next_action(red_setting(name, "0"))
    assert "would not stop if this computer fails" in advice
    assert GUARDED not in advice


def test_the_advice_for_fixed_or_asynchronous_pdos_names_their_keys() -> None:
    assert "(pdos)" in next_action(
        red_setting("1601h:00", "refused: the object is read-only (06010002h)")
    )
    assert "commands: on_arrival" in next_action(red_setting("1400h:02", "FFh"))
    assert "(pdos)" not in next_action(red_setting("1601h:01", "60400010h"))
