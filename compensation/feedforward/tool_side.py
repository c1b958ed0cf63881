"""`ToolSideError`: path errors of the tool that an external instrument measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from acquisition.tracker.alignment import Alignment, align
from acquisition.tracker.tracker_file import TrackedPoint
from config.arrays import FloatArray, freeze
from config.errors import DataQualityError
from dynamics.geometry.kinematics import Chain, forward


@dataclass(frozen=True, eq=False)
class ToolSideError:
    """Measured minus desired point over the main part of a motion, in frame 0.

    Clock and frame of the instrument are fitted to the path by the motors' encoders. Therefore a
    delay along the path, and a shift or rotation of the whole path, are not visible.

    Attributes:
        time_s: Shape (rows,). Times of the run [s].
        deviation_m: Shape (rows, 3). Measured minus desired point.
        alignment: Clock and frame of the instrument.
    """

    time_s: FloatArray
    deviation_m: FloatArray
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


def tool_side_error(chain: Chain, recording: Recording, tracked: TrackedPoint) -> ToolSideError:
    """Return the path errors of a point that an instrument measured during a run.

    Args:
        chain: The robot; its tool point is the measured point.
        recording: The run, with commanded positions.
        tracked: The measured point.

    Raises:
        DataQualityError: The run has no commanded positions, the measured path does not fit the
            run, or it does not contain the motion's main part.
    """
    valid = recording.valid
    main = valid & (recording.phase == Phase.MAIN)
    if recording.target_position is None or not main.any():
        raise DataQualityError(
            f"run {recording.run_id} contains no commanded positions: use a run that rid-daq has"
            " recorded",
            code="RID-RUN-FOREIGN",
        )
    path = forward(chain, recording.position[valid])
    found = align(tracked, recording.time_s[valid], path)
    times = recording.time_s[main]
    at = found.run_time(tracked.time_s)
    rows = (at >= times[0]) & (at <= times[-1])
    if not rows.any():
        raise DataQualityError(
            f"the tracker file contains no row of the main part of run {recording.run_id}: record"
            " the whole motion",
            code="RID-TRACKER-ALIGNMENT",
        )
    desired = forward(chain, CubicSpline(times, recording.target_position[main])(at[rows]))
    return ToolSideError(at[rows], found.to_base(tracked.point_m[rows]) - desired, found)
