"""Lines of `check` on drives: lost and late answers, faults, settings, and positions."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from config.errors import DriverError
from config.load import load_cell
from drivers.interfaces.servo_axes import DriveEvent, DriveSetting, EventKind
from rid_daq.preflight import drives_check
from rid_daq.preflight.check_line import CheckLine
from rid_daq.preflight.drives_check import DriveTrouble, check_drives

LOADED = load_cell("ir361")
NAMES = LOADED.robot.joint_names
N = len(NAMES)
CYCLE_S = LOADED.config.cycle_time_s
CYCLES = 100
SETTING = DriveSetting("axis1", 1, "6085h:00", "quick-stop deceleration", "10", "10", "ok")


@dataclass
class Axes:
    """Drives with preset answers, on a clock that advances only by their answer times."""

    lost: Sequence[tuple[int, int]] = ()
    answer_s: Sequence[float] = (0.001,)
    events: Sequence[DriveEvent] = ()
    trouble: Exception | None = None
    answers_within_s: float = 0.004
    joint_names: tuple[str, ...] = NAMES
    now_s: float = 0.0
    cycle: int = -1
    quick_stops: int = 0
    stands: float = 0.0
    asked: list[str] = field(default_factory=list)

    def bring_up(self) -> None:
        self.asked.append("bring up")
        if self.trouble is not None:
            raise self.trouble

    def start(self) -> None:
        self.asked.append("start")

    def settings(self) -> tuple[DriveSetting, ...]:
        return (SETTING,)

    def exchange(self) -> float:
        self.cycle += 1
        sync_s = self.now_s
        self.now_s += self.answer_s[self.cycle % len(self.answer_s)]
        return sync_s

    @property
    def answers(self) -> SimpleNamespace:
        received = np.array([(self.cycle, joint) not in self.lost for joint in range(N)])
        counts = np.zeros(N, dtype=np.int32)
        return SimpleNamespace(
            received=received, position=np.full(N, self.stands), position_counts=counts
        )

    def send_heartbeat(self, now_s: float) -> None:
        assert now_s == self.now_s

    def quick_stop(self) -> None:
        self.quick_stops += 1

    def take_events(self) -> Sequence[DriveEvent]:
        return self.events

    def sleep_until(self, due_s: float) -> None:
        self.now_s = max(self.now_s, due_s)


@pytest.fixture
def check_lines(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a function that checks drives with preset answers during a hundred cycles."""

    def check(axes: Axes, lost_frames: int = 0) -> list[CheckLine]:
        clock = SimpleNamespace(now_s=lambda: axes.now_s, sleep_until=axes.sleep_until)
        link = SimpleNamespace(lost_frames=lost_frames)
        opened = SimpleNamespace(config=LOADED.config, axes=axes, clock=clock, link=link)

        @contextlib.contextmanager
        def open_cell(*_: object) -> Iterator[SimpleNamespace]:
            yield opened

        monkeypatch.setattr(drives_check, "open_cell", open_cell)
        monkeypatch.setattr(drives_check, "sender_lines", lambda *_: [])
        monkeypatch.setattr(drives_check, "watchdog_lines", lambda _, cleared: [WATCHED])
        lines, position = check_drives(
            LOADED.config, LOADED.robot, CYCLES * CYCLE_S, None, cleared=False
        )
        assert position == [axes.stands] * N
        return lines

    return check


WATCHED = CheckLine("drives", "watched", "", "", "ok")


def red_lines(lines: Sequence[CheckLine]) -> list[str]:
    return [f"{line.where}: {line.what} {line.found}" for line in lines if line.verdict == "red"]


def test_drives_that_answer_are_ok_and_their_watchdogs_are_tested_last(check_lines: Any) -> None:
    axes = Axes()
    lines = check_lines(axes)
    assert red_lines(lines) == []
    assert lines[0].what == "6085h:00 quick-stop deceleration"
    assert lines[-1] is WATCHED
    assert axes.quick_stops == CYCLES  # nothing must move


def test_missing_answers_are_counted_for_each_drive(check_lines: Any) -> None:
    lines = check_lines(Axes(lost=[(0, 1), (7, 1), (99, 2)]))
    assert red_lines(lines) == [
        "axis2, node 2: answers missing of 100 2",
        "axis3, node 3: answers missing of 100 1",
    ]
    assert WATCHED not in lines  # drives that lose answers get no watchdog trial


def test_one_slow_answer_in_a_hundred_is_ok_and_two_are_red(check_lines: Any) -> None:
    slow = 0.0051
    assert red_lines(check_lines(Axes(answer_s=[slow, *[0.001] * 99]))) == []
    (line,) = red_lines(check_lines(Axes(answer_s=[slow, slow, *[0.001] * 98])))
    assert line == "drives: time from SYNC to the last answer (99th percentile) 5.10 ms"


def test_frames_lost_by_this_computer_are_red(check_lines: Any) -> None:
    (line,) = red_lines(check_lines(Axes(), lost_frames=3))
    assert line.endswith("frames lost by this computer 3")


def test_a_fault_is_red_and_a_cleared_fault_is_not(check_lines: Any) -> None:
    events = [
        DriveEvent(EventKind.EMERGENCY, "axis1", 0.0, "axis1: emergency 7121h", 0x7121),
        DriveEvent(EventKind.EMERGENCY_CLEARED, "axis1", 0.0, "axis1: over", 0),
    ]
    assert red_lines(check_lines(Axes(events=events[1:]))) == []
    assert red_lines(check_lines(Axes(events=events))) == ["drives: faults axis1: emergency 7121h"]


def test_a_repeated_fault_is_reported_once_with_its_count(check_lines: Any) -> None:
    lost, left = (
        DriveEvent(EventKind.EMERGENCY, axis, 0.0, f"{axis}: heartbeat lost", 0x8130)
        for axis in ("axis1", "axis2")
    )
    (line,) = red_lines(check_lines(Axes(events=[lost, left, lost, lost])))
    assert line == "drives: faults axis1: heartbeat lost (3 times); axis2: heartbeat lost"


def test_settings_read_before_a_drive_error_are_reported(check_lines: Any) -> None:
    axes = Axes(trouble=DriverError("axis2 does not answer"))
    with pytest.raises(DriveTrouble) as caught:
        check_lines(axes)
    assert [line.what for line in caught.value.lines] == ["6085h:00 quick-stop deceleration"]
    assert axes.asked == ["bring up"]
    assert axes.cycle == -1


def test_a_joint_outside_its_limits_is_red(
    check_lines: Callable[..., list[CheckLine]],
) -> None:
    lines = [line for line in check_lines(Axes(stands=9.0)) if "6064h" in line.what]
    assert [line.verdict for line in lines] == ["red"] * N
    assert lines[0].found.startswith("515.66 °")
    assert "position_zero_counts" in lines[0].next_action
    lines = [line for line in check_lines(Axes()) if "6064h" in line.what]
    assert [line.verdict for line in lines] == ["ok"] * N
