"""The thread that reads the jog keys and plans a straight motion (a line) for a key press."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.hold_to_run.dead_man import DEAD_MAN_S, DeadMan
from acquisition.hold_to_run.dead_man_thread import DeadManThread
from acquisition.hold_to_run.held_key import KeyPress
from acquisition.hold_to_run.line import HoldLine
from config.process.safety_clock import safety_now_s
from tests.builders.typist import wait_for

POSE = np.array([0.1, 0.2])
GOAL = np.array([0.1, 0.7])


class Desk:
    """The key that the test holds down, and the keys for which the thread has called `plan`."""

    def __init__(self) -> None:
        self.key = ""
        self.press = 1
        self.plans: list[str] = []
        self.meanwhile: Callable[[], None] = lambda: None
        self.looks = 0
        self.begun = False

    def begin(self) -> None:
        self.begun = True

    def look(self) -> KeyPress | None:
        self.looks += 1
        until_s = safety_now_s() + DEAD_MAN_S
        return KeyPress(self.key, self.press, until_s) if self.key else None

    def plan(self, key: str, pose: NDArray[np.float64]) -> HoldLine | None:
        self.plans.append(key)
        self.meanwhile()
        return HoldLine(pose, GOAL, 1.0) if key == "+" else None

    def wait_for_two_reads(self) -> None:
        before = self.looks
        wait_for(lambda: self.looks > before + 2)


@pytest.fixture
def dead_man() -> DeadMan:
    dead_man = DeadMan.create()
    dead_man.report_rest(POSE, 0)
    return dead_man


def test_a_held_key_is_one_press_and_its_release_is_reported(dead_man: DeadMan) -> None:
    desk = Desk()
    with DeadManThread(dead_man, 2, desk, desk.plan):
        desk.key = "+"
        wait_for(lambda: dead_man.press_count == 1)
        goal, pace = dead_man.latest_line(2)
        np.testing.assert_array_equal(goal, GOAL)
        assert pace == 1.0
        desk.wait_for_two_reads()
        assert dead_man.held_until_s > safety_now_s() - 1.0
        desk.key = ""
        wait_for(lambda: dead_man.held_until_s == 0.0)
    assert dead_man.press_count == 1
    assert desk.plans == ["+"]


def test_a_key_released_while_its_line_is_planned_moves_nothing(
    dead_man: DeadMan,
) -> None:
    desk = Desk()
    desk.meanwhile = lambda: setattr(desk, "key", "")
    with DeadManThread(dead_man, 2, desk, desk.plan):
        desk.key = "+"
        wait_for(lambda: desk.plans == ["+"])
        desk.wait_for_two_reads()
        assert dead_man.press_count == 0
        desk.meanwhile = lambda: None
        desk.key = "+"
        wait_for(lambda: dead_man.press_count == 1)
    assert desk.plans == ["+", "+"], (
        "the second press is planned again: the key may have a new meaning"
    )


def test_a_second_press_between_two_reads_is_a_new_press(
    dead_man: DeadMan,
) -> None:
    desk = Desk()
    with DeadManThread(dead_man, 2, desk, desk.plan):
        desk.key = "+"
        wait_for(lambda: dead_man.press_count == 1)
        desk.press = 2
        desk.wait_for_two_reads()
        assert dead_man.held_until_s == 0.0, "the first press no longer holds the key"
        dead_man.report_rest(POSE, 1)
        wait_for(lambda: dead_man.press_count == 2)


def test_a_key_pressed_again_while_its_line_is_planned_is_planned_again(
    dead_man: DeadMan,
) -> None:
    desk = Desk()
    desk.meanwhile = lambda: setattr(desk, "press", min(desk.press + 1, 3))
    with DeadManThread(dead_man, 2, desk, desk.plan):
        desk.key = "+"
        wait_for(lambda: dead_man.press_count == 1)
    assert desk.plans == ["+"] * 3


def test_a_key_without_a_meaning_moves_nothing_and_is_planned_once(dead_man: DeadMan) -> None:
    desk = Desk()
    with DeadManThread(dead_man, 2, desk, desk.plan):
        desk.key = "x"
        wait_for(lambda: desk.plans == ["x"])
        desk.wait_for_two_reads()
    assert dead_man.press_count == 0
    assert desk.plans == ["x"]


def test_no_key_is_planned_before_the_robot_rests(dead_man: DeadMan) -> None:
    desk = Desk()
    dead_man.press(HoldLine(POSE, GOAL, 1.0), 0.0)  # moving
    with DeadManThread(dead_man, 2, desk, desk.plan):
        desk.key = "+"
        desk.wait_for_two_reads()
        assert desk.plans == []
        assert not desk.begun, "a key has no effect before the robot is at rest"
        dead_man.report_rest(POSE, 1)
        wait_for(lambda: dead_man.press_count == 2)


def test_a_motion_ends_at_its_final_pose(dead_man: DeadMan) -> None:
    desk = Desk()
    ready: list[list[float]] = []
    with DeadManThread(
        dead_man, 2, desk, desk.plan, GOAL, lambda pose: ready.append(pose.tolist())
    ):
        desk.wait_for_two_reads()
        assert not dead_man.is_finishing
        dead_man.report_rest(GOAL, 0)
        wait_for(lambda: dead_man.is_finishing)
    assert ready == [POSE.tolist()]


def test_an_error_in_the_thread_releases_the_key_ends_the_motion_and_is_raised(
    dead_man: DeadMan,
) -> None:
    desk = Desk()
    dead_man.hold(safety_now_s() + DEAD_MAN_S)

    def fail() -> None:
        raise ZeroDivisionError

    desk.meanwhile = fail
    desk.key = "+"
    with pytest.raises(ZeroDivisionError), DeadManThread(dead_man, 2, desk, desk.plan):
        wait_for(lambda: dead_man.is_finishing)
    assert dead_man.is_finishing
    assert dead_man.held_until_s == 0.0
