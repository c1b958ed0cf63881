"""Positions between the quantisation steps of a recorded position.

Positions are often recorded in steps: increments of an encoder, or the last digit of a file. At
rest and at reversals a joint moves by less than a step, and its friction changes with such small
displacements. If a velocity was recorded too, its integral shows how the joint moved. This integral
drifts slowly from the position. The drift that is subtracted has the smallest total variation for
which the result stays within one step of the recorded position.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from acquisition.imports.columns import ImportRows
from acquisition.processing.smoothing import GAP_STEPS
from config.arrays import FloatArray
from config.column_file import ColumnFile, each_column

MOST_STEPS: Final = 100
"""Largest change of a position from which the step size is computed [steps]; rounding errors add up
in larger changes."""
OFF_THE_GRID: Final = 0.1
"""Permitted deviation of a position change from a multiple of the quantisation step [steps]. The
changes deviate because the file's last digit is rounded."""
FEWEST_STEPS: Final = 10
"""Smallest number of position changes; fewer changes can be multiples of one step by chance."""


def position_steps(rows: ImportRows) -> tuple[float | None, ...]:
    """Return the quantisation step of each joint's position [rad or m]; None if none is visible.

    Args:
        rows: The recording.
    """
    return tuple(_quantisation_step(position) for position in each_column(rows.position))


def _quantisation_step(position: FloatArray) -> float | None:
    changes = np.diff(position)
    sizes = np.abs(changes[changes != 0.0])
    if not len(sizes):
        return None
    step = float(sizes.min())
    # include larger and larger changes, which give a more accurate step
    for most in (2.5, 10.5, 30.5, MOST_STEPS):
        few = sizes[sizes < most * step]
        count = np.round(few / step)
        step = float(count @ few / (count @ count))
    off = float(np.abs(few / step - count).max())
    if off > OFF_THE_GRID or len(few) < FEWEST_STEPS:
        return None
    goes_on = np.count_nonzero(changes[1:] * changes[:-1] > 0.0)
    steady = sizes.max() < 1.5 * step and 2 * goes_on > len(sizes)
    # at constant speed all changes are alike, so they prove no encoder step
    return None if steady else step


def unrefined_steps(
    steps: Sequence[float | None], has_velocity: Sequence[bool], coupling: FloatArray | None
) -> tuple[float | None, ...]:
    """Return the steps that remain in the joints' positions [rad or m]; None without steps.

    Args:
        steps: Result of `position_steps`.
        has_velocity: For each column of positions, True if a velocity refines it.
        coupling: Shape (n, n). Coupling matrix of positions at the actuators; None without it.
    """
    pairs = zip(steps, has_velocity, strict=True)
    left = np.array([0.0 if fine or step is None else step for step, fine in pairs])
    if coupling is not None:
        left = np.sqrt(np.square(coupling) @ np.square(left))
    return tuple(step or None for step in left.tolist())


def refine_between_steps(rows: ImportRows, steps: tuple[float | None, ...]) -> FloatArray:
    """Return positions that follow the recorded velocity between the steps, (rows, joints).

    No result differs by more than a step from the recorded position. Positions without steps, and
    those of joints without velocity, are returned unchanged. The motion in a gap is unknown: each
    stretch between gaps is processed separately.

    Args:
        rows: The recording.
        steps: Result of `position_steps` for these rows.
    """
    spans = np.diff(rows.time_s)
    cuts = np.flatnonzero(spans > GAP_STEPS * np.median(spans)) + 1
    edges = [0, *cuts.tolist(), len(rows.time_s)]

    def refine(column: FloatArray, velocity: FloatArray, step: float | None) -> FloatArray:
        if step is None or np.isnan(velocity).any():
            return column
        refined = column.copy()
        for own in map(slice, edges, edges[1:]):
            if own.stop - own.start > 1:
                refined[own] = _refine_stretch(rows.time_s[own], column[own], velocity[own], step)
        return refined

    columns = map(refine, each_column(rows.position), each_column(rows.velocity), steps)
    return ColumnFile.of_columns(columns, len(steps), len(rows.time_s))


def _refine_stretch(
    time_s: FloatArray, recorded: FloatArray, velocity: FloatArray, step: float
) -> FloatArray:
    """Return the positions of one joint in a stretch without gaps."""
    from dynamics.kernels.taut_string import pull_taut  # loads the compiler

    means = (velocity[1:] + velocity[:-1]) / 2.0
    moved = np.concatenate([[0.0], np.cumsum(means * np.diff(time_s))])
    drift = recorded - moved
    path = np.empty_like(drift)
    pull_taut(time_s, drift - step, drift + step, path)
    return np.asarray(moved + path)
