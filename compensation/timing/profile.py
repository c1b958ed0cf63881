"""`SpeedOverPath`: the highest speed along a path, computed by the scan of `reach_kernels`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from compensation.timing.path_rows import PathRows
from compensation.timing.reach_kernels import backwards, forwards, limit_curve_kernel
from config.arrays import FloatArray
from config.errors import LimitError

REPAIRS: Final = 60
SLOWER: Final = 0.9
STUCK: Final = 1e-10  # fraction of the largest x; with a smaller x, the path has stopped


@dataclass(frozen=True, eq=False)
class SpeedOverPath:
    """Speed along a path.

    Attributes:
        length: Shape (points,). Grid of the path length.
        x: Shape (points,). Squared speed.
        u: Shape (points - 1,). Acceleration along the path, constant between two points.
        time_s: Shape (points,). Time of each point.
    """

    length: FloatArray
    x: FloatArray
    u: FloatArray
    time_s: FloatArray


def fastest(
    rows: PathRows,
    bounds: FloatArray,
    *,
    most: FloatArray | None = None,
) -> SpeedOverPath:
    """Return the fastest motion along a path, from rest to rest.

    Args:
        rows: Limits along the path.
        bounds: Shape (points, rows, 3). `rows.bounds`, or tighter ones.
        most: Shape (points,). Largest x, if lower than the speed limits allow.

    Raises:
        LimitError: The limits allow no motion; the message names the place.
    """
    length = rows.dynamics.length
    cap = (rows.fastest if most is None else np.minimum(most, rows.fastest)).copy()
    points = len(length)
    largest, x, u = np.empty(points), np.empty(points), np.empty(points - 1)
    failed = -1
    for _ in range(REPAIRS):
        backwards(rows.rows, bounds, rows.friction, length, cap, 0.0, largest)
        failed = forwards(rows.rows, bounds, rows.friction, length, largest, 0.0, x, u)
        if failed < 0:
            break
        cap[failed] = SLOWER * min(cap[failed], x[failed])
    else:
        raise _infeasible_error(rows, bounds, failed)
    stuck = np.flatnonzero(x[1:-1] <= STUCK * x.max()) + 1
    if len(stuck):
        raise _infeasible_error(rows, bounds, int(stuck[0]))
    root = np.sqrt(x)
    time_s = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(length) / (root[1:] + root[:-1]))])
    return SpeedOverPath(length, x, u, time_s)


def limit_curve(rows: PathRows, bounds: FloatArray) -> FloatArray:
    """Return the largest squared speed at each point if the other points are ignored, (points,)."""
    found = np.empty(len(rows.dynamics.length))
    limit_curve_kernel(rows.rows, bounds, rows.friction, rows.fastest, found)
    return found


def _infeasible_error(rows: PathRows, bounds: FloatArray, point: int) -> LimitError:
    least, most = rows.at_rest()
    room = np.minimum(bounds[point, :, 1] - most[point], least[point] - bounds[point, :, 0])
    row = int(room.argmin())
    pose = ", ".join(f"{value:.4g}" for value in rows.dynamics.position[point])
    return LimitError(
        f"the path cannot continue at the pose ({pose}): only"
        f" {100.0 * max(float(room[row]), 0.0):.2g} % of the limit for the {rows.labels[row]} is"
        " left for motion, after gravity, friction and uncertainty. Move the path, raise the"
        " limit, or identify the robot better",
        code="RID-TIMING-NOT-FEASIBLE",
    )
