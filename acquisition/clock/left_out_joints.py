"""Test of rebuilt times on joints that were left out of the estimate."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from acquisition.clock.intervals import displacement_error, estimate_times
from acquisition.clock.samples import STANDSTILL_SPEED, Samples, smallest_step
from config.arrays import FloatArray, IntArray

JUDGED_ROWS: Final = 60_000
"""Largest number of rows that the test uses; of a longer recording, the rows in the middle."""
BLOCK_ROWS: Final = 200
FEWEST_BLOCKS: Final = 8
LEAST_GAIN: Final = 0.05
WORSE: Final = -0.02
ROUNDS: Final = 2


def left_out_gain(samples: Samples, repeats: IntArray) -> float | None:
    """Return the improvement of a joint's predicted displacements by times from the other joints.

    Each moving joint is left out once. The times are estimated from the other joints. The
    displacements of the joint are then predicted with these times and with the stamps.

    Args:
        samples: Rows without repeats.
        repeats: Shape (rows - 1,). Number of repeated rows that were dropped from each interval.

    Returns:
        Mean logarithm of a ratio: the prediction error with the stamps divided by the prediction
        error with the estimated times. None if fewer than two joints move, if they move too little,
        or if no set of other joints determines the times. 0 if the gain is not significant. A
        significant gain exceeds two standard errors and 5 %, exceeds 5 % in at least half of the
        blocks in motion, and worsens the prediction by more than 2 % in at most a quarter of the
        joints.
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
        by_stamps = _mean_squares(displacement_error(samples, samples.time_s, joint), parts) + floor
        by_others = _mean_squares(displacement_error(samples, times.time_s, joint), parts) + floor
        gains.append(0.5 * np.log(by_stamps / by_others))
    if not gains:
        return None
    moved = [np.abs(np.diff(samples.position[part], axis=0)).sum(axis=0).max() for part in parts]
    spans_s = [samples.time_s[part[-1]] - samples.time_s[part[0]] for part in parts]
    in_motion = np.array(moved) > STANDSTILL_SPEED * np.array(spans_s)
    if np.count_nonzero(in_motion) < 2:
        return None
    gain_of_block = np.mean(gains, axis=0)[in_motion]
    gain = float(gain_of_block.mean())
    worse = sum(float(own.mean()) < WORSE for own in gains)
    error = float(gain_of_block.std(ddof=1)) / math.sqrt(len(gain_of_block))
    distinct = gain > max(2.0 * error, LEAST_GAIN) and worse <= len(joints) / 4.0
    # a wrong clock makes most blocks worse
    distinct &= float(np.median(gain_of_block)) > LEAST_GAIN
    return gain if distinct else 0.0


def _mean_squares(values: FloatArray, parts: list[IntArray]) -> FloatArray:
    return np.array([float(np.mean(values[part] ** 2)) for part in parts])
