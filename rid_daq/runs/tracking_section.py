"""The report's section on how closely paths were followed, before and after compensation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from acquisition.motion.samples import Phase
from compensation.feedforward.tracking_error import TrackingError, tracking_error
from config.arrays import FloatArray
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from rid_daq.report.sections import rounded, units
from rid_daq.runs.motion_runs import MotionRun
from rid_daq.runs.run_data import RunData

DRAWN_POINTS = 500


@dataclass(frozen=True)
class Followed:
    """One motion: how closely it was followed, and by which use of its own runs.

    Attributes
    ----------
    sentence : str
        What was driven.
    use : str
        Whether runs of this motion have made its feedforward.
    after, before : TrackingError
        With compensation and, where there is such a run, without.
    after_period, before_period : slice
        The rows to draw: the last period, or all.
    sample_period_s : float
        Time between rows [s].
    """

    sentence: str
    use: str
    after: TrackingError
    after_period: slice
    before: TrackingError | None
    before_period: slice
    sample_period_s: float

    @property
    def ratios(self) -> tuple[float, float] | None:
        """By how much mean and largest distance have shrunk."""
        if self.before is None:
            return None
        return (
            self.before.mean_m / max(self.after.mean_m, 1e-12),
            self.before.max_m / max(self.after.max_m, 1e-12),
        )


def followed(after: MotionRun, before: MotionRun | None) -> Followed:
    """Compare what was reached with what was wanted, in one run or two of a motion.

    Raises
    ------
    DataQualityError
        A run says nothing of where the robot should have been.
    """
    return Followed(
        sentence=after.motion.describe(),
        use=after.use,
        after=error_of(after.data),
        after_period=_period(after.data),
        before=None if before is None else error_of(before.data),
        before_period=slice(None) if before is None else _period(before.data),
        sample_period_s=after.cell.cycle_time_s,
    )


def error_of(data: RunData) -> TrackingError:
    """Return the errors of a run's main part.

    Raises
    ------
    DataQualityError
        It has none, or does not say where the robot should have been.
    """
    recording = data.recording
    main = (recording.phase == Phase.MAIN) & recording.valid
    if recording.target_position is None or not main.any():
        raise DataQualityError(
            f"run {data.folder.run_id} says nothing of where the robot should have been: a run of"
            " this program's own is needed"
        )
    chain = Chain.from_description(data.robot)
    return tracking_error(chain, recording.target_position[main], recording.position[main])


def tracking_section(all_followed: Sequence[Followed], robot: RobotDescription) -> dict[str, Any]:
    """Return the table of all motions, and what their figures draw."""
    return {
        "sentence": (
            "Distance between the tool point wanted and reached at the same instant, by the robot"
            " file's kinematics; joint errors are wanted minus reached."
        ),
        "joints": [{"joint": joint.name, "unit": units(joint)[0]} for joint in robot.joints],
        "motions": [_motion(one) for one in all_followed],
    }


def _motion(one: Followed) -> dict[str, Any]:
    ratios = one.ratios
    return {
        "sentence": one.sentence,
        "use": one.use,
        "after": _size(one.after),
        "before": None if one.before is None else _size(one.before),
        "mean_ratio": None if ratios is None else ratios[0],
        "max_ratio": None if ratios is None else ratios[1],
        "drawn": {
            "after": _curves(one.after, one.after_period, one.sample_period_s),
            "before": None
            if one.before is None
            else _curves(one.before, one.before_period, one.sample_period_s),
        },
    }


def _size(error: TrackingError) -> dict[str, Any]:
    return {
        "mean_m": error.mean_m,
        "max_m": error.max_m,
        "joint_peak": error.joint_peak.tolist(),
    }


def _curves(error: TrackingError, period: slice, step_s: float) -> dict[str, Any]:
    """Return the rows to draw, so many that a figure shows all there is to see."""
    wanted, reached = error.wanted_m[period], error.reached_m[period]
    every = max(1, len(wanted) // DRAWN_POINTS)
    kept = slice(None, None, every)

    def columns(values: FloatArray) -> list[list[float]]:
        return [rounded(column) for column in values.T]

    return {
        "time_s": rounded(step_s * np.arange(len(wanted), dtype=np.float64)[kept]),
        "wanted_m": columns(wanted[kept]),
        "deviation_m": columns((reached - wanted)[kept]),
        "distance_m": rounded(error.distance_m[period][kept]),
        "joint": columns(error.joint[period][kept]),
    }


def _period(data: RunData) -> slice:
    rows = data.recording.samples_per_period
    return slice(None) if rows is None else slice(-rows, None)
