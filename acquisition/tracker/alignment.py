"""`Alignment`: clock and frame of an instrument relative to a run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from acquisition.tracker.clock_offsets import (
    CODE,
    FEWEST_ROWS,
    InstrumentClock,
    clock_offsets,
    is_covered,
)
from acquisition.tracker.tracker_file import TrackedPoint
from config.arrays import FloatArray
from config.errors import DataQualityError

LARGEST_RESIDUAL_M: Final = 0.03
"""Largest RMS distance at which the measured and the computed path count as the same path."""
LARGEST_SHARE: Final = 0.3
"""Largest RMS distance of the two paths, relative to the RMS distance of the path from its centre.
Other motions, a point at rest and lengths in wrong units have 0.4 and more; gears that bend by 1 mm
on a path of 10 mm have 0.2."""
LARGEST_RATE: Final = 0.01
"""Largest difference of two clocks' rates; instruments have less than 0.0001."""
CLEARLY_BETTER: Final = 1.5
"""Ratio of residuals above which the mirrored path fits better; a plane path has 1."""
_ITERATIONS: Final = 15


@dataclass(frozen=True, eq=False)
class Alignment(InstrumentClock):
    """Clock and frame of an instrument relative to a run.

    Attributes:
        rotation: Shape (3, 3). Orientation of frame 0 in the instrument's frame.
        origin_m: Shape (3,). Origin of frame 0 in the instrument's frame.
        residual_m: RMS distance between measured and computed path.
    """

    rotation: FloatArray
    origin_m: FloatArray
    residual_m: float

    def to_base(self, point_m: FloatArray) -> FloatArray:
        """Return points in frame 0 for points of the instrument, (rows, 3) [m]."""
        return np.asarray((point_m - self.origin_m) @ self.rotation)


def align(tracked: TrackedPoint, time_s: FloatArray, path_m: FloatArray) -> Alignment:
    """Find the clock and the frame with which a measured path fits that of a run.

    The clock offset comes from the correlation of the speeds, which do not depend on the frame.
    Offset, rate and frame are then fitted by least squares to the rows that are not in a gap of the
    run.

    Args:
        tracked: The measured path.
        time_s: Shape (samples,). Times of the run, increasing.
        path_m: Shape (samples, 3). The same point in frame 0, computed from the
            encoders.

    Raises:
        DataQualityError: The point hardly moves, the clock jumps or has another rate, the two
            paths do not overlap in time, or they are not the same path.
    """
    path = CubicSpline(time_s, path_m)
    found = [
        _refined(tracked, path, offset_s)
        for offset_s in clock_offsets(tracked.time_s, tracked.point_m, time_s, path_m)
    ]
    fits = [each for each in found if each is not None]
    best = min(fits, key=lambda each: each.residual_m, default=None)
    size_m = 0.0 if best is None else _path_size_m(best.run_time(tracked.time_s), path)
    if best is None or best.residual_m > min(LARGEST_RESIDUAL_M, LARGEST_SHARE * size_m):
        words = ""
        if best is not None:
            sizes = f"{1e3 * best.residual_m:.3g} mm RMS on a path of {1e3 * size_m:.3g} mm RMS"
            words = f" (residual {sizes})"
        raise DataQualityError(
            f"the measured path does not fit the run{words}: check that file, run and measured"
            " point belong together, and the unit of the coordinates",
            code=CODE,
        )
    _refuse_other_rate(best)
    _refuse_mirrored(tracked, path, best)
    return best


def _path_size_m(at_s: FloatArray, path: CubicSpline) -> float:
    """Return the RMS distance of a path from its centre, at the times that the run contains."""
    points = path(at_s[is_covered(at_s, path.x)])
    return float(np.sqrt(np.sum(np.var(points, axis=0))))


def _refuse_other_rate(found: Alignment) -> None:
    """Refuse a clock that no instrument has.

    Raises:
        DataQualityError: The clock differs from that of the run by more than `LARGEST_RATE`.
    """
    if abs(found.rate) > LARGEST_RATE:
        raise DataQualityError(
            f"the measured path fits the run only if the time stamps count {1.0 + found.rate:.4g} s"
            " per second: check the unit of the time stamps, and that the file is of this run",
            code=CODE,
        )


def _refuse_mirrored(tracked: TrackedPoint, path: CubicSpline, found: Alignment) -> None:
    """Refuse coordinates of a left-handed frame.

    Raises:
        DataQualityError: The mirrored path fits the run better.
    """
    mirrored = replace(tracked, point_m=tracked.point_m * [-1.0, 1.0, 1.0])
    other = _refined(mirrored, path, found.offset_s)
    if other is not None and CLEARLY_BETTER * other.residual_m < found.residual_m:
        raise DataQualityError(
            f"the mirrored path fits the run better (residual {1e3 * other.residual_m:.3g} mm RMS"
            f" instead of {1e3 * found.residual_m:.3g} mm): the coordinates are those of a"
            " left-handed frame; exchange two columns, or change the sign of one",
            code=CODE,
        )


def _refined(tracked: TrackedPoint, path: CubicSpline, offset_s: float) -> Alignment | None:
    """Fit offset, rate and frame by Gauss-Newton steps; None if the paths do not overlap."""
    middle = float((tracked.time_s[0] + tracked.time_s[-1]) / 2.0)
    velocity = path.derivative()
    found = Alignment(offset_s, 0.0, middle, np.eye(3), np.zeros(3), np.inf)
    for number in range(_ITERATIONS):
        at = found.run_time(tracked.time_s)
        rows = is_covered(at, path.x)
        if rows.sum() < FEWEST_ROWS:
            return None
        here, measured = path(at[rows]), tracked.point_m[rows]
        if number == 0:
            centre, there = here.mean(axis=0), measured.mean(axis=0)
            turn, _ = Rotation.align_vectors(measured - there, here - centre)
            rotation, origin = turn.as_matrix(), there - turn.as_matrix() @ centre
        else:
            rotation, origin = found.rotation, found.origin_m
        turned = here @ rotation.T
        speed = velocity(at[rows]) @ rotation.T
        past = (tracked.time_s[rows] - middle)[:, np.newaxis]
        columns = np.stack(
            [
                -speed,
                -speed * past,
                *(np.cross(axis, turned) for axis in np.eye(3)),
                *(np.broadcast_to(axis, turned.shape) for axis in np.eye(3)),
            ],
            axis=2,
        ).reshape(-1, 8)
        residual = measured - turned - origin
        size = np.linalg.norm(columns, axis=0) + 1e-12
        step = np.linalg.lstsq(columns / size, residual.ravel(), rcond=1e-10)[0] / size
        found = Alignment(
            found.offset_s + float(step[0]),
            found.rate + float(step[1]),
            middle,
            Rotation.from_rotvec(step[2:5]).as_matrix() @ rotation,
            origin + step[5:],
            float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))),
        )
        if abs(step[0]) < 1e-9 and np.abs(step[2:]).max() < 1e-9:
            break
    return found
