"""Arrival times of frames are computed from kernel time stamps of a wall clock that can jump
(docs/faults.md, row 26).
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.ports.socketcan_port import KernelStamps, both_clocks

CYCLE_NS = 8_000_000
NOW_NS = 10**15
AHEAD_NS = 1_800_000_000 * 10**9
HOUR_NS = 3600 * 10**9
LEAPS_NS = st.integers(-HOUR_NS, HOUR_NS).filter(lambda step_ns: abs(step_ns) > CYCLE_NS)
WAITED_NS = st.integers(0, CYCLE_NS)


def stamps() -> KernelStamps:
    """Return kernel time stamps; wall clock and monotonic clock were last compared a cycle ago."""
    return KernelStamps(NOW_NS - CYCLE_NS + AHEAD_NS, NOW_NS - CYCLE_NS)


@given(waited_ns=WAITED_NS, step_ns=LEAPS_NS | st.just(0), stamped_before=st.booleans())
def test_the_arrival_time_of_a_frame_is_correct_after_a_jump_of_the_date(
    waited_ns: int, step_ns: int, stamped_before: bool
) -> None:
    waiting = stamps()
    waiting.look(NOW_NS + AHEAD_NS + step_ns, NOW_NS)
    stamp_ns = NOW_NS - waited_ns + AHEAD_NS + (0 if stamped_before else step_ns)
    assert waiting.arrival_s(stamp_ns) == pytest.approx((NOW_NS - waited_ns) * 1e-9, abs=1e-6)


@given(waited_ns=WAITED_NS, step_ns=st.integers(-CYCLE_NS, CYCLE_NS), stamped_before=st.booleans())
def test_a_small_step_of_the_date_bounds_the_error_of_the_arrival_time(
    waited_ns: int, step_ns: int, stamped_before: bool
) -> None:
    waiting = stamps()
    waiting.look(NOW_NS + AHEAD_NS + step_ns, NOW_NS)
    found_s = waiting.arrival_s(NOW_NS - waited_ns + AHEAD_NS + (0 if stamped_before else step_ns))
    assert abs(found_s - (NOW_NS - waited_ns) * 1e-9) <= abs(step_ns) * 1e-9 + 1e-6


@given(waited_ns=WAITED_NS, step_ns=LEAPS_NS)
def test_a_date_set_during_reading_shifts_arrival_times_by_at_most_a_cycle(
    waited_ns: int, step_ns: int
) -> None:
    waiting = stamps()
    waiting.look(NOW_NS + AHEAD_NS, NOW_NS)
    found_s = waiting.arrival_s(NOW_NS - waited_ns + AHEAD_NS + step_ns)
    assert abs(found_s - (NOW_NS - waited_ns) * 1e-9) <= CYCLE_NS * 1e-9 + 1e-6


@given(waited_ns=st.integers(0, 20 * CYCLE_NS))
def test_the_arrival_time_of_a_frame_read_late_is_correct(waited_ns: int) -> None:
    waiting = KernelStamps(NOW_NS - 20 * CYCLE_NS + AHEAD_NS, NOW_NS - 20 * CYCLE_NS)
    for ago in range(10, -1, -1):
        now_ns = NOW_NS - ago * CYCLE_NS
        waiting.look(now_ns + AHEAD_NS, now_ns)
    found_s = waiting.arrival_s(NOW_NS - waited_ns + AHEAD_NS)
    assert found_s == pytest.approx((NOW_NS - waited_ns) * 1e-9, abs=1e-6)


@given(step_ns=LEAPS_NS)
def test_arrival_times_are_correct_in_the_cycle_after_a_jump_of_the_date(step_ns: int) -> None:
    waiting = stamps()
    waiting.look(NOW_NS + AHEAD_NS + step_ns, NOW_NS)
    waiting.all_read()
    later_ns = NOW_NS + CYCLE_NS
    waiting.look(later_ns + AHEAD_NS + step_ns, later_ns)
    found_s = waiting.arrival_s(later_ns - 100_000 + AHEAD_NS + step_ns)
    assert found_s == pytest.approx((later_ns - 100_000) * 1e-9, abs=1e-6)


def test_both_clocks_are_read_again_after_a_pause_between_the_readings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    readings = iter([0, 1_000_000, 1_000_100, 1_000_300])
    monkeypatch.setattr("time.monotonic_ns", lambda: next(readings))
    dates = iter([AHEAD_NS, AHEAD_NS + 1_000_200])
    monkeypatch.setattr("time.time_ns", lambda: next(dates))
    assert both_clocks() == (AHEAD_NS + 1_000_200, 1_000_300)
