"""The computer's clock: never early, and no later than what cannot be foreseen."""

import time

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from drivers.ports.clock import MOST_WAKING_S, MonotonicClock

CYCLE_S = 0.001


class Computer:
    """A computer that needs some time to wake up, and a little to look at its clock."""

    def __init__(self, waking_s: list[float]) -> None:
        self.now = 1000.0
        self._waking_s = iter(waking_s)
        self.looks = 0

    def now_s(self) -> float:
        """Return the time [s]; looking takes 0.1 us."""
        self.looks += 1
        self.now += 1e-7
        return self.now

    def sleep(self, duration_s: float) -> None:
        """Sleep, and wake up late."""
        assert duration_s > 0.0
        self.now += duration_s + next(self._waking_s, 0.0)


def late_s(waking_s: list[float]) -> list[float]:
    """Return how late cycles began on a computer that wakes up so late each time."""
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
    assert all(late >= 0.0 for late in late_s(waking_s))


def test_what_waking_up_always_takes_is_made_up_for() -> None:
    waking_s = [17e-6 + 1e-6 * (k % 5) for k in range(1000)]
    found = late_s(waking_s)
    assert found[0] > 17e-6
    assert max(found[300:]) < 5e-6


def test_a_stall_is_not_what_waking_up_takes() -> None:
    waking_s = [20e-6] * 1000
    waking_s[500] = 900e-6
    found = late_s(waking_s)
    assert found[500] > 800e-6
    assert max(found[300:500] + found[501:]) < 3e-6


def test_no_more_than_a_little_is_waited_out() -> None:
    """A computer that woke up late, and then does not, is waited for at most `MOST_WAKING_S`."""
    computer = Computer([500e-6] * 3000)
    clock = MonotonicClock(computer.now_s, computer.sleep)
    for cycle in range(1, 3001):
        clock.sleep_until(1000.0 + cycle * CYCLE_S)
    computer.looks = 0
    clock.sleep_until(1000.0 + 3001 * CYCLE_S)
    assert computer.looks < 2 + MOST_WAKING_S / 1e-7 + 2


def test_a_deadline_that_has_passed_is_no_sleep() -> None:
    computer = Computer([])
    MonotonicClock(computer.now_s, computer.sleep).sleep_until(999.0)
    assert computer.now < 1000.0 + 1e-6


def test_it_is_the_computers_clock() -> None:
    clock = MonotonicClock()
    until_s = clock.now_s() + 0.002
    clock.sleep_until(until_s)
    assert clock.now_s() >= until_s
    assert np.isclose(clock.now_s(), time.monotonic(), atol=1.0)
