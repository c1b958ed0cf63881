"""The thread that reads the keys: it looks up a key's meaning once, and a press is one line."""

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
    """Keys that the test holds, and the keys that were planned."""

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

    def looks_again(self) -> None:
        before = self.looks
        wait_for(lambda: self.looks > before + 2)


@pytest.fixture
def dead_man() -> DeadMan:
    dead_man = DeadMan.create()
    dead_man.report_rest(POSE, 0)
    return dead_man


def test_a_held_key_is_one_press_and_its_release_is_told(dead_man: DeadMan) -> None:
    desk = Desk()
    with DeadManThread(dead_man, 2, desk, desk.plan):
        desk.key = "+"
        wait_for(lambda: dead_man.press_count == 1)
        goal, pace = dead_man.latest_line(2)
        np.testing.assert_array_equal(goal, GOAL)
        assert pace == 1.0
        desk.looks_again()
        assert dead_man.held_until_s > safety_now_s() - 1.0
        desk.key = ""
        wait_for(lambda: dead_man.held_until_s == 0.0)
    assert dead_man.press_count == 1
    assert desk.plans == ["+"]


def test_a_key_that_was_let_go_while_its_line_was_looked_at_moves_nothing(
    dead_man: DeadMan,
) -> None:
    desk = Desk()
    desk.meanwhile = lambda: setattr(desk, "key", "")
    with DeadManThread(dead_man, 2, desk, desk.plan):
        desk.key = "+"
        wait_for(lambda: desk.plans == ["+"])
        desk.looks_again()
        assert dead_man.press_count == 0
        desk.meanwhile = lambda: None
        desk.key = "+"
        wait_for(lambda: dead_man.press_count == 1)
    assert desk.plans == ["+", "+"], "what it means may have changed"


def test_the_same_key_pressed_again_is_another_press_though_no_look_fell_between(
    dead_man: DeadMan,
) -> None:
    desk = Desk()
    with DeadManThread(dead_man, 2, desk, desk.plan):
        desk.key = "+"
        wait_for(lambda: dead_man.press_count == 1)
        desk.press = 2
        desk.looks_again()
        assert dead_man.held_until_s == 0.0, "the first press is over"
        dead_man.report_rest(POSE, 1)
        wait_for(lambda: dead_man.press_count == 2)


def test_a_key_that_was_pressed_again_while_its_line_was_looked_at_is_looked_at_again(
    dead_man: DeadMan,
) -> None:
    desk = Desk()
    desk.meanwhile = lambda: setattr(desk, "press", min(desk.press + 1, 3))
    with DeadManThread(dead_man, 2, desk, desk.plan):
        desk.key = "+"
        wait_for(lambda: dead_man.press_count == 1)
    assert desk.plans == ["+"] * 3


def test_a_key_without_a_meaning_moves_nothing(dead_man: DeadMan) -> None:
    desk = Desk()
    with DeadManThread(dead_man, 2, desk, desk.plan):
        desk.key = "x"
        wait_for(lambda: desk.plans == ["x"])
        desk.looks_again()
    assert dead_man.press_count == 0
    assert desk.plans == ["x"]


def test_nothing_is_pressed_before_the_robot_rests(dead_man: DeadMan) -> None:
    desk = Desk()
    dead_man.press(HoldLine(POSE, GOAL, 1.0), 0.0)  # under way
    with DeadManThread(dead_man, 2, desk, desk.plan):
        desk.key = "+"
        desk.looks_again()
        assert desk.plans == []
        assert not desk.begun, "keys count once the robot rests"
        dead_man.report_rest(POSE, 1)
        wait_for(lambda: dead_man.press_count == 2)


def test_the_pose_that_ends_a_motion_ends_it(dead_man: DeadMan) -> None:
    desk = Desk()
    ready: list[list[float]] = []
    with DeadManThread(
        dead_man, 2, desk, desk.plan, GOAL, lambda pose: ready.append(pose.tolist())
    ):
        desk.looks_again()
        assert not dead_man.is_finishing
        dead_man.report_rest(GOAL, 0)
        wait_for(lambda: dead_man.is_finishing)
    assert ready == [POSE.tolist()]


def test_an_error_of_its_own_releases_the_key_ends_the_motion_and_is_told(
    dead_man: DeadMan,
) -> None:
    desk = Desk()
    dead_man.hold(safety_now_s() + DEAD_MAN_S)

    def breaks() -> None:
        raise ZeroDivisionError

    desk.meanwhile = breaks
    desk.key = "+"
    with pytest.raises(ZeroDivisionError), DeadManThread(dead_man, 2, desk, desk.plan):
        wait_for(lambda: dead_man.is_finishing)
    assert dead_man.is_finishing
    assert dead_man.held_until_s == 0.0
