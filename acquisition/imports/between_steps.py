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
from config.arrays import FloatArray
from dynamics.kernels.taut_string import pull_taut

MOST_STEPS: Final = 100
"""Larger changes of a position say nothing of its step: their rounding adds up."""
OFF_THE_GRID: Final = 0.1
"""By what part of a step changes may miss whole steps: digits that were rounded away."""


def position_steps(rows: ImportRows) -> tuple[float | None, ...]:
    """Return the step of each joint's position [rad or m]; None where it has none.

    Parameters
    ----------
    rows : ImportRows
        The recording.
    """
    return tuple(_step(position) for position in rows.position.T)


def _step(position: FloatArray) -> float | None:
    changes = np.abs(np.diff(position))
    changes = changes[changes > 0.0]
    if not len(changes):
        return None
    smallest = float(changes.min())
    steps = changes[changes < MOST_STEPS * smallest] / smallest
    off = np.abs(steps - np.round(steps)).max()
    return smallest if off < OFF_THE_GRID else None


def between_steps(rows: ImportRows, steps: tuple[float | None, ...]) -> FloatArray:
    """Return positions that follow the recorded velocity between their steps, (rows, joints).

    None is further than a step from what was recorded. Positions without steps, and those of
    joints without velocity, are as they were recorded.

    Parameters
    ----------
    rows : ImportRows
        The recording.
    steps : tuple of float or None
        `position_steps` of it.
    """
    position = rows.position.copy()
    spans = np.diff(rows.time_s)
    for j, step in enumerate(steps):
        velocity = rows.velocity[:, j]
        if step is None or np.isnan(velocity).any():
            continue
        means = (velocity[1:] + velocity[:-1]) / 2.0
        moved = np.concatenate([[0.0], np.cumsum(means * spans)])
        drift = rows.position[:, j] - moved
        path = np.empty_like(drift)
        pull_taut(rows.time_s, drift - step, drift + step, path)
        position[:, j] = moved + path
    return position
