"""Estimation of sample times from positions and velocities.

Between two rows, a joint with velocities v and accelerations a moves by q1 - q0 = h (v0 + v1)/2 +
h^2 (a0 - a1)/12. Weighted least squares over all joints gives the length h of each interval. Each
velocity has an unknown delay and an unknown scale relative to the other joints. Delay and scale are
estimated from changes over 0.1 s, because the errors of the stamps are negligible over this time.
If the motion does not determine an interval, for example at rest, the interval is first moved close
to the mean length of the intervals with the same number of dropped repeated rows. If the mean rate
of the stamps is right, the times of such intervals are then kept close to the stamps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.clock.samples import WIDE_S, Samples, smallest_step
from acquisition.processing.smoothing import GAP_STEPS
from config.arrays import BoolArray, FloatArray, IntArray
from config.column_file import ColumnFile, each_column

ROUNDS: Final = 4
DETERMINED: Final = 0.05
"""Largest standard deviation of an interval that the motion determines, relative to the median step
of the stamps."""
FEWEST_DETERMINED: Final = 50
FEWEST_OF_CLASS: Final = 10
SHORTEST: Final = 0.1
"""Shortest permitted interval, relative to the median step of the stamps."""
ON_TICK: Final = 0.95
"""All intervals except gaps are rounded to whole ticks if at least this fraction of the
well-determined intervals are whole multiples of a common tick."""
COUNTED: Final = 0.12
"""Largest standard deviation of an interval that is rounded to whole ticks on its own [ticks]."""
RATE_KEPT: Final = 0.005
"""Relative difference of the estimated duration from the stamps' duration, below which the mean
rate of the stamps counts as right."""
LARGEST_RATE_ERROR: Final = 0.05
"""Largest relative difference between the duration computed from the velocities and that of the
stamps; if it is larger, the velocities are not used."""
SIGNIFICANT: Final = 3.0
"""Smallest common delay of the velocities that counts as significant [standard deviations]."""
WRONG_STEPS: Final = 0.5
"""Smallest common delay of the velocities that is corrected, relative to the RMS error of the
stamps' steps."""
FAR_OFF: Final = 4.0
"""Largest residual of a displacement over 0.1 s that does not count as an outlier [standard
deviations].
"""
WINDOWS_PER_STRIDE: Final = 8
"""Smallest number of windows of 0.1 s that begin within 0.1 s, if there are enough rows. More
windows overlap so much that they cost computing time, but give almost no information."""
_MAD: Final = 1.4826


@dataclass(frozen=True, eq=False)
class Times:
    """Estimated sample times.

    Attributes:
        time_s: Shape (rows,). Estimated times; the first one is the first stamp [s].
        tick_s: Time of which all intervals except gaps are whole multiples [s]; None if there is no
            such time.
        rate: Duration computed from the velocities divided by the true duration, which the stamps
            show. The intervals of `time_s`, except gaps, are already divided by this ratio.
    """

    time_s: FloatArray
    tick_s: float | None
    rate: float


@dataclass(frozen=True, eq=False)
class _Motion:
    """Positions and velocities, (rows, joints); they are the same in each iteration."""

    velocity: FloatArray
    position: FloatArray

    @classmethod
    def of(cls, samples: Samples, joints: tuple[int, ...]) -> _Motion:
        """Return the motion of some joints; the columns of all joints are not copied."""
        position, velocity = samples.position, samples.velocity
        if joints != tuple(range(position.shape[1])):
            position, velocity = (each.T[list(joints)].T for each in (position, velocity))
        return cls(velocity, position)


