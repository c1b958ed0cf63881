"""Clock of the computer: sleeps never end early, and known wake-up delays are compensated."""

import time

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from drivers.ports.clock import MAX_WAKE_UP_DELAY_S, MonotonicClock

CYCLE_S = 0.001


class Computer:
    """A computer with a delay at each wake-up; reading its clock takes some time."""

    def __init__(self, waking_s: list[float]) -> None:
        self.now = 1000.0
        self._waking_s = iter(waking_s)
        self.looks = 0

    def now_s(self) -> float:
        """Return the time [s]; reading it takes 0.1 us."""
        self.looks += 1
        self.now += 1e-7
        return self.now

    def sleep(self, duration_s: float) -> None:
        assert duration_s > 0.0
        self.now += duration_s + next(self._waking_s, 0.0)


def lateness_s(waking_s: list[float]) -> list[float]:
    """Return the lateness of each cycle on a computer with the given wake-up delays [s]."""
    computer = Computer(waking_s)
    clock = MonotonicClock(computer.now_s, computer.sleep)
    found = []
    for cycle in range(1, len(waking_s) + 1):
        due_s = 1000.0 + cycle * CYCLE_S
        clock.sleep_until(due_s)
        found.append(computer.now - due_s)
    return found


@given(st.lists(st.floats(0.0, 0.0009), max_size=300))
def test_a_sleep_never_ends_early(waking_s: list[float]) -> None:
    assert all(late >= 0.0 for late in lateness_s(waking_s))


def test_the_usual_wake_up_delay_is_compensated() -> None:
    waking_s = [17e-6 + 1e-6 * (k % 5) for k in range(1000)]
    found = lateness_s(waking_s)
    assert found[0] > 17e-6
    assert max(found[300:]) < 5e-6


def test_a_stall_does_not_change_the_compensation() -> None:
    waking_s = [20e-6] * 1000
    waking_s[500] = 900e-6
    found = lateness_s(waking_s)
    assert found[500] > 800e-6
    assert max(found[300:500] + found[501:]) < 3e-6


def test_busy_waiting_is_limited() -> None:
    """After late wake-ups, a punctual one causes at most `MAX_WAKE_UP_DELAY_S` of busy waiting."""
    computer = Computer([500e-6] * 3000)
    clock = MonotonicClock(computer.now_s, computer.sleep)
    for cycle in range(1, 3001):
        clock.sleep_until(1000.0 + cycle * CYCLE_S)
    computer.looks = 0
    clock.sleep_until(1000.0 + 3001 * CYCLE_S)
    assert computer.looks < 2 + MAX_WAKE_UP_DELAY_S / 1e-7 + 2


def test_a_past_deadline_returns_at_once() -> None:
    computer = Computer([])
    MonotonicClock(computer.now_s, computer.sleep).sleep_until(999.0)
    assert computer.now < 1000.0 + 1e-6


def test_the_clock_is_the_monotonic_clock_of_the_computer() -> None:
    clock = MonotonicClock()
    until_s = clock.now_s() + 0.002
    clock.sleep_until(until_s)
    assert clock.now_s() >= until_s
    assert np.isclose(clock.now_s(), time.monotonic(), atol=1.0)
