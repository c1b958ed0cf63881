"""`judge_clock`: repeated rows are left out, and times rebuilt if everything follows better."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.clock.derived import differs_in_repeats, follows_stamps
from acquisition.clock.intervals import RATE_BELIEVED, RATE_KEPT, Times, estimate_times
from acquisition.clock.left_out import LEAST_GAIN, left_out_gain
from acquisition.clock.repeats import (
    FEWEST_ROWS,
    between,
    longest_run,
    repeated_positions,
    repeated_rows,
)
from acquisition.clock.report import NAMED_SHARE, ClockReport, ClockState
from acquisition.clock.samples import Samples
from acquisition.clock.torque_test import torque_gain
from acquisition.processing.smoothing import GAP_STEPS
from config.arrays import BoolArray, FloatArray
from config.robot.robot import RobotDescription

UNEVEN: Final = 0.2
"""Jitter beyond this part of the median step puts stamps in doubt that nothing confirms."""
TORQUE_WORSE: Final = -0.05
TORQUE_SIGMAS: Final = 3.5
SAME: Final = 0.02
"""Rebuilt times that differ from the stamps by less of the median step, RMS, confirm these."""


@dataclass(frozen=True, eq=False)
class JudgedClock:
    """A clock's judgement.

    Attributes:
        kept: Shape (rows,). Rows that do not repeat the one before.
        time_s: Shape (kept rows,). Their times [s].
        position: Shape (kept rows, joints). Their positions, those that were held interpolated [rad
            or m].
        report: What was found.
    """

    kept: BoolArray
    time_s: FloatArray
    position: FloatArray
    report: ClockReport


def judge_clock(
    samples: Samples,
    robot: RobotDescription | None = None,
    coupling: FloatArray | None = None,
    *,
    copies: int = 0,
    left_out: int = 0,
) -> JudgedClock:
    """Judge the clock of a recording.

    Args:
        samples: Its rows.
        robot: The robot, so that torques can object to rebuilt times.
        coupling: Shape (n, n). C of q = C alpha, if the positions are the actuators' alpha.
        copies: Rows that were left out before since even their stamp was that of the row before.
        left_out: Rows that were left out before for other reasons: they are not missing.
    """
    repeated = repeated_rows(samples)
    kept = ~repeated
    stamps, start_s = samples.time_s[kept], float(samples.time_s[0]) if len(samples) else 0.0
    samples = replace(samples, time_s=samples.time_s - start_s)  # epochs cost digits
    fresh = samples.part(kept)
    missing, jitter_s = _steps(samples.time_s)
    report = ClockReport(
        clock=ClockState.UNVERIFIED,
        rows=len(samples) + copies,
        repeated_rows=int(np.count_nonzero(repeated)) + copies,
        longest_repeat=max(longest_run(repeated), 2 if copies else 1),
        missing_rows=max(missing - left_out, 0),
        jitter_rms_s=jitter_s,
    )
    if len(fresh) < FEWEST_ROWS:
        return JudgedClock(kept, stamps, fresh.position, report)
    held = repeated_positions(fresh)
    shares = held.mean(axis=0)
    report = replace(report, held_share=tuple(shares.tolist()))
    if shares.max() > NAMED_SHARE:
        position = between(fresh.time_s, fresh.position, held & (shares > NAMED_SHARE))
        doubt = "it is not known when the source read its positions"
        report = replace(report, clock=ClockState.UNKNOWN, doubt=doubt)
        return JudgedClock(kept, stamps, position, report)
    times, report = _rebuilt(samples, repeated, report, robot, coupling)
    if times is None:
        return JudgedClock(kept, stamps, fresh.position, report)
    rate, corrected_s = _difference(fresh.time_s, times.time_s)
    report = replace(
        report,
        clock=ClockState.REBUILT,
        corrected_rms_s=corrected_s,
        rate=rate,
        tick_s=times.tick_s,
    )
    return JudgedClock(kept, start_s + times.time_s, fresh.position, report)


def _steps(stamps: FloatArray) -> tuple[int, float]:
    """Return how many rows are missing between stamps, and the RMS of their steps' jitter [s]."""
    steps = np.diff(stamps)
    if len(steps) < 2:
        return 0, 0.0
    usual = float(np.median(steps))
    near = steps < GAP_STEPS * usual
    off = steps / usual - np.maximum(np.round(steps / usual), 1.0)
    whole = np.abs(off) < 0.25
    missing = int(np.sum(np.round(steps[whole & near] / usual) - 1.0))
    jitter_s = usual * float(np.sqrt(np.mean(off[near] ** 2)))
    return max(missing, 0), round(jitter_s, 9)


def _difference(stamps: FloatArray, times: FloatArray) -> tuple[float, float]:
    """Return the rate of times over stamps, and by how much they differ besides, RMS [s]."""
    rate, shift = np.polyfit(stamps - stamps[0], times, 1)
    off = times - (rate * (stamps - stamps[0]) + shift)
    return float(rate), float(np.sqrt(np.mean(off**2)))


def _rebuilt(
    samples: Samples,
    repeated: BoolArray,
    report: ClockReport,
    robot: RobotDescription | None,
    coupling: FloatArray | None,
) -> tuple[Times | None, ClockReport]:
    """Return rebuilt times if they are accepted, and what is known of the clock."""
    fresh = samples.part(~repeated)
    repeats = np.diff(np.flatnonzero(~repeated)) - 1
    doubtful = report.repeated_share > NAMED_SHARE
    doubtful |= report.jitter_rms_s > UNEVEN * samples.period_s

    def not_told(why: str) -> tuple[None, ClockReport]:
        doubt = replace(report, clock=ClockState.UNKNOWN, doubt=why)
        return None, doubt if doubtful else report

    if not np.isfinite(samples.velocity).all(axis=0).any():
        return not_told("no velocities were recorded that could tell the times")
    if differs_in_repeats(samples, repeated) or follows_stamps(samples):
        return not_told(
            "its velocities are differences of the positions over the time stamps, and say nothing"
            " of them"
        )
    joints = fresh.moving()
    times = estimate_times(fresh, repeats, joints) if joints else None
    if times is None:
        return not_told("positions and velocities do not tell the times")
    rate, corrected_s = _difference(fresh.time_s, times.time_s)
    if corrected_s < SAME * fresh.period_s and abs(rate - 1.0) < RATE_KEPT:
        return None, replace(report, clock=ClockState.CONFIRMED)
    gain = left_out_gain(fresh, repeats)
    report = replace(report, left_out_gain=gain)
    if gain == 0.0:
        return None, replace(report, clock=ClockState.CONFIRMED)
    if abs(times.rate - 1.0) > RATE_BELIEVED:
        return not_told("the velocities contradict the positions and time stamps in all joints")
    torque = None if robot is None else torque_gain(robot, fresh, times.time_s, coupling)
    report = replace(report, torque_gain=None if torque is None else torque[0])
    if gain is None:
        if torque is None or torque[0] < max(2.0 * torque[1], LEAST_GAIN):
            return not_told("only one joint moves, and torques do not show other times")
    elif torque is not None and torque[0] < min(-TORQUE_SIGMAS * torque[1], TORQUE_WORSE):
        doubtful = True
        return not_told(
            "positions and velocities contradict the time stamps, but torques are predicted worse"
            " with the times that they tell"
        )
    return times, report
