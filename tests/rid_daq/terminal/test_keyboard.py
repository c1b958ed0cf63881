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
    """A keyboard whose keys come when the test says so."""

    def __init__(self) -> None:
        self.now_s = 50.0
        self.tapped: list[str] = []
        self.keyboard = Keyboard(self.tapped.append, now_s=lambda: self.now_s)

    def come(self, key: str, after_s: float) -> str | None:
        """Let a key come after a time; return which key is held then."""
        self.now_s += after_s
        self.keyboard.take(key)
        return self.held()

    def held(self) -> str | None:
        return held.key if (held := self.keyboard.held) is not None else None


def test_a_key_is_held_from_its_second_repeat_on() -> None:
    desk = Desk()
    assert desk.come("+", 0.0) is None
    assert desk.come("+", 0.5) is None, "the first repeat comes late"
    assert desk.come("+", 0.03) == "+"
    assert desk.come("+", 0.1) == "+"


def test_it_is_held_for_the_stated_time_after_its_last_repeat_and_no_longer() -> None:
    desk = Desk()
    desk.come("+", 0.0)
    desk.come("+", 0.03)
    desk.now_s += 0.99 * DEAD_MAN_S
    assert desk.held() == "+"
    desk.now_s += 0.02 * DEAD_MAN_S
    assert desk.held() is None
    assert desk.come("+", 0.0) is None, "after a pause it is pressed anew"


def test_another_key_lets_the_first_go() -> None:
    desk = Desk()
    desk.come("+", 0.0)
    assert desk.come("+", 0.03) == "+"
    assert desk.come("-", 0.03) is None
    assert desk.come("-", 0.03) == "-"


def test_taps_hold_nothing_and_are_told() -> None:
    desk = Desk()
    assert [desk.come(key, 0.3) for key in "12 "] == [None] * 3
    assert desk.tapped == ["1", "2", " "]


@pytest.mark.parametrize(("sent", "meant"), [("=", "+"), ("_", "-")])
def test_shift_makes_no_other_key_of_plus_and_minus(sent: str, meant: str) -> None:
    desk = Desk()
    desk.come(sent, 0.0)
    assert desk.come(meant, 0.03) == meant


def test_without_a_terminal_there_is_no_key_to_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    with raises_code(PreflightError, "RID-KEY-NEEDED"), Keyboard():
        pass


@pytest.mark.parametrize("simulated", [True, False])
def test_a_command_by_a_held_key_needs_a_terminal(
    monkeypatch: pytest.MonkeyPatch, simulated: bool
) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    with raises_code(PreflightError, "RID-KEY-NEEDED"):
        Console().require_keys(simulated=simulated)


class Typed:
    """A keyboard that a program looks at every 10 ms, unless it is suspended."""

    def __init__(self, desk: Desk, outside: int) -> None:
        self.desk, self._outside = desk, outside

    def passes(self, time_s: float, *, looking: bool = True, repeating: bool = True) -> str | None:
        """Let time pass in which a key repeats every 30 ms or none comes; return what is held."""
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
def test_after_the_program_was_suspended_a_key_that_still_repeats_must_be_let_go_first(
    typed: Typed, suspended_s: float
) -> None:
    assert typed.passes(0.5) == "+"
    assert typed.passes(suspended_s, looking=False) is None
    assert typed.passes(2.0) is None, "the same press"
    assert typed.passes(suspended_s, looking=False) is None
    assert typed.passes(2.0) is None
    assert typed.passes(0.3, repeating=False) is None
    assert typed.passes(0.5) == "+", "another press"


def test_a_release_is_another_press(typed: Typed) -> None:
    typed.passes(0.5)
    first = typed.desk.keyboard.held
    typed.passes(0.3, repeating=False)
    typed.passes(0.5)
    second = typed.desk.keyboard.held
    assert first is not None
    assert second is not None
    assert second.press == first.press + 1


def test_a_key_that_is_held_when_the_robot_gets_ready_must_be_pressed_again(typed: Typed) -> None:
    assert typed.passes(0.5) == "+"
    typed.desk.keyboard.begin()
    assert typed.passes(2.0) is None
    typed.passes(0.3, repeating=False)
    assert typed.passes(0.5) == "+"
