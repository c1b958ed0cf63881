"""`Alignment`: clock and frame of an instrument relative to a run."""

from __future__ import annotations

from dataclasses import dataclass
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
        DataQualityError: The point hardly moves, the clock jumps, the two paths do not overlap in
            time, or they are not the same path.
    """
    path = CubicSpline(time_s, path_m)
    found = [
        _refined(tracked, path, offset_s)
        for offset_s in clock_offsets(tracked.time_s, tracked.point_m, time_s, path_m)
    ]
    fits = [each for each in found if each is not None]
    best = min(fits, key=lambda each: each.residual_m, default=None)
    if best is None or best.residual_m > LARGEST_RESIDUAL_M:
        words = "" if best is None else f" (residual {1e3 * best.residual_m:.3g} mm RMS)"
        raise DataQualityError(
            f"the measured path does not fit the run{words}: check that file, run and measured"
            " point belong together",
            code=CODE,
        )
    return best


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
