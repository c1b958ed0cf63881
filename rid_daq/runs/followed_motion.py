"""How closely a run followed its motion, with compensation and without."""

from __future__ import annotations

from acquisition.motion.samples import Phase
from compensation.feedforward.tracking_error import TrackingError, tracking_error
from config.errors import DataQualityError
from dynamics.geometry.kinematics import Chain
from rid_daq.report.sections.tracking import FollowedMotion, FollowedRun
from rid_daq.runs.motion_runs import MotionRun
from rid_daq.runs.run_data import RunData


def followed(after: MotionRun, before: MotionRun | None) -> FollowedMotion:
    """Compare what was reached with what was wanted, in one run or two of a motion.

    Parameters
    ----------
    after : MotionRun
        The run, with compensation.
    before : MotionRun or None
        The same motion without, where there is such a run.

    Raises
    ------
    DataQualityError
        A run says nothing of where the robot should have been.
    """
    step_s = after.cell.cycle_time_s
    return FollowedMotion.of(
        after.motion.describe(),
        after.use,
        FollowedRun(error_of(after.data), _period(after.data), step_s),
        None
        if before is None
        else FollowedRun(error_of(before.data), _period(before.data), step_s),
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


def _period(data: RunData) -> slice:
    rows = data.recording.samples_per_period
    return slice(None) if rows is None else slice(-rows, None)
