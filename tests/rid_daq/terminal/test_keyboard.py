"""Which key is held, by the repeats that a terminal sends of it."""

from __future__ import annotations

import pytest

from acquisition.hold_to_run.dead_man import DEAD_MAN_S
from config.errors import PreflightError
from rid_daq.terminal.keyboard import Keyboard


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
    with pytest.raises(PreflightError, match="run the command in a terminal"), Keyboard():
        pass
