"""`PlateTiming`: delay and clock of a force plate, estimated from the motion of the robot.

At the right delay, each reading of a plate is a combination of a constant, a trend and the six
components of the base wrench. The wrench is linear in the robot's parameters. Combinations and
parameters are estimated together with the delay, by variable projection (Golub and Pereyra 1973).
The description of the plate is not used. Therefore a wrong description has no effect on the delay.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.recording.recording import Recording
from config.arrays import BoolArray, FloatArray
from config.cell.torque_filter import ButterworthFilter
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from identification.calibration.plate_signals import (
    FEWEST_SAMPLES,
    LowPassedReadings,
    WrenchFunctions,
)

CUTOFF_HZ: Final = 10.0
TRIALS_PER_CUTOFF: Final = 12.0
"""Delays tried per period of the cut-off frequency."""
MOST_COARSE_SAMPLES: Final = 800
"""Number of samples that the search of the delay on a grid uses at most."""
CANDIDATES: Final = 4
"""Number of delays with small residuals that are refined."""
SHARED_RANGE_S: Final = 2.0
"""Largest delay that is searched for on a shared clock [s]."""
LEAST_OVERLAP: Final = 0.5
LEAST_EXPLAINED: Final = 0.7
STEPS: Final = 60
FIRST_STEPS: Final = 8
"""Number of steps for each of the best delays, before the best delay is chosen."""
WEIGHTING_STEPS: Final = 5
"""Number of steps in which the weights of the readings are adapted to their residuals."""
SMALLEST_STEP_S: Final = 1e-8
DAMPING: Final = 1e-9
BLOCKS: Final = 16
EQUAL_COST: Final = 0.05
"""Largest difference of the unexplained shares of two delays, whole periods apart, that count as
equal.
"""
CLEARLY_WORSE: Final = 4.0
"""Factor by which the unexplained share at each other delay must exceed that at the best delay."""
MODEL_ERROR_S: Final = 2e-4
"""Standard deviation of the delay due to errors of the robot's lengths and axes [s]. Axes wrong by
2 mrad and 1 mm shift the delay by 0.07 ms (RMS, arms of `benchmarks.plates`)."""


@dataclass(frozen=True)
class PlateTiming:
    """Relation of a plate's clock to that of the positions.

    A row of the plate with the stamp `lag_s + t + rate (t - middle_s)` was measured at time t.

    Attributes:
        lag_s, lag_std_s: Delay of the plate's stamps in the middle of the recording, and its
            standard deviation [s].
        rate, rate_std: Seconds that the plate's clock gains per second, and its standard
            deviation; 0 with a shared clock.
        middle_s: Middle of the recording [s].
        explained_share: Fraction of the readings' variance that the motion explains.
    """

    lag_s: float
    lag_std_s: float
    rate: float
    rate_std: float
    middle_s: float
    explained_share: float

    def to_recording(self, stamp_s: FloatArray) -> FloatArray:
        """Return the times of the recording at stamps of the plate [s]."""
        late = np.asarray(stamp_s) - self.lag_s + self.rate * self.middle_s
        return np.asarray(late / (1.0 + self.rate))

    def to_stamp(self, time_s: float) -> float:
        """Return the stamp of the plate at a time of the recording [s]."""
        return self.lag_s + time_s + self.rate * (time_s - self.middle_s)


def estimate_plate_timing(
    recording: Recording,
    robot: RobotDescription,
    stamp_s: FloatArray,
    readings: FloatArray,
    valid: BoolArray,
    low_pass_filter: ButterworthFilter | None,
    *,
    own_clock: bool,
) -> PlateTiming:
    """Estimate the delay of a plate's readings, and with `own_clock` the rate of its clock.

    A delay is searched for within `SHARED_RANGE_S` on a shared clock. For a plate with its own
    clock, every delay is tried with which the readings cover at least half of the recording. The
    search uses the arm of the robot's drawings; the best delays are then refined together with the
    arm's parameters. Of delays that differ by whole periods of the motion, the one with the largest
    overlap is chosen. The standard deviations follow from the scatter between blocks of time and
    from `MODEL_ERROR_S`.

    Args:
        recording: Positions of the robot.
        robot: Robot with the kinematics.
        stamp_s: Shape (rows,). Increasing stamps of the plate's rows [s].
        readings: Shape (rows, c). Readings in any unit.
        valid: Shape (rows, c). False for readings that are saturated.
        low_pass_filter: Low-pass of the amplifier, which is compensated first.
        own_clock: True if the plate's clock has its own offset and rate.

    Raises:
        DataQualityError: The motion is too short, the readings are constant or do not overlap it,
            do not follow it at any delay, or follow it equally well at several delays.
    """
    step_s = float(np.median(np.diff(recording.time_s[recording.valid])))
    plate_step_s = float(np.median(np.diff(stamp_s)))
    cutoff_hz = min(CUTOFF_HZ, 0.2 / step_s, 0.2 / plate_step_s)
    motion = WrenchFunctions.of(recording, robot, cutoff_hz)
    read = LowPassedReadings.of(stamp_s, readings, valid, low_pass_filter, cutoff_hz)
    period_s = None
    if recording.samples_per_period is not None and recording.sample_period_s is not None:
        period_s = recording.samples_per_period * recording.sample_period_s
    lags = _coarse_lags(motion, read, cutoff_hz, own_clock, period_s)
    found: list[PlateTiming] = []
    refusals: list[DataQualityError] = []
    for lag_s in lags:
        try:
            found.append(_refine(motion, read, lag_s, own_clock, FIRST_STEPS))
        except DataQualityError as error:  # the search left the plate's rows
            refusals.append(error)
    if not found:
        raise refusals[0]
    best = max(found, key=lambda each: each.explained_share)
    if best.explained_share < LEAST_EXPLAINED:
        raise DataQualityError(
            f"the motion explains only {100.0 * max(best.explained_share, 0.0):.0f} % of the force"
            f" plate's readings at the best delay, {1e3 * best.lag_s:.1f} ms: check the plate's"
            " columns and time stamps, and whether plate and positions are of the same motion",
            code="RID-PLATE-CLOCK",
        )
    most_left = CLEARLY_WORSE * (1.0 - best.explained_share)
    for other in found:
        away_s = other.lag_s - best.lag_s
        if period_s is not None:
            away_s = float(np.remainder(away_s + period_s / 2.0, period_s) - period_s / 2.0)
        if abs(away_s) > 0.5 / cutoff_hz and 1.0 - other.explained_share < most_left:
            raise DataQualityError(
                "the motion does not determine the delay of the force plate:"
                f" {1e3 * best.lag_s:.1f} and {1e3 * other.lag_s:.1f} ms explain the readings"
                " almost equally well: state period_s in the map if the motion repeats, or"
                " plate.lag_s; otherwise record a longer and more varied motion",
                code="RID-PLATE-CLOCK",
            )
    return _refine(motion, read, best.lag_s, own_clock, STEPS)


def _coarse_lags(
    motion: WrenchFunctions,
    read: LowPassedReadings,
    cutoff_hz: float,
    own_clock: bool,
    period_s: float | None,
) -> list[float]:
    """Return the delays with the smallest residuals on a grid, for the arm of the drawings."""
    step_s = 1.0 / (TRIALS_PER_CUTOFF * cutoff_hz)
    first_s, last_s = float(motion.time_s[0]), float(motion.time_s[-1])
    spare = (1.0 - LEAST_OVERLAP) * (last_s - first_s)
    low, high = read.first_s - first_s - spare, read.last_s - last_s + spare
    if not own_clock:
        low, high = max(low, -SHARED_RANGE_S), min(high, SHARED_RANGE_S)
    lags = np.arange(np.ceil(low / step_s), np.floor(high / step_s) + 1.0) * step_s
    if len(lags) == 0:
        raise DataQualityError(
            f"the force plate's rows are from {read.first_s:.6g} to {read.last_s:.6g} s, but the"
            f" positions from {first_s:.6g} to {last_s:.6g} s: check the time stamps"
            + (
                "; the plate must measure at least half of the motion"
                if own_clock
                else ", or set `clock: own` if the plate has its own clock"
            ),
            code="RID-PLATE-CLOCK",
        )
    sparse = slice(None, None, 1 + len(motion.time_s) // MOST_COARSE_SAMPLES)
    sample_s, every = motion.time_s[sparse], motion.columns(motion.drawn)[sparse]
    whole = np.linalg.qr(every)[0]
    costs = np.empty(len(lags))
    overlaps = np.empty(len(lags))
    for k, lag_s in enumerate(lags.tolist()):
        at_s = sample_s + lag_s
        inside = (at_s >= read.first_s) & (at_s <= read.last_s)
        values = np.asarray(read.curve(at_s[inside]))
        overlaps[k] = inside.mean()
        columns = whole if inside.all() else np.linalg.qr(every[inside])[0]
        left = np.sum(values**2, axis=0) - np.sum((columns.T @ values) ** 2, axis=0)
        level = np.sum((values - values.mean(axis=0)) ** 2, axis=0)
        costs[k] = float(np.mean(np.maximum(left, 0.0) / np.maximum(level, 1e-300)))
    found: list[float] = []
    free = np.ones(len(lags), dtype=np.bool_)
    while free.any() and len(found) < CANDIDATES:
        best = int(np.flatnonzero(free)[np.argmin(costs[free])])
        away = lags - lags[best]
        periods = np.zeros(len(lags)) if period_s is None else np.rint(away / period_s) * period_s
        same = np.flatnonzero((np.abs(away - periods) <= 0.5 * step_s) & free)
        same = same[costs[same] <= costs[best] + EQUAL_COST]
        # After whole periods, the readings fit equally well.
        found.append(float(lags[same[np.argmax(np.round(overlaps[same], 3))]]))
        free &= np.abs(away - periods) > 0.5 / cutoff_hz
    return found


def _refine(
    motion: WrenchFunctions,
    read: LowPassedReadings,
    lag_s: float,
    own_clock: bool,
    steps: int,
) -> PlateTiming:
    """Improve delay and parameters by Gauss-Newton steps; with an own clock also its rate."""
    middle_s = float(motion.time_s[0] + motion.time_s[-1]) / 2.0
    since = motion.time_s - middle_s
    scale = max(float(np.abs(since).max()), 1e-9)
    powers = np.column_stack([np.ones(len(since)), since / scale])[:, : 2 if own_clock else 1]
    clock = np.zeros(powers.shape[1])
    clock[0] = lag_s
    theta = motion.drawn
    weight = np.empty(0)
    for number in range(steps):
        at_s = motion.time_s + powers @ clock
        used = read.usable(at_s, 1.0 / CUTOFF_HZ)
        if used.sum() < FEWEST_SAMPLES:
            raise DataQualityError(
                "too few valid rows of the force plate are at the times of the motion: check the"
                " time stamps and `saturation` in the map",
                code="RID-PLATE-CLOCK",
            )
        values, rates = read.curve(at_s[used]), read.curve(at_s[used], 1)
        columns = motion.columns(theta)[used]
        basis = np.linalg.qr(columns)[0]
        mixing = np.linalg.lstsq(columns, values, rcond=None)[0][2:]
        left = values - basis @ (basis.T @ values)
        level = values - values.mean(axis=0)
        if number < WEIGHTING_STEPS:
            weight = 1.0 / np.maximum(np.mean(left**2, axis=0), 1e-6 * np.mean(level**2, axis=0))
        late = rates[:, np.newaxis, :] * powers[used][:, :, np.newaxis]
        moved = motion.wrench[used].swapaxes(1, 2) @ mixing
        slopes = np.concatenate([late, -moved], axis=1)
        flat = slopes.reshape(len(slopes), -1)
        slopes = (flat - basis @ (basis.T @ flat)).reshape(slopes.shape)
        scores = (slopes @ (weight * left)[:, :, np.newaxis])[:, :, 0]
        tall = (np.sqrt(weight) * slopes).swapaxes(1, 2).reshape(-1, slopes.shape[1])
        inverse = _inverse(tall.T @ tall)
        step = inverse @ scores.sum(axis=0)
        clock, theta = clock - step[: len(clock)], theta - step[len(clock) :]
        if np.abs(step[: len(clock)]).max() < SMALLEST_STEP_S:
            break
    shares = np.mean(left**2, axis=0) / np.mean(level**2, axis=0)
    shifts = scores @ inverse[:, : len(clock)]
    parts = np.array([part.sum(axis=0) for part in np.array_split(shifts, BLOCKS)])
    variance = np.sum(parts**2, axis=0) * BLOCKS / (BLOCKS - 1)
    std = np.hypot(np.sqrt(variance), MODEL_ERROR_S)
    rate, rate_std = (clock[1] / scale, std[1] / scale) if own_clock else (0.0, 0.0)
    return PlateTiming(
        lag_s=float(clock[0]),
        lag_std_s=float(std[0]),
        rate=float(rate),
        rate_std=float(rate_std),
        middle_s=middle_s,
        explained_share=1.0 - float(np.mean(shares)),
    )


def _inverse(normal: FloatArray) -> FloatArray:
    """Return the pseudo-inverse of a normal matrix; undetermined directions become zero."""
    size = np.sqrt(np.maximum(np.diagonal(normal), 1e-300))
    return np.asarray(
        np.linalg.pinv(normal / np.outer(size, size), DAMPING, hermitian=True)
        / np.outer(size, size)
    )
