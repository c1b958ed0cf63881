"""`ToolSideError`: path errors of the tool that an external instrument measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from acquisition.tracker.alignment import Alignment, align
from acquisition.tracker.clock_offsets import CODE, is_covered
from acquisition.tracker.tracker_file import TrackedPoint
from config.arrays import FloatArray, freeze
from config.errors import DataQualityError
from dynamics.geometry.kinematics import Chain, forward

LEAST_SHARE: Final = 0.5
"""Smallest share of the main part that the instrument must have measured."""


@dataclass(frozen=True, eq=False)
class ToolSideError:
    """Measured minus desired point over the main part of a motion, in frame 0.

    Clock and frame of the instrument are fitted to the path that the motors' encoders measured.
    Therefore a delay along the path, and a shift or rotation of the whole path, are not visible.

    Attributes:
        time_s: Shape (rows,). Times of the run [s].
        deviation_m: Shape (rows, 3). Measured minus desired point.
        share: Share of the main part's rows of the run that the instrument measured.
        alignment: Clock and frame of the instrument.
    """

    time_s: FloatArray
    deviation_m: FloatArray
    share: float
    alignment: Alignment

    def __post_init__(self) -> None:
        freeze(self, DataQualityError, (None,), "time_s")
        freeze(self, DataQualityError, (len(self.time_s), 3), "deviation_m")

    @property
    def distance_m(self) -> FloatArray:
        """Distance between measured and desired point, (rows,)."""
        return np.asarray(np.linalg.norm(self.deviation_m, axis=1))

    @property
    def mean_m(self) -> float:
        """Mean distance."""
        return float(self.distance_m.mean())

    @property
    def max_m(self) -> float:
        """Largest distance."""
        return float(self.distance_m.max())


def tool_side_error(
    chain: Chain, recording: Recording, tracked: TrackedPoint, lead: FloatArray | None = None
) -> ToolSideError:
    """Return the path errors of a point that an instrument measured during a run.

    Rows of the instrument in gaps of the run are left out.

    Args:
        chain: The robot; its tool point is the measured point.
        recording: The run, with commanded positions.
        tracked: The measured point.
        lead: Shape (samples, n). Part of the commanded positions by which the motors were ahead of
            the path, so that elastic gears put the links on it [rad or m]; None for zero.

    Raises:
        DataQualityError: The run has no commanded positions, the measured path does not fit the
            run, or it contains less than `LEAST_SHARE` of the motion's main part.
    """
    valid = recording.valid
    main = valid & (recording.phase == Phase.MAIN)
    if recording.target_position is None or not main.any():
        raise DataQualityError(
            f"run {recording.run_id} contains no commanded positions, or no valid row of the main"
            " part: use a run that rid-daq has recorded",
            code="RID-RUN-FOREIGN",
        )
    ahead = np.zeros_like(recording.position) if lead is None else lead
    path = forward(chain, (recording.position - ahead)[valid])
    found = align(tracked, recording.time_s[valid], path)
    times = recording.time_s[main]
    at = found.run_time(tracked.time_s)
    rows, share = is_covered(at, times), float(is_covered(times, at).mean())
    if not rows.any() or share < LEAST_SHARE:
        raise DataQualityError(
            f"the tracker file contains {100.0 * share:.0f} % of the main part of run"
            f" {recording.run_id} (at least {100.0 * LEAST_SHARE:.0f} %): record the whole motion",
            code=CODE,
        )
    wanted = CubicSpline(times, (recording.target_position - ahead)[main])(at[rows])
    deviation = found.to_base(tracked.point_m[rows]) - forward(chain, wanted)
    return ToolSideError(at[rows], deviation, share, found)
