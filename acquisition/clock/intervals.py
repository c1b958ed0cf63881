"""Sample times estimated from positions and velocities.

Between two rows a joint goes q1 - q0 = h (v0 + v1)/2 + h^2 (a0 - a1)/12: each interval h follows
by weighted least squares over all joints. A velocity's scale beside the other joints' and its
lateness are found over a tenth of a second, where the stamps' errors hardly matter.
An interval that the motion does not show, as at rest, gets the usual length of those with as many
repeated rows before them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.clock.samples import WIDE_S, Samples, smallest_step
from acquisition.processing.smoothing import GAP_STEPS
from config.arrays import BoolArray, FloatArray, IntArray

ROUNDS: Final = 4
WELL_SEEN: Final = 0.05
"""Largest standard deviation of an interval that counts as seen, in parts of the usual one."""
FEWEST_SEEN: Final = 50
FEWEST_OF_CLASS: Final = 10
SHORTEST: Final = 0.1
"""Shortest interval, in parts of the usual one: time goes forward."""
ON_TICK: Final = 0.95
"""Share of intervals that must be whole multiples of one tick for all to be."""
COUNTED: Final = 0.12
"""Largest standard deviation of an interval whose ticks can be counted, in ticks."""
RATE_KEPT: Final = 0.005
"""If the mean rate agrees with the stamps this well, theirs is kept."""
RATE_BELIEVED: Final = 0.05
"""Velocities that contradict the stamps' rate by more tell no times."""
DISTINCT: Final = 3.0
"""Standard deviations from which a common lateness of the velocities counts."""
WRONG_STEPS: Final = 0.5
"""Part of the error of the stamps' steps, RMS, that a common lateness must exceed."""
FAR_OFF: Final = 4.0
"""Standard deviations beyond which a tenth of a second does not count, as where a motion begins."""
_MAD: Final = 1.4826


@dataclass(frozen=True, eq=False)
class Times:
    """Estimated times.

    Attributes:
        time_s: Shape (rows,). The times; the first is the first stamp [s].
        tick_s: What all intervals are whole multiples of [s]; None for no such tick.
        rate: Duration by the velocities over that of the stamps; the times keep that of the stamps.
    """

    time_s: FloatArray
    tick_s: float | None
    rate: float


@dataclass(frozen=True, eq=False)
class _Motion:
    """What does not change from round to round: differences of neighbouring rows."""

    moved: FloatArray
    velocity: FloatArray
    position: FloatArray


def estimate_times(
    samples: Samples, repeats: IntArray, joints: tuple[int, ...], rounds: int = ROUNDS
) -> Times | None:
    """Return times by some joints' velocities; None if they do not show them.

    Args:
        samples: Rows without repeats.
        repeats: Shape (rows - 1,). How many repeated rows were left out in each interval.
        joints: The joints that tell; each has a velocity.
        rounds: How often the times are improved.
    """
    stamps = samples.time_s
    given, usual = np.diff(stamps), samples.period_s
    gap = given > GAP_STEPS * usual * (1 + repeats)
    chosen = list(joints)
    position = samples.position[:, chosen]
    motion = _Motion(np.diff(position, axis=0), samples.velocity[:, chosen], position)
    least = noise = _least_noise(motion, usual)
    late_s = _lateness(motion, stamps)
    now, seen = stamps, ~gap
    for _ in range(rounds):
        mean, moved = _calibrated(motion, now, late_s)
        length, sigma = _lengths(mean, moved, noise)
        seen = (sigma < WELL_SEEN * usual) & ~gap
        if np.count_nonzero(seen) < FEWEST_SEEN:
            return None
        if abs(late_s) < WRONG_STEPS * float(np.std((length - given)[seen])):
            late_s = 0.0  # stamps that are late with the steps' length say the same
        left = np.abs(moved - length[:, np.newaxis] * mean)[seen]
        noise = np.maximum(_MAD * np.median(left, axis=0), least)
        length = _with_usual(length, sigma, seen, repeats, usual)
        length = np.where(gap, given, np.maximum(length, SHORTEST * usual))
        now = _running(stamps[0], length)
    length, sigma = _lengths(*_calibrated(motion, now, late_s), noise)
    tick_s = _tick(length[~gap], sigma[~gap], usual)
    rate, kept = _rate(given, np.diff(now), repeats, seen)
    now = _running(stamps[0], np.diff(now) / np.where(gap, 1.0, rate))
    if kept:
        now = _anchored(stamps, now, sigma, seen | gap)
    if tick_s is not None:
        tick_s = usual if abs(tick_s / usual - 1.0) < RATE_BELIEVED else tick_s / rate
        counted = gap | (sigma < COUNTED * tick_s)
        whole = _whole_ticks(np.diff(now) / tick_s, counted, kept) * tick_s
        now = _running(stamps[0], np.where(gap, given, whole))
    return Times(now, tick_s, rate)


