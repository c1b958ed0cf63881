"""`Alignment`: clock and frame of an instrument relative to a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import correlate
from scipy.spatial.transform import Rotation

from acquisition.tracker.tracker_file import TrackedPoint
from config.arrays import BoolArray, FloatArray
from config.errors import DataQualityError

CODE: Final = "RID-TRACKER-ALIGNMENT"
LARGEST_RESIDUAL_M: Final = 0.03
"""Largest RMS distance between measured and computed path that counts as the same path."""
FEWEST_ROWS: Final = 20
FINEST_S: Final = 0.01
LEAST_OVERLAP: Final = 0.5
LEAST_SPEED: Final = 1e-3
"""Smallest RMS speed of a path that shows the clock [m/s]."""
LARGEST_GAP: Final = 2.5
"""Distance of neighbouring rows, in typical distances, above which the path between is unknown."""
LONGEST_SPAN: Final = 10.0
"""Largest time between first and last row of an instrument, over the time of its rows and the run;
with more, its clock has jumped."""
_PEAKS: Final = 4
_ITERATIONS: Final = 15
_APART_S: Final = 0.2


@dataclass(frozen=True, eq=False)
class Alignment:
    """Clock and frame of an instrument relative to a run.

    Attributes:
        offset_s: Time of the instrument minus time of the run, in the middle of the rows [s].
        rate: Rate of the instrument's clock relative to the run's, minus 1.
        middle_s: Time of the instrument to which `offset_s` refers [s].
        rotation: Shape (3, 3). Orientation of frame 0 in the instrument's frame.
        origin_m: Shape (3,). Origin of frame 0 in the instrument's frame.
        residual_m: RMS distance between measured and computed path.
    """

    offset_s: float
    rate: float
    middle_s: float
    rotation: FloatArray
    origin_m: FloatArray
    residual_m: float

    def run_time(self, time_s: FloatArray) -> FloatArray:
        """Return times of the run for times of the instrument [s]."""
        return time_s - self.offset_s - self.rate * (time_s - self.middle_s)

    def to_base(self, point_m: FloatArray) -> FloatArray:
        """Return points in frame 0 for points of the instrument, (rows, 3) [m]."""
        return np.asarray((point_m - self.origin_m) @ self.rotation)


def is_covered(at_s: FloatArray, time_s: FloatArray) -> BoolArray:
    """Return which times lie between rows, and not in a gap of the rows, shape of `at_s`.

    Args:
        at_s: The times to judge [s].
        time_s: Shape (rows,). Times of the rows, increasing; at least two.
    """
    steps = np.diff(time_s)
    after = np.clip(np.searchsorted(time_s, at_s), 1, len(steps))
    inside = (at_s >= time_s[0]) & (at_s <= time_s[-1])
    short = steps[after - 1] <= LARGEST_GAP * np.median(steps)
    return np.asarray(inside & short)


def align(tracked: TrackedPoint, time_s: FloatArray, path_m: FloatArray) -> Alignment:
    """Find the clock and the frame with which a measured path fits that of a run.

    The clock offset comes from the correlation of the speeds, which do not depend on the frame.
    Offset, rate and frame are then fitted by least squares to the rows that are not in a gap of the
    run.

    Args:
        tracked: The measured path.
        time_s: Shape (samples,). Times of the run, increasing.
        path_m: Shape (samples, 3). The same point by the encoders, in frame 0.

    Raises:
        DataQualityError: The point hardly moves, the clock jumps, the two paths do not overlap in
            time, or they are not the same path.
    """
    path = CubicSpline(time_s, path_m)
    found = [
        _refined(tracked, path, offset_s) for offset_s in _coarse_offsets(tracked, time_s, path_m)
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


def _coarse_offsets(tracked: TrackedPoint, time_s: FloatArray, path_m: FloatArray) -> list[float]:
    """Return the offsets at which the speeds of both paths correlate best, best first."""
    _refuse_jump(tracked, float(np.ptp(time_s)))
    step = max(FINEST_S, 1.5 / tracked.rate_hz)
    here = np.arange(time_s[0], time_s[-1], step)
    there = np.arange(tracked.time_s[0], tracked.time_s[-1], step)
    if min(len(here), len(there)) < FEWEST_ROWS:
        raise DataQualityError(
            f"the measured path has {len(tracked.time_s)} rows in"
            f" {np.ptp(tracked.time_s):.3g} s, too few to find its clock: record the whole motion",
            code=CODE,
        )
    speeds = []
    for at, times, points in ((here, time_s, path_m), (there, tracked.time_s, tracked.point_m)):
        seen = np.column_stack([np.interp(at, times, column) for column in points.T])
        speeds.append(np.linalg.norm(np.diff(seen, axis=0), axis=1) / step)
    if min(float(np.sqrt(np.mean(speed**2))) for speed in speeds) < LEAST_SPEED:
        raise DataQualityError(
            "the measured point hardly moves, so its clock cannot be found: record a motion of the"
            " measured point",
            code=CODE,
        )
    run, instrument = speeds
    product = correlate(instrument, run, method="fft")
    energies = [
        correlate(instrument**2, np.ones(len(run)), method="fft"),
        correlate(np.ones(len(instrument)), run**2, method="fft"),
    ]
    overlap = correlate(np.ones(len(instrument)), np.ones(len(run)), method="fft")
    score = product / np.sqrt(np.maximum(energies[0] * energies[1], 1e-12))
    score[overlap < LEAST_OVERLAP * min(len(run), len(instrument))] = -np.inf
    offsets = []
    for _ in range(_PEAKS):
        peak = int(np.argmax(score))
        if not np.isfinite(score[peak]):
            break
        lag = peak - (len(run) - 1)
        offsets.append(float(there[0] - here[0] + lag * step))
        near = round(_APART_S / step)
        score[max(0, peak - near) : peak + near + 1] = -np.inf
    return offsets


def _refuse_jump(tracked: TrackedPoint, run_s: float) -> None:
    """Refuse time stamps that span far more time than the rows and the run.

    Raises:
        DataQualityError: The clock of the instrument jumps.
    """
    span_s = float(np.ptp(tracked.time_s))
    if span_s <= LONGEST_SPAN * (len(tracked.time_s) / tracked.rate_hz + run_s):
        return
    row = int(np.argmax(np.diff(tracked.time_s)))
    raise DataQualityError(
        f"the time stamps jump from {tracked.time_s[row]:.9g} s to {tracked.time_s[row + 1]:.9g} s:"
        " remove the rows that do not belong to the run, or mark them by 0 in a column `valid`",
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
