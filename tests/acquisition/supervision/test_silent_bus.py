"""All drives are silent at once, or all answers arrive in a burst: this is a fault of the adapter
and not of a drive.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from acquisition.supervision.cycle import Cycle
from acquisition.supervision.stop_reason import StopCode
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from tests.acquisition.supervision.test_supervisor import Fault, Watch, at_speed


@pytest.fixture
def watch(cell: CellConfig, robot: RobotDescription) -> Watch:
    return at_speed(cell, robot)


def delayed_frames(silent: Callable[[int], bool], released: int) -> Fault:
    """Return a fault that blocks all answers in some cycles and then releases them together.

    From cycle `released` on, two answers of each drive are counted.
    """

    def fault(cycle: Cycle) -> None:
        cycle.second_answers = [int(cycle.number >= released)] * 3
        if silent(cycle.number) or cycle.number == released:
            cycle.received = [False] * 3

    return fault


def all_silent(cycle: Cycle) -> None:
    if cycle.number >= 10:
        cycle.received = [False] * 3


@pytest.mark.parametrize(
    "fault", [all_silent, delayed_frames(lambda k: k in (10, 11), 12)], ids=["silent", "in a bunch"]
)
def test_silence_of_all_drives_is_blamed_on_the_adapter(watch: Watch, fault: Fault) -> None:
    number, reason = watch.run(fault)
    assert reason is not None
    assert (reason.code, number, reason.joint) == (StopCode.MISSED_FRAMES, 12, None)
    assert "adapter" in reason.text


def test_frames_delayed_by_one_cycle_stop_nothing(watch: Watch) -> None:
    assert watch.run(delayed_frames(lambda k: k == 10, 11)) == (None, None)


def test_a_gateway_that_repeats_the_frames_of_all_drives_is_a_second_sender(watch: Watch) -> None:
    def repeated(cycle: Cycle) -> None:
        cycle.second_answers = [max(0, cycle.number - 9)] * 3
        if cycle.number >= 10:
            cycle.received = [False] * 3

    _, reason = watch.run(repeated)
    assert reason is not None
    assert reason.code is StopCode.SECOND_ANSWERS
