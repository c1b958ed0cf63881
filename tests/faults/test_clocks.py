"""Drives whose clocks are wrong: a small error is tolerated, a large one stops the motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from acquisition.motion.samples import MotionSamples
from acquisition.supervision.stop_reason import StopCode
from config.load import LoadedCell

T = 0.008
AT = 230
FRAME_S = 1e-4
"""Longest delay of a heartbeat on the bus."""
Measured = Callable[[str], None]


def heartbeat_times_s(run: Any, node: int, until_s: float) -> list[float]:
    """Return the times of a drive's heartbeats on the bus before `until_s` [s]."""
    return [f.time_s for f in run.frames if f.can_id == 0x700 + node and f.time_s < until_s]


@pytest.mark.fault(11)
@pytest.mark.parametrize("way", [{"factor": 0.99}, {"ppm": 10_000.0}], ids=["slow", "fast"])
def test_a_drive_clock_error_of_one_percent_does_not_stop_the_motion(
    serve: Any, motion: MotionSamples, way: dict[str, float], measured: Measured
) -> None:
    run = serve(drives=[{"kind": "clock", "joint": "axis2", "at_cycle": 1, **way}]).move(motion)
    assert run.error is None
    assert run.reason is None
    assert run.notes == ()
    assert run.rows["valid"].all()
    assert not any(0x80 < frame.can_id < 0x100 for frame in run.frames), (
        "no drive sends an emergency message"
    )
    steps_s = np.diff(heartbeat_times_s(run, 2, run.syncs_s[-1]))[5:]
    wrong = float(np.median(steps_s)) / 0.050 - 1.0
    assert abs(wrong) == pytest.approx(0.01, rel=0.05)
    measured(f"heartbeat period {100 * wrong:+.1f} % off: no alarm, 0 answers of the drive missing")


@pytest.mark.fault(11)
def test_heartbeats_at_half_the_rate_stop_all_axes_within_the_timeout(
    serve: Any, motion: MotionSamples, loaded: LoadedCell, measured: Measured
) -> None:
    rig = serve(drives=[{"kind": "clock", "joint": "axis1", "at_cycle": AT, "factor": 0.5}])
    timeout_s = 0.08  # the heartbeat period is 50 ms before the fault and 100 ms after it
    safety = loaded.config.drive_safety.model_copy(update={"drive_heartbeat_timeout_ms": 80})
    run = rig.move(motion, config=rig.config.model_copy(update={"drive_safety": safety}))
    assert (run.reason.code, run.reason.joint) == (StopCode.HEARTBEAT_LOST, "axis1")
    stop_s = max(run.quick_stops().values())
    beats = heartbeat_times_s(run, 1, stop_s)
    assert beats[-1] > run.syncs_s[AT - 1], "the last heartbeat before the fault is in time"
    assert timeout_s - FRAME_S < stop_s - beats[-1] <= timeout_s + T
    run.assert_at_rest()
    later_s = next(t for t in heartbeat_times_s(run, 1, np.inf) if t > stop_s)
    assert later_s - beats[-1] == pytest.approx(0.100, abs=1e-3), (
        "the next heartbeat arrives too late"
    )
    measured(
        f"half the rate: quick stop {1e3 * (stop_s - beats[-1]):.1f} ms after the last heartbeat,"
        " 88 allowed"
    )


def test_a_drive_with_a_far_too_fast_clock_reports_a_lost_heartbeat_and_stops(
    serve: Any, motion: MotionSamples
) -> None:
    """The drive's clock is four times too fast: its timeout of 80 ms ends after 20 ms."""
    rig = serve(drives=[{"kind": "clock", "joint": "axis3", "at_cycle": AT, "factor": 4.0}])
    run = rig.move(motion)
    assert (run.reason.code, run.reason.joint) == (StopCode.EMERGENCY, "axis3")
    assert "heartbeat of the master lost" in run.reason.text
    emergency_s = next(f.time_s for f in run.frames if f.can_id == 0x083)
    heard_s = max(
        f.time_s for f in run.frames if f.can_id == 0x700 + 127 and f.time_s < emergency_s
    )
    assert emergency_s - heard_s == pytest.approx(0.020, abs=1e-3)
    assert run.quick_stop_cycle() - run.cycle(emergency_s) <= 2
    run.assert_at_rest()