def estimate_times(
    samples: Samples, repeats: IntArray, joints: tuple[int, ...], rounds: int = ROUNDS
) -> Times | None:
    """Return sample times estimated from the velocities of `joints`.

    The result is None if the velocities do not determine the times.

    Args:
        samples: Rows without repeats.
        repeats: Shape (rows - 1,). Number of repeated rows that were dropped from each interval.
        joints: Joints that are used; each has a velocity.
        rounds: Number of iterations.
    """
    stamps = samples.time_s
    given, usual = np.diff(stamps), samples.period_s
    gap = given > GAP_STEPS * usual * (1 + repeats)
    motion = _Motion.of(samples, joints)
    least = noise = _smallest_noise(motion, usual)
    delay_s = _common_delay(motion, stamps)
    now, seen = stamps, ~gap
    for _ in range(rounds):
        mean, moved = _calibrate_velocities(motion, now, delay_s)
        length, sigma = _interval_lengths(mean, moved, noise)
        seen = (sigma < DETERMINED * usual) & ~gap
        if np.count_nonzero(seen) < FEWEST_DETERMINED:
            return None
        if abs(delay_s) < WRONG_STEPS * float(np.std((length - given)[seen])):
            # too small to correct: stamp errors that depend on the interval look the same
            delay_s = 0.0
        left = [
            np.median(np.abs(y - length * x)[seen])
            for x, y in zip(each_column(mean), each_column(moved), strict=True)
        ]
        noise = np.maximum(_MAD * np.array(left), least)
        length = _shrink_to_usual_length(length, sigma, seen, repeats, usual)
        length = np.where(gap, given, np.maximum(length, SHORTEST * usual))
        now = _times_from_intervals(stamps[0], length)
    length, sigma = _interval_lengths(*_calibrate_velocities(motion, now, delay_s), noise)
    tick_s = _common_tick(length[~gap], sigma[~gap], usual)
    rate, kept = _duration_ratio(given, np.diff(now), repeats, seen)
    now = _times_from_intervals(stamps[0], np.diff(now) / np.where(gap, 1.0, rate))
    if kept:
        now = _anchor_to_stamps(stamps, now, sigma, seen | gap)
    if tick_s is not None:
        tick_s = usual if abs(tick_s / usual - 1.0) < LARGEST_RATE_ERROR else tick_s / rate
        counted = gap | (sigma < COUNTED * tick_s)
        whole = _round_to_ticks(np.diff(now) / tick_s, counted, kept) * tick_s
        now = _times_from_intervals(stamps[0], np.where(gap, given, whole))
    return Times(now, tick_s, rate)


def displacement_error(samples: Samples, time_s: FloatArray, joint: int) -> FloatArray:
    """Return the displacement error of one joint in each interval, shape (rows - 1,).

    The error is the joint's displacement minus the integral of its velocity over `time_s`, after
    the scale and the delay of the velocity were corrected.
    """
    motion = _Motion.of(samples, (joint,))
    mean, moved = _calibrate_velocities(motion, time_s, None)
    return np.asarray((moved - np.diff(time_s)[:, np.newaxis] * mean)[:, 0])


def _smallest_noise(motion: _Motion, usual: float) -> FloatArray:
    """Return a lower bound for the noise of each joint's displacement, shape (joints,).

    It is computed from the resolution of the position and the noise of the velocity. The residuals
    alone do not show the noise: they vanish for a joint that determines the intervals.
    """
    steps = np.array([max(smallest_step(q), 1e-9) for q in each_column(motion.position)])
    fast = [
        np.median(np.abs(v[1:-1] - (v[2:] + v[:-2]) / 2.0)) for v in each_column(motion.velocity)
    ]
    velocity_noise = _MAD * np.array(fast) / np.sqrt(1.5)
    return np.asarray(np.hypot(steps / np.sqrt(6.0), usual * velocity_noise / np.sqrt(2.0)))


def _calibrate_velocities(
    motion: _Motion, time_s: FloatArray, delay_s: float | None
) -> tuple[FloatArray, FloatArray]:
    """Return the corrected mean velocity and the corrected displacement of each interval.

    The displacement divided by the mean velocity is the length of the interval. Velocities are
    corrected for their scale, displacements for the delay of the velocity. `delay_s` is the common
    delay of all velocities; the scales are then relative to each other. If `delay_s` is None, each
    joint is calibrated alone.
    """
    mean = _mean_velocity(motion, time_s)
    scale, late, _ = _scale_and_delay(motion, time_s, mean)
    if delay_s is not None:
        common = float(np.median(scale))
        scale = scale / common if common > 0.0 else np.ones_like(scale)
        late = late / max(common, 1e-3)
        late += delay_s - float(np.median(late))
        sound = (scale > 0.5) & (scale < 2.0) & (np.abs(late) < WIDE_S)
        scale, late = np.where(sound, scale, 1.0), np.where(sound, late, 0.0)
    for column, factor in zip(each_column(mean), scale, strict=True):
        column *= factor
    ways = zip(each_column(motion.position), each_column(motion.velocity), late, strict=True)
    moved = (np.diff(position) - by * np.diff(velocity) for position, velocity, by in ways)
    return mean, ColumnFile.of_columns(moved, len(late), len(mean))


