"""The switch of a simulated gripper sets a digital input of a drive."""

from __future__ import annotations

import pytest

from mock_hw.plant.load_transfer import DigitalInputs, GripperSwitch, LoadTransfer

JOINTS = ("axis1", "axis2")
CLOSED = GripperSwitch("axis2", 16, True, delay_s=0.02)
OPENED = GripperSwitch("axis2", 16, False)


def words_at(transfers: tuple[LoadTransfer, ...], *times_s: float) -> list[int]:
    """Return 60FDh of axis 2 at times of a motion that begins at 10 s."""
    inputs = DigitalInputs(transfers, JOINTS)
    inputs.begin(10.0)
    assert all(inputs.words(10.0 + time_s)[0] == 0 for time_s in times_s)
    return [inputs.words(10.0 + time_s)[1] for time_s in times_s]


def test_the_input_follows_the_transfer_after_its_delay() -> None:
    up, down = LoadTransfer("tool", 1.0, 0.1, CLOSED), LoadTransfer(None, 2.0, 0.1, OPENED)
    assert words_at((up, down), 0.5, 1.01, 1.03, 1.9, 2.01) == [0, 0, 1 << 16, 1 << 16, 0]


def test_before_a_motion_begins_the_switch_is_not_actuated() -> None:
    inputs = DigitalInputs((LoadTransfer("tool", 1.0, 0.1, OPENED),), JOINTS)
    assert inputs.words(1e9) == [0, 1 << 16]


def test_a_gripper_that_does_not_close_does_not_actuate_its_switch() -> None:
    missed = LoadTransfer("tool", 1.0, 0.1, CLOSED, missed=True)
    assert words_at((missed,), 0.5, 1.5, 5.0) == [0, 0, 0]


@pytest.mark.parametrize(("after_s", "level"), [(0.004, 1), (0.012, 0), (0.02, 1), (0.03, 1)])
def test_a_contact_that_bounces_opens_and_closes_in_turn(after_s: float, level: int) -> None:
    bouncing = GripperSwitch("axis2", 0, True, bounce_s=0.024)
    assert words_at((LoadTransfer("tool", 1.0, 0.1, bouncing),), 1.0 + after_s) == [level]
