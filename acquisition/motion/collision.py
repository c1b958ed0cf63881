"""Collision check of paths before the motion: self-collisions and surroundings."""

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
    """Raise an error if two bodies overlap at the start, or come too close on a path.

    Bodies that are closer than the clearance at the start of the path must not come more than 1 mm
    closer. Therefore a robot that is too near an obstacle can be moved away.

    Args:
        clearances: Pairs of bodies and their minimum clearance.
        position: Shape (samples, n). Joint positions of the path [rad or m].
        sample_period_s: Time between rows [s].
        what: Name of the path in the message.
        meanwhile: Function that is called before each 20 rows of the check.

    Raises:
        PreflightError: Two bodies overlap at the start or come too close; the text names them and
            the distance.
    """
    if len(clearances) == 0:
        return
    at_start = clearances.nearest(position[:1])
    if (at_start < 0.0).any():
        pair = int(np.argmin(at_start))
        raise PreflightError(
            f"at the start of {what}, {clearances.names[pair]} overlap by"
            f" {-1e3 * at_start[pair]:.0f} mm: move the robot away by hand, or correct `bodies`"
            " in the robot file and `workspace` in the cell file",
            code="RID-MOTION-COLLISION",
        )
    row = rows_before_collision(clearances, position, meanwhile)
    if row == len(position):
        return
    distance = clearances.nearest(position[row : row + 1])
    pair = int(np.argmin(distance - _permitted_distances(clearances, at_start)))
    raise PreflightError(
        f"{what} brings {clearances.names[pair]} within {1e3 * distance[pair]:.0f} mm of each"
        f" other after {row * sample_period_s:.2f} s; the clearance in `workspace` of the cell"
        f" file is {1e3 * clearances.margin_m:.0f} mm. Nothing was moved: design another motion,"
        " or start from another pose",
        code="RID-MOTION-COLLISION",
    )


def rows_before_collision(
    clearances: Clearances,
    position: FloatArray,
    meanwhile: Callable[[], None] = lambda: None,
    tolerance_m: float = TOLERANCE_M,
) -> int:
    """Return the number of rows before the first collision; all rows if the path is clear.

    Bodies that are closer than the clearance at the start of the path must not come more than
    `tolerance_m` closer.

    Args:
        clearances: Pairs of bodies and their minimum clearance.
        position: Shape (samples, n). Joint positions of the path [rad or m].
        meanwhile: Function that is called before each 20 rows of the check.
        tolerance_m: Distance by which bodies that are too close at the start may come closer [m].
    """
    least = _permitted_distances(clearances, clearances.nearest(position[:1]), tolerance_m)
    return rows_before_closer(clearances, position, least, meanwhile)


def rows_before_closer(
    clearances: Clearances,
    position: FloatArray,
    least: FloatArray | float,
    meanwhile: Callable[[], None] = lambda: None,
) -> int:
    """Return the number of rows before the first with a distance below `least`; all if none is.

    Args:
        clearances: Pairs of bodies.
        position: Shape (samples, n). Joint positions [rad or m].
        least: Smallest permitted distance, of each pair or of all [m].
        meanwhile: Function that is called before each 20 rows of the check.
    """
    if len(clearances) == 0:
        return len(position)
    for first in range(0, len(position), ROWS_AT_ONCE):
        meanwhile()
        rows = position[first : first + ROWS_AT_ONCE]
        if (clearances.nearest(rows) >= least).all():
            continue
        for row, pose in enumerate(rows, start=first):
            if (clearances.nearest(pose[np.newaxis]) < least).any():
                return row
    return len(position)


def _permitted_distances(
    clearances: Clearances, at_start: FloatArray, tolerance_m: float = TOLERANCE_M
) -> FloatArray:
    """Return each pair's smallest permitted distance, from its distance at the path's start."""
    return np.minimum(clearances.margin_m, at_start - tolerance_m)
