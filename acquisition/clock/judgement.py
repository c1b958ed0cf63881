"""`judge_clock`: drops repeated rows, and replaces the time stamps if rebuilt times are better."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.clock.derived import velocity_changes_in_repeats, velocity_depends_on_stamps
from acquisition.clock.intervals import LARGEST_RATE_ERROR, RATE_KEPT, Times, estimate_times
from acquisition.clock.left_out_joints import LEAST_GAIN, left_out_gain
from acquisition.clock.repeats import (
    FEWEST_ROWS,
    interpolate_repeats,
    longest_run,
    repeated_positions,
    repeated_rows,
)
from acquisition.clock.report import NAMED_SHARE, ClockReport, ClockState
from acquisition.clock.samples import Samples
from acquisition.clock.torque_test import torque_gain
from acquisition.processing.smoothing import GAP_STEPS
from config.arrays import BoolArray, FloatArray
from config.column_file import each_column
from config.robot.robot import RobotDescription

UNEVEN: Final = 0.2
"""Jitter, relative to the median step, above which unconfirmed stamps are in doubt."""
TORQUE_WORSE: Final = -0.05
TORQUE_SIGMAS: Final = 3.5
SAME: Final = 0.02
"""RMS difference between estimated times and stamps, relative to the median step, up to which the
stamps count as confirmed."""


@dataclass(frozen=True, eq=False)
class JudgedClock:
    """Result of `judge_clock`.

    Attributes:
        kept: Shape (rows,). True for rows that do not repeat the previous row.
        time_s: Shape (kept rows,). Times of the kept rows [s].
        position: Shape (kept rows, joints). Positions of the kept rows [rad or m]; if a joint has
            many repeated positions, these are interpolated.
        report: Findings about the clock.
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
        samples: Rows of the recording.
        robot: Robot whose model predicts the torques. Rebuilt times that make this prediction
            clearly worse are rejected. If the joints cannot confirm the times, for example because
            only one moves, they must make it better. Without a robot, the torques are not used.
        coupling: Shape (n, n). Coupling matrix C in q = C alpha, if the positions are those of the
            actuators (alpha).
        copies: Number of rows that were already dropped because they also repeat the stamp of the
            previous row.
        left_out: Number of rows that were already dropped for other reasons; they do not count as
            missing.
    """
    repeated = repeated_rows(samples)
    kept = ~repeated
    stamps, start_s = samples.time_s[kept], float(samples.time_s[0]) if len(samples) else 0.0
    # Times since 1970 are so large that the computation would lose digits.
    samples = replace(samples, time_s=samples.time_s - start_s)
    fresh = samples.part(kept)
    missing, jitter_s = _missing_rows_and_jitter(samples.time_s)
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
        position = interpolate_repeats(fresh.time_s, fresh.position, held & (shares > NAMED_SHARE))
        doubt = "the times at which the source read its positions are unknown"
        report = replace(report, clock=ClockState.UNKNOWN, doubt=doubt)
        return JudgedClock(kept, stamps, position, report)
    times, report = _rebuild_times(samples, repeated, report, robot, coupling)
    if times is None:
        return JudgedClock(kept, stamps, fresh.position, report)
    rate, corrected_s = _rate_and_difference(fresh.time_s, times.time_s)
    report = replace(
        report,
        clock=ClockState.REBUILT,
        corrected_rms_s=corrected_s,
        rate=rate,
        tick_s=times.tick_s,
    )
    return JudgedClock(kept, start_s + times.time_s, fresh.position, report)


def _missing_rows_and_jitter(stamps: FloatArray) -> tuple[int, float]:
    """Return the number of rows missing between stamps, and the RMS jitter of the steps [s]."""
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


def _rate_and_difference(stamps: FloatArray, times: FloatArray) -> tuple[float, float]:
    """Return the rate of `times` relative to the stamps, and the remaining RMS difference [s]."""
    rate, shift = np.polyfit(stamps - stamps[0], times, 1)
    off = times - (rate * (stamps - stamps[0]) + shift)
    return float(rate), float(np.sqrt(np.mean(off**2)))


def _rebuild_times(
    samples: Samples,
    repeated: BoolArray,
    report: ClockReport,
    robot: RobotDescription | None,
    coupling: FloatArray | None,
) -> tuple[Times | None, ClockReport]:
    """Return the rebuilt times (None if they are rejected) and the completed report."""
    fresh = samples.part(~repeated)
    repeats = np.diff(np.flatnonzero(~repeated)) - 1
    doubtful = report.repeated_share > NAMED_SHARE
    doubtful |= report.jitter_rms_s > UNEVEN * samples.period_s

    def keep_stamps(why: str) -> tuple[None, ClockReport]:
        doubt = replace(report, clock=ClockState.UNKNOWN, doubt=why)
        return None, doubt if doubtful else report

    if not any(np.isfinite(velocity).all() for velocity in each_column(samples.velocity)):
        return keep_stamps("no velocities were recorded from which the times could be estimated")
    if velocity_changes_in_repeats(samples, repeated) or velocity_depends_on_stamps(samples):
        return keep_stamps(
            "the velocities were computed from the positions and the time stamps, so that they"
            " cannot confirm the stamps"
        )
    joints = fresh.moving()
    times = estimate_times(fresh, repeats, joints) if joints else None
    if times is None:
        return keep_stamps("positions and velocities do not determine the times")
    rate, corrected_s = _rate_and_difference(fresh.time_s, times.time_s)
    if corrected_s < SAME * fresh.period_s and abs(rate - 1.0) < RATE_KEPT:
        return None, replace(report, clock=ClockState.CONFIRMED)
    gain = left_out_gain(fresh, repeats)
    report = replace(report, left_out_gain=gain)
    if gain == 0.0:
        return None, replace(report, clock=ClockState.CONFIRMED)
    if abs(times.rate - 1.0) > LARGEST_RATE_ERROR:
        return keep_stamps("the velocities of all joints contradict the positions and time stamps")
    torque = None if robot is None else torque_gain(robot, fresh, times.time_s, coupling)
    report = replace(report, torque_gain=None if torque is None else torque[0])
    if gain is None:
        if torque is None or torque[0] < max(2.0 * torque[1], LEAST_GAIN):
            return keep_stamps(
                "too few joints move, or they move too little, to check other times, and the"
                " torques do not confirm them"
            )
    elif torque is not None and torque[0] < min(-TORQUE_SIGMAS * torque[1], TORQUE_WORSE):
        doubtful = True
        return keep_stamps(
            "positions and velocities contradict the time stamps, but the model predicts the"
            " torques worse with times estimated from them"
        )
    return times, report
