"""All drives silent at once, or answering in a bunch: the adapter's fault, and no drive's."""

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


def held_up(silent: Callable[[int], bool], released: int) -> Fault:
    """No drive answers in some cycles; then the frames go out together, and each answers twice."""

    def fault(cycle: Cycle) -> None:
        cycle.second_answers = [int(cycle.number >= released)] * 3
        if silent(cycle.number) or cycle.number == released:
            cycle.received = [False] * 3

    return fault


def all_silent(cycle: Cycle) -> None:
    if cycle.number >= 10:
        cycle.received = [False] * 3


@pytest.mark.parametrize(
    "fault", [all_silent, held_up(lambda k: k in (10, 11), 12)], ids=["silent", "in a bunch"]
)
def test_what_silences_all_drives_is_no_drives_fault(watch: Watch, fault: Fault) -> None:
    number, reason = watch.run(fault)
    assert reason is not None
    assert (reason.code, number, reason.joint) == (StopCode.MISSED_FRAMES, 12, None)
    assert "adapter" in reason.text


def test_frames_that_are_held_up_for_a_cycle_stop_nothing(watch: Watch) -> None:
    assert watch.run(held_up(lambda k: k == 10, 11)) == (None, None)


def test_a_gateway_that_repeats_every_drives_frames_is_another_sender(watch: Watch) -> None:
    def repeated(cycle: Cycle) -> None:
        cycle.second_answers = [max(0, cycle.number - 9)] * 3
        if cycle.number >= 10:
            cycle.received = [False] * 3

    _, reason = watch.run(repeated)
    assert reason is not None
    assert reason.code is StopCode.SECOND_ANSWERS
