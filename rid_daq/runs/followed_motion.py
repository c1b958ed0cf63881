"""Path errors of a run relative to its motion, with and without compensation."""

from __future__ import annotations

import numpy as np

from acquisition.motion.samples import Phase
from compensation.feedforward.deflection import (
    Deflection,
    deflection,
    transmitted_torques,
)
from compensation.feedforward.tracking_error import TrackingError, tracking_error
from config.arrays import BoolArray
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from identification.estimation.estimate import Estimate
from rid_daq.report.sections.tracking import FollowedMotion, FollowedRun
from rid_daq.runs.motion_runs import MotionRun
from rid_daq.runs.run_data import RunData


def compare_with_motion(
    after: MotionRun,
    before: MotionRun | None,
    robot: RobotDescription,
    estimate: Estimate | None = None,
) -> FollowedMotion:
    """Compare measured with commanded positions, in one or two runs of a motion.

    Args:
        after: The run, usually with compensation.
        before: A run of the same motion to compare with; None without one.
        robot: Robot with the stiffness of its gears.
        estimate: Model from which the transmitted torques of the gears are computed; None to use
            the measured motor torques instead.

    Raises:
        DataQualityError: A run has no commanded positions.
    """
    step_s = after.cell.cycle_time_s

    def run_of(run: MotionRun) -> FollowedRun:
        data = run.data
        return FollowedRun(
            path_error_of_run(data),
            _last_period(data),
            step_s,
            deflection_of_run(data, robot, estimate),
        )

    return FollowedMotion.of(
        after.motion.describe(),
        after.use,
        run_of(after),
        None if before is None else run_of(before),
    )


def path_error_of_run(data: RunData) -> TrackingError:
    """Return the path errors of a run's main part.

    Raises:
        DataQualityError: The run has no main part or no commanded positions.
    """
    recording, main = data.recording, _main_rows(data)
    if recording.target_position is None or not main.any():
        raise DataQualityError(
            f"run {data.folder.run_id} contains no commanded positions: use a run that rid-daq"
            " has recorded",
            code="RID-RUN-FOREIGN",
        )
    chain = Chain.from_description(data.robot)
    return tracking_error(chain, recording.target_position[main], recording.position[main])


def deflection_of_run(
    data: RunData, robot: RobotDescription, estimate: Estimate | None = None
) -> Deflection | None:
    """Return the estimated deflection of the gears in a run's main part; None if unknown."""
    recording, main = data.recording, _main_rows(data)
    if estimate is None:
        return deflection(robot, recording.position[main], recording.torque_nm[main])
    return deflection(robot, *transmitted_torques(estimate, recording))


def _main_rows(data: RunData) -> BoolArray:
    """Return a mask of the rows of the motion's main part with a valid answer of every drive."""
    recording = data.recording
    return np.asarray((recording.phase == Phase.MAIN) & recording.valid)


def _last_period(data: RunData) -> slice:
    rows = data.recording.samples_per_period
    return slice(None) if rows is None else slice(-rows, None)
