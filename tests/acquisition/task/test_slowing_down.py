"""Detection of an axis that brakes with less than half the quick-stop deceleration."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.task.stop_sequence import LOOK_S, OBEY_S, SLACK, DecelerationCheck

DECELERATION = 10.0


def time_of_detection(
    speed: Callable[[float], float], period_s: float, until_s: float
) -> float | None:
    """Return the time [s] at which the check reports that an axis brakes too slowly, or None."""
    position, time_s = 0.0, 0.0
    slowing = DecelerationCheck([DECELERATION], period_s, [position], time_s)
    while time_s < until_s:
        position += period_s * speed(time_s + 0.5 * period_s)
        time_s += period_s
        if slowing.too_slow(time_s, [position], [True]):
            return time_s
    return None


@given(
    period_s=st.sampled_from((0.001, 0.002, 0.008, 0.02, 0.1)),
    begins_at=st.floats(0.05, 6.0),
    share=st.floats(0.6, 3.0),
    lag_cycles=st.floats(0.0, 2.0),
)
def test_an_axis_that_brakes_as_set_is_not_reported(
    period_s: float, begins_at: float, share: float, lag_cycles: float
) -> None:
    lag_s = min(lag_cycles * period_s, 0.004)

    def speed(time_s: float) -> float:
        return max(0.0, begins_at - share * DECELERATION * max(0.0, time_s - lag_s))

    assert time_of_detection(speed, period_s, begins_at / (share * DECELERATION) + 0.5) is None


@given(
    period_s=st.sampled_from((0.001, 0.002, 0.008, 0.02, 0.1)),
    begins_at=st.floats(2.0 * SLACK, 6.0),
    share=st.floats(-2.0, 0.3),
)
def test_an_axis_that_does_not_brake_is_reported_within_three_checks(
    period_s: float, begins_at: float, share: float
) -> None:
    def speed(time_s: float) -> float:
        return begins_at - share * DECELERATION * time_s

    found_s = time_of_detection(speed, period_s, 2.0)
    look_s = max(period_s, LOOK_S + period_s)
    gone_s = (begins_at - SLACK) / DECELERATION / max(share, 1e-9)
    if gone_s > OBEY_S + 3.0 * look_s:
        assert found_s is not None
        assert found_s <= OBEY_S + 3.0 * look_s


def test_a_silent_axis_is_not_judged() -> None:
    slowing = DecelerationCheck([DECELERATION], 0.02, [0.0], 0.0)
    assert not any(slowing.too_slow(0.02 * n, [0.1 * n], [False]) for n in range(1, 100))


def test_two_positions_at_the_same_time_give_no_speed() -> None:
    slowing = DecelerationCheck([DECELERATION], 0.02, [0.0], 0.0)
    assert slowing.too_slow(0.0, [0.0], [True]) == []
    assert slowing.too_slow(0.02, [0.02], [True]) == []


@pytest.mark.parametrize("increment", [1e-6, 1e-4])
def test_an_encoder_increment_is_not_a_speed(increment: float) -> None:
    """The axis is at rest, but its encoder alternates between two counts every cycle of 1 ms."""
    slowing = DecelerationCheck([DECELERATION], 0.001, [0.0], 0.0)
    noise = [increment * (n % 2) for n in range(1, 500)]
    assert not any(slowing.too_slow(1e-3 * n, [x], [True]) for n, x in enumerate(noise, 1))
