"""Detection of rows and positions that repeat the previous row although the robot moves.

A logger that polls faster than its source reads the same value twice. At rest equal rows are
correct. A run of equal rows contradicts the motion of a joint if three conditions hold:
- The joint moves in the same direction before, across and after the run.
- It is not much slower across the run than before and after it.
- It moves by more than three of its smallest steps per row.

Then the joint's position cannot have been constant during the run.
"""

from __future__ import annotations

from itertools import chain
from typing import Final

import numpy as np

from acquisition.clock.samples import WIDE_S, Samples, smallest_step
from config.arrays import BoolArray, FloatArray, IntArray
from config.column_file import each_column

FEWEST_ROWS: Final = 100
MOST_STEPS: Final = 3.0
SHARE_OF_SPEED: Final = 0.3
MOST_AT_REST: Final = 2.0
"""Largest frequency of equal rows at rest, relative to the frequency of repeated rows in motion,
for which the equal rows at rest count as repeats.
"""
FEW: Final = 0.1
"""Largest number of equal rows at rest, relative to the number of repeated rows in motion, for
which the equal rows at rest always count as repeats.

So few equal rows are repeats at which a joint was slow or reversed.
"""


def repeated_rows(samples: Samples) -> BoolArray:
    """Return True for each row in which the logger read the previous values again, shape (rows,).

    Positions and torques of such a row equal those of the previous row. Velocities are ignored: a
    velocity computed from positions differs in such rows. A measured torque contains noise, so that
    it rarely repeats by chance. Equal rows at rest count as repeats if their runs are not longer
    than those in motion, and if they are at most twice as frequent as the repeats in motion, or at
    most a tenth as many. In fewer than 100 rows, no row counts as a repeat.
    """
    if len(samples) < FEWEST_ROWS:
        return np.zeros(len(samples), dtype=np.bool_)
    same = np.ones(len(samples) - 1, dtype=np.bool_)
    for column in chain(each_column(samples.position), each_column(samples.torque)):
        same &= column[1:] == column[:-1]
    repeated = np.zeros(len(samples), dtype=np.bool_)
    for joint in each_column(samples.position):
        repeated |= _contradicts_motion(joint, same, samples.period_s)
    if not repeated.any():
        return repeated
    stands = ~repeated
    stands[0] = False
    for joint in each_column(samples.position):
        stands[1:] &= joint[1:] == joint[:-1]
    equal = np.concatenate([[False], same]) & ~repeated
    firsts, lasts = _runs_of_equal_rows(~equal[1:])
    short = lasts - firsts < longest_run(repeated)
    short &= lasts > firsts
    at_rest = np.zeros_like(repeated)
    for first, last in zip(firsts[short], lasts[short], strict=True):
        at_rest[first + 1 : last + 1] = equal[first + 1 : last + 1]
    found = float(repeated.sum())
    as_often = MOST_AT_REST * found / max(float((~stands).sum()), 1.0) * float(stands.sum())
    if float(at_rest.sum()) <= max(as_often, FEW * found):
        repeated |= at_rest
    return repeated


def repeated_positions(samples: Samples) -> BoolArray:
    """Return True for each position that repeats the previous row, shape (rows, joints).

    Args:
        samples: Rows without repeats.
    """
    held = [
        _contradicts_motion(q, q[1:] == q[:-1], samples.period_s)
        for q in each_column(samples.position)
    ]
    return np.stack(held, axis=1)


def interpolate_repeats(time_s: FloatArray, position: FloatArray, held: BoolArray) -> FloatArray:
    """Return the positions, with repeated ones replaced by a spline through the other ones.

    Repeated positions at the end of the recording are not changed.
    """
    from scipy.interpolate import CubicSpline  # a slow import that few commands need

    filled = position.copy()
    for j in np.flatnonzero(held.any(axis=0)):
        fresh = ~held[:, j]
        spline = CubicSpline(time_s[fresh], position[fresh, j])
        inner = held[:, j] & (time_s <= time_s[fresh][-1])
        filled[inner, j] = spline(time_s[inner])
    return filled


def longest_run(repeated: BoolArray) -> int:
    """Return the number of rows in the longest run of equal rows, including its first row."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], repeated, [False]])))
    return int((edges[1::2] - edges[::2]).max(initial=0)) + 1


def _contradicts_motion(position: FloatArray, same: BoolArray, period_s: float) -> BoolArray:
    """Return True for each row that repeats a position although the joint was moving, (rows,)."""
    n = len(position)
    held = np.zeros(n, dtype=np.bool_)
    if not same.any():
        return held
    firsts, lasts = _runs_of_equal_rows(~same)
    runs = np.flatnonzero((lasts > firsts) & (lasts < n - 1))
    first, tail = firsts[runs], lasts[runs] + 1
    step = smallest_step(position)
    reach = np.maximum(tail - first, max(3, round(0.5 * WIDE_S / period_s)))
    start, stop = np.maximum(first - reach, 0), np.minimum(tail + reach, n - 1)
    across = (position[tail] - position[first]) / (tail - first)
    before = (position[first] - position[start]) / np.maximum(first - start, 1)
    after = (position[stop] - position[tail]) / np.maximum(stop - tail, 1)
    # At each end of the recording, a speed exists on one side only; use this speed for both sides.
    before, after = np.where(first == start, after, before), np.where(tail == stop, before, after)
    slower = np.minimum(np.abs(before), np.abs(after))
    found = (across * before > 0.0) & (across * after > 0.0)
    found &= np.minimum(np.abs(across), slower) > MOST_STEPS * step
    found &= np.abs(across) > SHARE_OF_SPEED * slower
    for a, b in zip(first[found], tail[found], strict=True):
        held[a + 1 : b] = True
    return held


def _runs_of_equal_rows(changed: BoolArray) -> tuple[IntArray, IntArray]:
    """Return the first and last row of each run of equal rows.

    `changed` is True for each row that differs from the previous one, from the second row on.
    """
    firsts = np.flatnonzero(np.concatenate([[True], changed]))
    return firsts, np.concatenate([firsts[1:], [len(changed) + 1]]) - 1
