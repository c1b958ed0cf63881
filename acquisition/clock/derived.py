"""Velocities that were computed from positions and stamps: they say nothing of the clock."""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.clock.samples import STANDSTILL_SPEED, Samples
from config.arrays import BoolArray, FloatArray

UNEVEN: Final = 0.01
LAGS: Final = 4
SHARE_EXPLAINED: Final = 0.25
SHARE_DIFFERENT: Final = 0.5
FEWEST_ROWS: Final = 100


def differs_in_repeats(samples: Samples, repeated: BoolArray) -> bool:
    """Return whether velocities change in most rows that repeat position and torque.

    A source that repeats its values repeats its velocity with them; a difference of positions
    becomes zero there.
    """
    rows = np.flatnonzero(repeated)
    told = np.isfinite(samples.velocity).all(axis=0)
    if not len(rows) or not told.any():
        return False
    velocity = samples.velocity[:, told]
    changed = np.any(velocity[rows] != velocity[rows - 1], axis=1)
    return bool(np.mean(changed) > SHARE_DIFFERENT)


def follows_stamps(samples: Samples) -> bool:
    """Return whether the velocities' fast changes are explained by those of the stamps' steps.

    A way divided by a step that is too short is too fast. A measured velocity knows nothing of the
    steps. Regressed over a few steps on both sides, any difference formula is found, filtered or
    not.
    """
    steps = np.diff(samples.time_s)
    if len(steps) < FEWEST_ROWS or float(np.std(steps)) < UNEVEN * float(np.mean(steps)):
        return False
    short = _fast(np.minimum(steps / np.median(steps), 3.0))
    inner = np.arange(LAGS, len(short) - LAGS)
    by = np.column_stack([short[inner + lag] for lag in range(-LAGS, LAGS)])
    for joint in samples.moving():
        velocity = samples.velocity[:, joint]
        level = np.abs(velocity[inner + 1])
        rows = level > max(STANDSTILL_SPEED, 0.2 * float(np.abs(velocity).max()))
        if np.count_nonzero(rows) < FEWEST_ROWS:
            continue
        change = _fast(velocity)[inner][rows] / velocity[inner + 1][rows]
        change = np.clip(change, -1.0, 1.0)
        left = change - by[rows] @ np.linalg.lstsq(by[rows], change, rcond=None)[0]
        if float(left @ left) < (1.0 - SHARE_EXPLAINED) * float(change @ change):
            return True
    return False


def _fast(values: FloatArray) -> FloatArray:
    """Return by how much values differ from the mean of their neighbours; two fewer."""
    return np.asarray(values[1:-1] - (values[2:] + values[:-2]) / 2.0)
