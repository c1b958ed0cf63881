"""Simulated time catches up after short delays, but not after long delays."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from mock_hw.bus.pace import CATCHES_UP_NS, PaceKeeper

S = 1_000_000_000


@given(st.floats(0.1, 100.0), st.integers(0, 1000 * S), st.lists(st.integers(0, S), max_size=20))
def test_a_punctual_caller_keeps_the_pace(rate: float, wall_ns: int, steps: list[int]) -> None:
    pace = PaceKeeper(rate)
    pace.begin(wall_ns, 5 * S)
    simulated_ns, due_ns = 5 * S, wall_ns
    for step_ns in steps:
        simulated_ns += step_ns
        due_ns = pace.wall_ns(simulated_ns, due_ns)
        assert abs(due_ns - wall_ns - (simulated_ns - 5 * S) / rate) < 1000


def test_a_small_delay_is_compensated() -> None:
    pace = PaceKeeper(1.0)
    pace.begin(0, 0)
    assert pace.wall_ns(S, S + CATCHES_UP_NS) == S
    assert pace.wall_ns(2 * S, S + CATCHES_UP_NS) == 2 * S


def test_time_waits_for_a_late_caller_and_then_continues_evenly() -> None:
    pace = PaceKeeper(1.0)
    pace.begin(0, 0)
    assert pace.wall_ns(S, 4 * S) == 4 * S
    assert pace.wall_ns(2 * S, 4 * S) == 5 * S
