"""Whether a joint that was left out follows better from rebuilt times than from the stamps."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from acquisition.clock.intervals import estimate_times, misfit
from acquisition.clock.samples import STANDSTILL_SPEED, Samples, smallest_step
from config.arrays import FloatArray, IntArray

JUDGED_ROWS: Final = 60_000
"""Of longer recordings the middle is judged."""
BLOCK_ROWS: Final = 200
FEWEST_BLOCKS: Final = 8
LEAST_GAIN: Final = 0.05
WORSE: Final = -0.02
ROUNDS: Final = 2


def left_out_gain(samples: Samples, repeats: IntArray) -> float | None:
    """Return by how much joints follow better from the times that the others give.

    Args:
        samples: Rows without repeats.
        repeats: Shape (rows - 1,). How many repeated rows were left out in each interval.

    Returns:
        Mean logarithm of the error by the stamps over the error by the others' times. None if fewer
        than two joints tell the time. 0 if the gain is not distinct: less than two standard errors
        or 5 %, or less in half of the seconds in motion, or more than a quarter of the joints get
        worse.
    """
    begin = max(0, (len(samples) - JUDGED_ROWS) // 2)
    samples = samples.part(slice(begin, begin + JUDGED_ROWS))
    repeats = repeats[begin : begin + len(samples) - 1]
    joints = samples.moving()
    if len(joints) < 2:
        return None
    blocks = max(FEWEST_BLOCKS, len(samples) // BLOCK_ROWS)
    parts = np.array_split(np.arange(len(samples) - 1), blocks)
    gains = []
    for joint in joints:
        others = tuple(other for other in joints if other != joint)
        times = estimate_times(samples, repeats, others, ROUNDS)
        if times is None:
            continue
        floor = smallest_step(samples.position[:, joint]) ** 2 / 6.0 + 1e-18
        by_stamps = _squares(misfit(samples, samples.time_s, joint), parts) + floor
        by_others = _squares(misfit(samples, times.time_s, joint), parts) + floor
        gains.append(0.5 * np.log(by_stamps / by_others))
    if not gains:
        return None
    moved = [np.abs(np.diff(samples.position[part], axis=0)).sum(axis=0).max() for part in parts]
    spans_s = [samples.time_s[part[-1]] - samples.time_s[part[0]] for part in parts]
    in_motion = np.array(moved) > STANDSTILL_SPEED * np.array(spans_s)
    if np.count_nonzero(in_motion) < 2:
        return None
    of_blocks = np.mean(gains, axis=0)[in_motion]
    gain = float(of_blocks.mean())
    worse = sum(float(own.mean()) < WORSE for own in gains)
    error = float(of_blocks.std(ddof=1)) / math.sqrt(len(of_blocks))
    distinct = gain > max(2.0 * error, LEAST_GAIN) and worse <= len(joints) / 4.0
    distinct &= float(np.median(of_blocks)) > LEAST_GAIN  # a clock is not wrong in one place
    return gain if distinct else 0.0


def _squares(values: FloatArray, parts: list[IntArray]) -> FloatArray:
    return np.array([float(np.mean(values[part] ** 2)) for part in parts])
