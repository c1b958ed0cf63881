"""Where a joint was between the steps that its position was recorded in.

Positions are often recorded in steps: increments of an encoder, or the digits of a file. A joint at
rest or turning round moves by less, and its friction changes with that. Where a velocity was
recorded beside, its integral says how the joint moved. What is left between both drifts slowly: of
all drifts that leave the position within a step of what was recorded it is the one that goes back
and forth least.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.imports.columns import ImportRows
from acquisition.processing.smoothing import GAP_STEPS
from config.arrays import FloatArray
from dynamics.kernels.taut_string import pull_taut

MOST_STEPS: Final = 100
"""Larger changes of a position say nothing of its step: their rounding adds up."""
OFF_THE_GRID: Final = 0.1
"""By what part of a step changes may miss whole steps: digits that were rounded away."""
FEWEST_STEPS: Final = 10
"""Fewer changes by some steps may be whole multiples of each other by luck."""


def position_steps(rows: ImportRows) -> tuple[float | None, ...]:
    """Return the step of each joint's position [rad or m]; None where it has none.

    Args:
        rows: The recording.
    """
    return tuple(_step(position) for position in rows.position.T)


def _step(position: FloatArray) -> float | None:
    changes = np.diff(position)
    sizes = np.abs(changes[changes != 0.0])
    if not len(sizes):
        return None
    step = float(sizes.min())
    for most in (2.5, 10.5, 30.5, MOST_STEPS):  # the more steps, the better their size is told
        few = sizes[sizes < most * step]
        count = np.round(few / step)
        step = float(count @ few / (count @ count))
    off = float(np.abs(few / step - count).max())
    if off > OFF_THE_GRID or len(few) < FEWEST_STEPS:
        return None
    goes_on = np.count_nonzero(changes[1:] * changes[:-1] > 0.0)
    steady = sizes.max() < 1.5 * step and 2 * goes_on > len(sizes)
    return None if steady else step  # a steady speed moves by one size, too


def between_steps(rows: ImportRows, steps: tuple[float | None, ...]) -> FloatArray:
    """Return positions that follow the recorded velocity between their steps, (rows, joints).

    None is further than a step from what was recorded. Positions without steps, and those of
    joints without velocity, are as they were recorded. What a joint did in a gap is not known: each
    stretch between gaps is followed by itself.

    Args:
        rows: The recording.
        steps: `position_steps` of it.
    """
    position = rows.position.copy()
    spans = np.diff(rows.time_s)
    cuts = np.flatnonzero(spans > GAP_STEPS * np.median(spans)) + 1
    for stretch in np.split(np.arange(len(rows.time_s)), cuts):
        for j, step in enumerate(steps):
            velocity = rows.velocity[stretch, j]
            if step is not None and len(stretch) > 1 and not np.isnan(rows.velocity[:, j]).any():
                recorded = rows.position[stretch, j]
                position[stretch, j] = _pulled(rows.time_s[stretch], recorded, velocity, step)
    return position


def _pulled(
    time_s: FloatArray, recorded: FloatArray, velocity: FloatArray, step: float
) -> FloatArray:
    """Return one joint's positions in a stretch without gaps."""
    means = (velocity[1:] + velocity[:-1]) / 2.0
    moved = np.concatenate([[0.0], np.cumsum(means * np.diff(time_s))])
    drift = recorded - moved
    path = np.empty_like(drift)
    pull_taut(time_s, drift - step, drift + step, path)
    return np.asarray(moved + path)