def misfit(samples: Samples, time_s: FloatArray, joint: int) -> FloatArray:
    """Return by how much a joint misses the way that its velocity says, an interval each."""
    chosen = slice(joint, joint + 1)
    position = samples.position[:, chosen]
    motion = _Motion(np.diff(position, axis=0), samples.velocity[:, chosen], position)
    mean, moved = _calibrated(motion, time_s, None)
    return np.asarray((moved - np.diff(time_s)[:, np.newaxis] * mean)[:, 0])


def _least_noise(motion: _Motion, usual: float) -> FloatArray:
    """Return the noise of each joint's way in an interval by its own steps and noise, (joints,).

    What a common interval leaves is no measure alone: it vanishes for a joint that decides it.
    """
    steps = np.array([max(smallest_step(q), 1e-9) for q in motion.position.T])
    fast = motion.velocity[1:-1] - (motion.velocity[2:] + motion.velocity[:-2]) / 2.0
    velocity_noise = _MAD * np.median(np.abs(fast), axis=0) / np.sqrt(1.5)
    return np.asarray(np.hypot(steps / np.sqrt(6.0), usual * velocity_noise / np.sqrt(2.0)))


def _calibrated(
    motion: _Motion, time_s: FloatArray, late_s: float | None
) -> tuple[FloatArray, FloatArray]:
    """Return each interval's mean velocity, and the way that is to be explained by it.

    `late_s` is the velocities' common lateness, and their scales are relative to each other; None
    if a joint stands for itself.
    """
    mean = _mean_velocity(motion, time_s)
    scale, late, _ = _scale_and_lateness(motion, time_s)
    if late_s is not None:
        common = float(np.median(scale))
        scale = scale / common if common > 0.0 else np.ones_like(scale)
        late = late / max(common, 1e-3)
        late += late_s - float(np.median(late))
        sound = (scale > 0.5) & (scale < 2.0) & (np.abs(late) < WIDE_S)
        scale, late = np.where(sound, scale, 1.0), np.where(sound, late, 0.0)
    return scale * mean, motion.moved - late * np.diff(motion.velocity, axis=0)


def _lateness(motion: _Motion, stamps: FloatArray) -> float:
    """Return by how much the velocities are late in common by the stamps; 0 if it is not distinct.

    Times that follow from velocities cannot tell it: a common lateness shifts them with the speed.
    """
    _, late, error = _scale_and_lateness(motion, stamps)
    common = float(np.median(late))
    return common if abs(common) > DISTINCT * float(np.median(error)) else 0.0


def _mean_velocity(motion: _Motion, time_s: FloatArray) -> FloatArray:
    """Return the mean velocity of each interval, (intervals, joints)."""
    h = np.diff(time_s)[:, np.newaxis]
    velocity = motion.velocity
    rate = np.gradient(velocity, time_s, axis=0)
    mean = (velocity[1:] + velocity[:-1]) / 2.0 + h * (rate[:-1] - rate[1:]) / 12.0
    return np.asarray(mean)


