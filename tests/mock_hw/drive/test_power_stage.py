"""CiA 402 power states, with their ramps and option codes."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.servo.cia402 import PowerState, state_of
from mock_hw.drive.object_dictionary import ObjectDictionary
from mock_hw.drive.objects import (
    DISABLE_OPERATION_OPTION,
    PROFILE_DECELERATION,
    QUICK_STOP_DECELERATION,
    QUICK_STOP_OPTION,
    SHUTDOWN_OPTION,
    SimulatedIdentity,
    drive_entries,
)
from mock_hw.drive.power_stage import PowerStage, Ramp


@pytest.fixture
def objects() -> ObjectDictionary:
    entries = ObjectDictionary(drive_entries(SimulatedIdentity(1, 4096, Fraction(100), 2000)))
    entries[QUICK_STOP_DECELERATION] = 2000
    entries[PROFILE_DECELERATION] = 1000
    return entries


@pytest.fixture
def running(objects: ObjectDictionary) -> PowerStage:
    """A power stage that runs at velocity 1000 (in the unit of the drive) from time 0 on."""
    power = PowerStage(objects)
    power.boot()
    for word in (0x06, 0x07, 0x0F):
        power.command(word, -1.0)
    power.set_target(1000.0, -0.008, 0.008)
    assert power.velocity_at(0.0) == 1000.0
    return power


def test_the_states_up_to_operation_enabled_and_their_status_words(
    objects: ObjectDictionary,
) -> None:
    power = PowerStage(objects)
    states = [state_of(power.statusword())]
    power.boot()
    for word in (0x00, 0x06, 0x07, 0x0F):
        power.command(word, 0.0)
        states.append(state_of(power.statusword()))
    assert states == [
        PowerState.NOT_READY_TO_SWITCH_ON,
        PowerState.SWITCH_ON_DISABLED,
        PowerState.READY_TO_SWITCH_ON,
        PowerState.SWITCHED_ON,
        PowerState.OPERATION_ENABLED,
    ]
    assert power.statusword() & 0x1000, "drive follows command"


def test_a_target_is_reached_linearly_within_the_interpolation_period(running: PowerStage) -> None:
    running.set_target(2000.0, 1.0, 0.008)
    assert [running.velocity_at(t) for t in (1.0, 1.004, 1.008, 9.0)] == [
        1000.0,
        pytest.approx(1500.0),
        2000.0,
        2000.0,
    ]


@pytest.mark.parametrize(
    ("option", "ramp_s", "after"),
    [
        (0, 0.0, PowerState.SWITCH_ON_DISABLED),
        (1, 1.0, PowerState.SWITCH_ON_DISABLED),
        (2, 0.5, PowerState.SWITCH_ON_DISABLED),
        (5, 1.0, PowerState.QUICK_STOP_ACTIVE),
        (6, 0.5, PowerState.QUICK_STOP_ACTIVE),
    ],
)
def test_a_quick_stop_follows_605a(
    running: PowerStage, objects: ObjectDictionary, option: int, ramp_s: float, after: PowerState
) -> None:
    objects[QUICK_STOP_OPTION] = option
    running.command(0x02, 0.0)
    if ramp_s:
        assert running.state is PowerState.QUICK_STOP_ACTIVE
        assert running.velocity_at(0.5 * ramp_s) == 500.0
    running.advance(ramp_s)
    assert running.state is after
    assert running.velocity_at(ramp_s) == 0.0


def test_a_quick_stop_cannot_be_left_for_operation_before_its_end(running: PowerStage) -> None:
    running.command(0x02, 0.0)
    running.command(0x0F, 0.1)
    running.set_target(5000.0, 0.1, 0.008)
    assert running.state is PowerState.QUICK_STOP_ACTIVE
    assert running.velocity_at(0.25) == 500.0


def test_a_quick_stop_that_stays_in_its_state_can_be_left(
    running: PowerStage, objects: ObjectDictionary
) -> None:
    objects[QUICK_STOP_OPTION] = 6
    running.command(0x02, 0.0)
    running.command(0x0F, 1.0)
    assert running.state is PowerState.OPERATION_ENABLED
    assert running.velocity_at(1.0) == 0.0


@pytest.mark.parametrize(
    ("word", "option", "after"),
    [
        (0x07, DISABLE_OPERATION_OPTION, PowerState.SWITCHED_ON),
        (0x06, SHUTDOWN_OPTION, PowerState.READY_TO_SWITCH_ON),
    ],
)
def test_disabling_with_a_ramp_brakes_before_power_off(
    running: PowerStage,
    objects: ObjectDictionary,
    word: int,
    option: tuple[int, int],
    after: PowerState,
) -> None:
    objects[option] = 1
    running.command(word, 0.0)
    assert running.state is PowerState.OPERATION_ENABLED
    assert not running.following
    running.command(word, 0.4)
    assert running.next_s == 1.0, "repeating the command does not prolong the ramp"
    running.advance(1.0)
    assert running.state is after
    objects[option] = 0


def test_disable_voltage_acts_at_once(running: PowerStage) -> None:
    running.command(0x00, 0.0)
    assert running.state is PowerState.SWITCH_ON_DISABLED
    assert not running.powered


def test_a_fault_without_power_acts_at_once(objects: ObjectDictionary) -> None:
    power = PowerStage(objects)
    power.boot()
    power.fault(0.0)
    assert power.state is PowerState.FAULT


@given(
    st.lists(
        st.one_of(
            st.sampled_from([0x00, 0x02, 0x06, 0x07, 0x0F, 0x80, 0xFFFF]),
            st.sampled_from(["fault", "abort", "wait", "target"]),
        ),
        max_size=40,
    )
)
def test_no_sequence_of_events_skips_the_states_or_keeps_power_in_a_fault(
    events: list[int | str],
) -> None:
    power = PowerStage(
        ObjectDictionary(drive_entries(SimulatedIdentity(1, 4096, Fraction(1), 2000)))
    )
    power.boot()
    now_s = 0.0
    for event in events:
        before = power.state
        now_s += 0.008
        if power.next_s <= now_s:
            power.advance(now_s)
            before = power.state
        if event == "fault":
            power.fault(now_s)
        elif event == "abort":
            power.abort_connection(now_s)
        elif event == "target":
            power.set_target(1e5, now_s, 0.008)
        elif event == "wait":
            now_s += 100.0
            power.advance(now_s)
        elif isinstance(event, int):
            power.command(event, now_s)
        if power.state is PowerState.OPERATION_ENABLED:
            assert before in (PowerState.SWITCHED_ON, PowerState.OPERATION_ENABLED)
        if not power.powered:
            assert power.velocity_at(now_s) == 0.0
        assert state_of(power.statusword()) is power.state


def test_a_ramp_is_constant_before_and_after() -> None:
    ramp = Ramp(1.0, 2.0, -4.0, 4.0)
    assert [ramp.at(t) for t in (0.0, 1.0, 1.5, 2.0, 3.0)] == [-4.0, -4.0, 0.0, 4.0, 4.0]
