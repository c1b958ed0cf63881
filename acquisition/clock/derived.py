"""Detection of velocities that were computed from positions and time stamps.

Such velocities contain no information about the clock.
"""

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


def velocity_changes_in_repeats(samples: Samples, repeated: BoolArray) -> bool:
    """Return True if velocities change in most rows that repeat position and torque.

    A source that repeats its values also repeats its measured velocity. A velocity that is a
    difference of positions becomes zero in a repeated row.
    """
    rows = np.flatnonzero(repeated)
    measured = np.isfinite(samples.velocity).all(axis=0)
    if not len(rows) or not measured.any():
        return False
    velocity = samples.velocity[:, measured]
    changed = np.any(velocity[rows] != velocity[rows - 1], axis=1)
    return bool(np.mean(changed) > SHARE_DIFFERENT)


def velocity_depends_on_stamps(samples: Samples) -> bool:
    """Return True if the steps of the time stamps explain the fast changes of the velocities.

    A displacement divided by a step that is too short gives a velocity that is too high. A measured
    velocity does not depend on the steps. The regression includes four steps before and four after
    each row, so that it also detects filtered differences. If the stamps are almost even, or the
    rows are few, the result is False.
    """
    steps = np.diff(samples.time_s)
    if len(steps) < FEWEST_ROWS or float(np.std(steps)) < UNEVEN * float(np.mean(steps)):
        return False
    short = _high_pass(np.minimum(steps / np.median(steps), 3.0))
    inner = np.arange(LAGS, len(short) - LAGS)
    by = np.column_stack([short[inner + lag] for lag in range(-LAGS, LAGS)])
    for joint in samples.moving():
        velocity = samples.velocity[:, joint]
        level = np.abs(velocity[inner + 1])
        rows = level > max(STANDSTILL_SPEED, 0.2 * float(np.abs(velocity).max()))
        if np.count_nonzero(rows) < FEWEST_ROWS:
            continue
        change = _high_pass(velocity)[inner][rows] / velocity[inner + 1][rows]
        change = np.clip(change, -1.0, 1.0)
        left = change - by[rows] @ np.linalg.lstsq(by[rows], change, rcond=None)[0]
        if float(left @ left) < (1.0 - SHARE_EXPLAINED) * float(change @ change):
            return True
    return False


def _high_pass(values: FloatArray) -> FloatArray:
    """Return each inner value minus the mean of its two neighbours, shape (rows - 2,)."""
    return np.asarray(values[1:-1] - (values[2:] + values[:-2]) / 2.0)
