"""Detection of a held key by its repetitions from the terminal."""

from __future__ import annotations

import os
import pty
from collections.abc import Iterator

import pytest

from acquisition.hold_to_run.dead_man import DEAD_MAN_S
from config.errors import PreflightError
from rid_daq.terminal.console import Console
from rid_daq.terminal.keyboard import Keyboard
from tests.builders.raised_codes import raises_code


class Desk:
    """A keyboard on which the test presses keys at given times."""

    def __init__(self) -> None:
        self.now_s = 50.0
        self.tapped: list[str] = []
        self.keyboard = Keyboard(self.tapped.append, now_s=lambda: self.now_s)

    def press(self, key: str, after_s: float) -> str | None:
        """Press a key `after_s` later; return the key that then counts as held."""
        self.now_s += after_s
        self.keyboard.take(key)
        return self.held()

    def held(self) -> str | None:
        return held.key if (held := self.keyboard.held) is not None else None


def test_a_key_is_held_from_its_second_repeat_on() -> None:
    desk = Desk()
    assert desk.press("+", 0.0) is None
    assert desk.press("+", 0.5) is None, "the first repetition is delayed"
    assert desk.press("+", 0.03) == "+"
    assert desk.press("+", 0.1) == "+"


def test_a_key_is_held_until_the_stated_time_after_its_last_repeat() -> None:
    desk = Desk()
    desk.press("+", 0.0)
    desk.press("+", 0.03)
    desk.now_s += 0.99 * DEAD_MAN_S
    assert desk.held() == "+"
    desk.now_s += 0.02 * DEAD_MAN_S
    assert desk.held() is None
    assert desk.press("+", 0.0) is None, "after a pause the key counts as pressed again"


def test_another_key_releases_the_first() -> None:
    desk = Desk()
    desk.press("+", 0.0)
    assert desk.press("+", 0.03) == "+"
    assert desk.press("-", 0.03) is None
    assert desk.press("-", 0.03) == "-"


def test_single_taps_are_reported_and_do_not_hold_a_key() -> None:
    desk = Desk()
    assert [desk.press(key, 0.3) for key in "12 "] == [None] * 3
    assert desk.tapped == ["1", "2", " "]


@pytest.mark.parametrize(("sent", "key"), [("=", "+"), ("_", "-")])
def test_plus_and_minus_are_recognised_with_and_without_shift(sent: str, key: str) -> None:
    desk = Desk()
    desk.press(sent, 0.0)
    assert desk.press(key, 0.03) == key


def test_without_a_terminal_no_key_can_be_held(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    with raises_code(PreflightError, "RID-KEY-NEEDED"), Keyboard():
        pass


@pytest.mark.parametrize("simulated", [True, False])
def test_a_hold_to_run_command_needs_a_terminal(
    monkeypatch: pytest.MonkeyPatch, simulated: bool
) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    with raises_code(PreflightError, "RID-KEY-NEEDED"):
        Console().require_keys(simulated=simulated)


class Typed:
    """A keyboard that a program reads every 10 ms, unless the program is suspended."""

    def __init__(self, desk: Desk, outside: int) -> None:
        self.desk, self._outside = desk, outside

    def let_pass(
        self, time_s: float, *, looking: bool = True, repeating: bool = True
    ) -> str | None:
        """Let time pass, by default with a key that repeats every 30 ms; return the held key."""
        for step in range(1, round(time_s / 0.01) + 1):
            self.desk.now_s += 0.01
            if repeating and step % 3 == 0:
                os.write(self._outside, b"+")
            if looking:
                self.desk.keyboard.look()
        return self.desk.held()


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> Iterator[Typed]:
    outside, inside = pty.openpty()
    with os.fdopen(inside, "r", buffering=1) as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        desk = Desk()
        with desk.keyboard:
            yield Typed(desk, outside)
    os.close(outside)


@pytest.mark.promise("held-key-suspended")
@pytest.mark.parametrize("suspended_s", [0.25, 4.0])
def test_a_key_held_during_a_suspension_must_be_released_first(
    typed: Typed, suspended_s: float
) -> None:
    assert typed.let_pass(0.5) == "+"
    assert typed.let_pass(suspended_s, looking=False) is None
    assert typed.let_pass(2.0) is None, "the same press"
    assert typed.let_pass(suspended_s, looking=False) is None
    assert typed.let_pass(2.0) is None
    assert typed.let_pass(0.3, repeating=False) is None
    assert typed.let_pass(0.5) == "+", "another press"


def test_a_key_after_a_release_counts_as_another_press(typed: Typed) -> None:
    typed.let_pass(0.5)
    first = typed.desk.keyboard.held
    typed.let_pass(0.3, repeating=False)
    typed.let_pass(0.5)
    second = typed.desk.keyboard.held
    assert first is not None
    assert second is not None
    assert second.press == first.press + 1


def test_a_key_held_before_the_robot_is_ready_must_be_pressed_again(typed: Typed) -> None:
    assert typed.let_pass(0.5) == "+"
    typed.desk.keyboard.begin()
    assert typed.let_pass(2.0) is None
    typed.let_pass(0.3, repeating=False)
    assert typed.let_pass(0.5) == "+"
