"""Paths are measured before they are driven: the robot stays off itself and its surroundings."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from config.arrays import FloatArray
from config.errors import PreflightError
from dynamics.geometry.clearances import Clearances

ROWS_AT_ONCE = 20
TOLERANCE_M = 1e-3


def refuse_collision(
    clearances: Clearances,
    position: FloatArray,
    sample_period_s: float,
    what: str,
    meanwhile: Callable[[], None] = lambda: None,
) -> None:
    """Refuse a path on which two bodies come closer than the clearance.

    Bodies that are closer already where the path begins may stay as close, but not come closer:
    a robot that stands too near can be led away.

    Args:
        clearances: What must stay apart.
        position: Shape (samples, n). The path's joint positions [rad or m].
        sample_period_s: Time between rows [s].
        what: What the path is called in the message.
        meanwhile: Called every few milliseconds.

    Raises:
        PreflightError: Two bodies come too close; the text names them, the distance and the time.
    """
    if len(clearances) == 0:
        return
    at_start = clearances.nearest(position[:1])
    if (at_start < 0.0).any():
        pair = int(np.argmin(at_start))
        raise PreflightError(
            f"where {what} begins, {clearances.names[pair]} overlap by"
            f" {-1e3 * at_start[pair]:.0f} mm: lead the robot out by hand, or correct `bodies` in"
            " the robot file and `workspace` in the cell file",
            code="RID-MOTION-COLLISION",
        )
    row = clear_rows(clearances, position, meanwhile)
    if row == len(position):
        return
    distance = clearances.nearest(position[row : row + 1])
    pair = int(np.argmin(distance - _least(clearances, at_start)))
    raise PreflightError(
        f"{what} brings {clearances.names[pair]} to {1e3 * distance[pair]:.0f} mm of"
        f" each other after {row * sample_period_s:.2f} s;"
        f" {1e3 * clearances.margin_m:.0f} mm is the least that `workspace` in the cell"
        " file allows. Nothing was moved: design another motion, or start elsewhere",
        code="RID-MOTION-COLLISION",
    )


def clear_rows(
    clearances: Clearances, position: FloatArray, meanwhile: Callable[[], None] = lambda: None
) -> int:
    """Return how many rows a path stays clear for: all of them, or those before the first.

    Bodies that are closer already where the path begins may stay as close, but not come closer.

    Args:
        clearances: What must stay apart.
        position: Shape (samples, n). The path's joint positions [rad or m].
        meanwhile: Called every few milliseconds.
    """
    if len(clearances) == 0:
        return len(position)
    least = _least(clearances, clearances.nearest(position[:1]))
    for first in range(0, len(position), ROWS_AT_ONCE):
        meanwhile()
        rows = position[first : first + ROWS_AT_ONCE]
        if (clearances.nearest(rows) >= least).all():
            continue
        for row, pose in enumerate(rows, start=first):
            if (clearances.nearest(pose[np.newaxis]) < least).any():
                return row
    return len(position)


def _least(clearances: Clearances, at_start: FloatArray) -> FloatArray:
    """Return how close each pair may come on a path, by how close it is where that begins."""
    return np.minimum(clearances.margin_m, at_start - TOLERANCE_M)