def _scale_and_lateness(
    motion: _Motion, time_s: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return each velocity's scale and lateness, and the standard deviation of the latter.

    Over a tenth of a second, the position changes by the scale times the integral of the velocity,
    and by the lateness times its change.
    """
    h = np.diff(time_s)
    stride = min(max(1, round(WIDE_S / float(np.median(h)))), len(h))
    mean = _mean_velocity(motion, time_s)
    path = np.vstack([np.zeros(mean.shape[1]), np.cumsum(mean * h[:, np.newaxis], axis=0)])
    span = time_s[stride:] - time_s[:-stride]
    near = span < GAP_STEPS * (WIDE_S + stride * float(np.median(h)))
    found = []
    for ways in zip(path.T, motion.velocity.T, motion.position.T, strict=True):
        x, change, y = ((values[stride:] - values[:-stride])[near] for values in ways)
        found.append(_robust(np.column_stack([x, change]), y, stride))
    scale, late, error = np.array(found).T
    return scale, late, error


def _robust(x: FloatArray, y: FloatArray, overlapping: int) -> tuple[float, float, float]:
    """Return two coefficients by least squares without far outliers, and the second one's error.

    Args:
        x: Shape (rows, 2). The columns.
        y: Shape (rows,). What they explain.
        overlapping: How many neighbouring rows share their noise.
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


def _lengths(
    mean: FloatArray, moved: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return each interval's length and its standard deviation."""
    weight = noise**-2.0
    information = np.maximum((weight * mean**2).sum(axis=1), 1e-12)
    return (weight * mean * moved).sum(axis=1) / information, information**-0.5


def _with_usual(
    length: FloatArray, sigma: FloatArray, seen: BoolArray, repeats: IntArray, usual: float
) -> FloatArray:
    """Return lengths, drawn to the usual one of their class if the motion does not show them."""
    drawn = np.empty_like(length)
    for number in np.unique(repeats):
        own = repeats == number
        told = own & seen
        if np.count_nonzero(told) < FEWEST_OF_CLASS:
            told = seen
        centre = float(np.mean(length[told]))  # rows that were skipped count: the sum must be right
        spread = float(np.mean((length[told] - centre) ** 2)) - float(np.median(sigma[told] ** 2))
        spread = max(spread, (1e-4 * usual) ** 2)
        drawn[own] = centre + spread / (spread + sigma[own] ** 2) * (length[own] - centre)
    return drawn


def _tick(length: FloatArray, sigma: FloatArray, usual: float) -> float | None:
    """Return what the well-seen intervals are multiples of; None for nothing."""
    seen = sigma < 0.4 * WELL_SEEN * usual
    if np.count_nonzero(seen) < FEWEST_SEEN:
        return None
    length, sigma = length[seen], sigma[seen]
    tick = float(np.median(length))
    if tick < SHORTEST * usual:
        return None
    for _ in range(3):
        whole = np.round(length / tick)
        near = (whole >= 1.0) & (np.abs(length / tick - whole) < 0.25)
        if np.count_nonzero(near) < FEWEST_SEEN:
            return None
        tick = float(length[near] @ whole[near] / (whole[near] @ whole[near]))
    whole = np.round(length / tick)
    on = np.abs(length / tick - whole) < np.maximum(4.0 * sigma / tick, 0.03)
    if np.mean(on & (whole >= 1.0)) < ON_TICK:
        return None
    return tick


def _rate(
    given: FloatArray, found: FloatArray, repeats: IntArray, seen: BoolArray
) -> tuple[float, bool]:
    """Return the found intervals over the true ones, and whether the stamps are right on average.

    Velocities may be off by a common factor, so that the stamps' mean rate is kept. Inserted
    repeats make their duration too long: then intervals without repeats tell.
    """
    total = float(found[seen].sum() / given[seen].sum())
    plain = seen & (repeats == 0)
    if not repeats.any() or abs(total - 1.0) < RATE_KEPT or np.count_nonzero(plain) < FEWEST_SEEN:
        # Stamps err at both ends of each stretch: a rate that these errors explain is none.
        stretches = np.count_nonzero(np.diff(seen, prepend=False) & seen)
        error = float(np.std((found - given)[seen])) * np.sqrt(stretches) / given[seen].sum()
        return (1.0 if abs(total - 1.0) < 2.0 * error else total), True
    rate = float(np.median(found[plain] / given[plain]))
    return rate, abs(total / rate - 1.0) < RATE_KEPT


def _anchored(
    stamps: FloatArray, now: FloatArray, sigma: FloatArray, seen: BoolArray
) -> FloatArray:
    """Return times that stay near the stamps where the motion does not show them.

    Stamps that are right on the average stop the errors of intervals at rest from adding up.
    """
    from scipy.linalg import solveh_banded  # large, and few recordings need it

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
    return _running(float(stamps[0]), np.maximum(np.diff(fused), SHORTEST * usual))


def _whole_ticks(ticks: FloatArray, seen: BoolArray, anchored: bool) -> FloatArray:
    """Return whole ticks an interval; a stretch that is not seen keeps their sum."""
    whole = np.maximum(np.round(ticks), 1.0)
    if not anchored:
        return whole
    edges = np.flatnonzero(np.diff(np.concatenate([[True], seen, [True]])))
    for first, stop in zip(edges[::2], edges[1::2], strict=True):
        count = np.arange(1, stop - first + 1)
        beyond = np.maximum(np.round(np.cumsum(ticks[first:stop])) - count, 0.0)
        whole[first:stop] = 1.0 + np.diff(np.maximum.accumulate(beyond), prepend=0.0)
    return whole


def _running(start: float, length: FloatArray) -> FloatArray:
    """Return times that begin at `start`, by the intervals between them."""
    return start + np.concatenate([[0.0], np.cumsum(length)])