def _common_delay(motion: _Motion, stamps: FloatArray) -> float:
    """Return the common delay of the velocities relative to the stamps; 0 if insignificant.

    Times that are estimated from the velocities cannot show this delay, because the delay shifts
    these times too. Therefore the stamps are used.
    """
    _, late, error = _scale_and_delay(motion, stamps, _mean_velocity(motion, stamps))
    common = float(np.median(late))
    return common if abs(common) > SIGNIFICANT * float(np.median(error)) else 0.0


def _mean_velocity(motion: _Motion, time_s: FloatArray) -> FloatArray:
    """Return the mean velocity of each interval, (intervals, joints)."""
    h = np.diff(time_s)

    def mean(velocity: FloatArray) -> FloatArray:
        rate = np.gradient(velocity, time_s)
        correction = h * (rate[:-1] - rate[1:]) / 12.0
        return np.asarray((velocity[1:] + velocity[:-1]) / 2.0 + correction)

    joints = motion.velocity.shape[1]
    return ColumnFile.of_columns(map(mean, each_column(motion.velocity)), joints, len(h))


def _scale_and_delay(
    motion: _Motion, time_s: FloatArray, mean: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return scale and delay of each velocity, and the standard deviation of the delay.

    Over 0.1 s the position changes by the scale times the integral of the velocity, plus the delay
    times the change of the velocity.

    Args:
        motion: Positions and velocities.
        time_s: Times of the rows [s].
        mean: Mean velocity of each interval, (intervals, joints).
    """
    h = np.diff(time_s)
    stride = min(max(1, round(WIDE_S / float(np.median(h)))), len(h))
    span = time_s[stride:] - time_s[:-stride]
    near = np.flatnonzero(span < GAP_STEPS * (WIDE_S + stride * float(np.median(h))))
    spacing = max(1, stride // WINDOWS_PER_STRIDE)
    first = near[::spacing]
    found = []
    columns = map(each_column, (mean, motion.velocity, motion.position))
    for speed, velocity, position in zip(*columns, strict=True):
        path = np.concatenate([[0.0], np.cumsum(speed * h)])
        ways = (path, velocity, position)
        x, change, y = (values[first + stride] - values[first] for values in ways)
        found.append(_fit_without_outliers(np.column_stack([x, change]), y, stride / spacing))
    scale, late, error = np.array(found).T
    return scale, late, error


def _fit_without_outliers(
    x: FloatArray, y: FloatArray, overlapping: float
) -> tuple[float, float, float]:
    """Return two coefficients, fitted without outliers, and the second one's standard error.

    Args:
        x: Shape (rows, 2). Columns of the regression.
        y: Shape (rows,). Right-hand side.
        overlapping: Number of neighbouring rows whose windows overlap, so that they share their
            noise.
    """
    solution = np.linalg.lstsq(x, y, rcond=None)[0]
    left = np.abs(y - x @ solution)
    near = left <= FAR_OFF * _MAD * float(np.median(left))
    if np.count_nonzero(near) >= len(y) / 2:
        x, y = x[near], y[near]
        solution = np.linalg.lstsq(x, y, rcond=None)[0]
    noise = float(np.mean((y - x @ solution) ** 2)) * overlapping
    error = float(np.sqrt(max(noise * np.linalg.pinv(x.T @ x)[1, 1], 0.0)))
    return float(solution[0]), float(solution[1]), error


def _interval_lengths(
    mean: FloatArray, moved: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the length of each interval and its standard deviation."""
    weight = noise**-2.0
    information, length = np.zeros(len(mean)), np.zeros(len(mean))
    for of_joint, x, y in zip(weight, each_column(mean), each_column(moved), strict=True):
        information += of_joint * x**2
        length += of_joint * x * y
    information = np.maximum(information, 1e-12)
    return length / information, information**-0.5


def _shrink_to_usual_length(
    length: FloatArray, sigma: FloatArray, seen: BoolArray, repeats: IntArray, usual: float
) -> FloatArray:
    """Return the interval lengths, shrunk towards the mean length of their class.

    A class contains the intervals with the same number of repeated rows. An interval that the
    motion determines poorly moves closer to the mean length.
    """
    drawn = np.empty_like(length)
    for number in np.unique(repeats):
        own = repeats == number
        used = own & seen
        if np.count_nonzero(used) < FEWEST_OF_CLASS:
            used = seen
        # with the median, the sum of the lengths would change
        centre = float(np.mean(length[used]))
        spread = float(np.mean((length[used] - centre) ** 2)) - float(np.median(sigma[used] ** 2))
        spread = max(spread, (1e-4 * usual) ** 2)
        drawn[own] = centre + spread / (spread + sigma[own] ** 2) * (length[own] - centre)
    return drawn


def _common_tick(length: FloatArray, sigma: FloatArray, usual: float) -> float | None:
    """Return the time of which well-determined intervals are multiples; None without one."""
    seen = sigma < 0.4 * DETERMINED * usual
    if np.count_nonzero(seen) < FEWEST_DETERMINED:
        return None
    length, sigma = length[seen], sigma[seen]
    tick = float(np.median(length))
    if tick < SHORTEST * usual:
        return None
    for _ in range(3):
        whole = np.round(length / tick)
        near = (whole >= 1.0) & (np.abs(length / tick - whole) < 0.25)
        if np.count_nonzero(near) < FEWEST_DETERMINED:
            return None
        tick = float(length[near] @ whole[near] / (whole[near] @ whole[near]))
    whole = np.round(length / tick)
    on = np.abs(length / tick - whole) < np.maximum(4.0 * sigma / tick, 0.03)
    if np.mean(on & (whole >= 1.0)) < ON_TICK:
        return None
    return tick


def _duration_ratio(
    given: FloatArray, found: FloatArray, repeats: IntArray, seen: BoolArray
) -> tuple[float, bool]:
    """Return the ratio of estimated to true duration, and True if the stamps' mean rate is right.

    Velocities can have a common scale error. Therefore the duration of the stamps counts as true.
    Inserted repeated rows make this duration too long; then only intervals without repeated rows
    are compared.
    """
    total = float(found[seen].sum() / given[seen].sum())
    plain = seen & (repeats == 0)
    if (
        not repeats.any()
        or abs(total - 1.0) < RATE_KEPT
        or np.count_nonzero(plain) < FEWEST_DETERMINED
    ):
        # Errors of the stamps at the two ends of each stretch can explain this difference.
        stretches = np.count_nonzero(np.diff(seen, prepend=False) & seen)
        error = float(np.std((found - given)[seen])) * np.sqrt(stretches) / given[seen].sum()
        return (1.0 if abs(total - 1.0) < 2.0 * error else total), True
    rate = float(np.median(found[plain] / given[plain]))
    return rate, abs(total / rate - 1.0) < RATE_KEPT


def _anchor_to_stamps(
    stamps: FloatArray, now: FloatArray, sigma: FloatArray, seen: BoolArray
) -> FloatArray:
    """Return times that stay close to the stamps if the motion does not determine them.

    The stamps must have a correct mean rate. They then prevent the errors of intervals at rest from
    adding up.
    """
    from scipy.linalg import solveh_banded  # a slow import that few recordings need

    length, given = np.diff(now), np.diff(stamps)
    usual = float(np.median(length))
    jitter = max(float(np.std((length - given)[seen])) / np.sqrt(2.0), 1e-3 * usual)
    known = np.where(seen, np.maximum(sigma, 1e-4 * usual), np.maximum(jitter, 0.1 * usual)) ** -2.0
    anchor = np.full(len(now), jitter**-2.0)
    bands = np.zeros((2, len(now)))
    bands[0, 1:] = -known
    bands[1] = anchor
    bands[1, 1:] += known
    bands[1, :-1] += known
    pull = anchor * (stamps + float(np.mean(now - stamps)))
    pull[1:] += known * length
    pull[:-1] -= known * length
    fused = solveh_banded(bands, pull)
    return _times_from_intervals(float(stamps[0]), np.maximum(np.diff(fused), SHORTEST * usual))


def _round_to_ticks(ticks: FloatArray, seen: BoolArray, anchored: bool) -> FloatArray:
    """Return the intervals, rounded to whole ticks.

    If `anchored`, a stretch that the motion does not determine keeps the sum of its intervals.
    """
    whole = np.maximum(np.round(ticks), 1.0)
    if not anchored:
        return whole
    edges = np.flatnonzero(np.diff(np.concatenate([[True], seen, [True]])))
    for first, stop in zip(edges[::2], edges[1::2], strict=True):
        count = np.arange(1, stop - first + 1)
        beyond = np.maximum(np.round(np.cumsum(ticks[first:stop])) - count, 0.0)
        whole[first:stop] = 1.0 + np.diff(np.maximum.accumulate(beyond), prepend=0.0)
    return whole


def _times_from_intervals(start: float, length: FloatArray) -> FloatArray:
    """Return the times that begin at `start` and are `length` apart."""
    return start + np.concatenate([[0.0], np.cumsum(length)])
