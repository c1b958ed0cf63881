"""How closely a run followed its motion, with compensation and without."""

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


def followed(
    after: MotionRun,
    before: MotionRun | None,
    robot: RobotDescription,
    estimate: Estimate | None = None,
) -> FollowedMotion:
    """Compare what was reached with what was wanted, in one run or two of a motion.

    Args:
        after: The run, with compensation.
        before: The same motion without, where there is such a run.
        robot: The stiffness of its gears.
        estimate: Model of the torques that the gears transmit; without it the measured ones of the
            motors.

    Raises:
        DataQualityError: A run says nothing of where the robot should have been.
    """
    step_s = after.cell.cycle_time_s

    def run_of(run: MotionRun) -> FollowedRun:
        data = run.data
        return FollowedRun(
            error_of(data), _period(data), step_s, deflection_of(data, robot, estimate)
        )

    return FollowedMotion.of(
        after.motion.describe(),
        after.use,
        run_of(after),
        None if before is None else run_of(before),
    )


def error_of(data: RunData) -> TrackingError:
    """Return the errors of a run's main part.

    Raises:
        DataQualityError: It has none, or does not say where the robot should have been.
    """
    recording, main = data.recording, _main(data)
    if recording.target_position is None or not main.any():
        raise DataQualityError(
            f"run {data.folder.run_id} says nothing of where the robot should have been: a run of"
            " this program's own is needed",
            code="RID-RUN-FOREIGN",
        )
    chain = Chain.from_description(data.robot)
    return tracking_error(chain, recording.target_position[main], recording.position[main])


def deflection_of(
    data: RunData, robot: RobotDescription, estimate: Estimate | None = None
) -> Deflection | None:
    """Return the estimated bending of the gears in a run's main part; None if none is known."""
    recording, main = data.recording, _main(data)
    if estimate is None:
        return deflection(robot, recording.position[main], recording.torque_nm[main])
    return deflection(robot, *transmitted_torques(estimate, recording))


def _main(data: RunData) -> BoolArray:
    """Return the rows of the motion itself that every drive delivered."""
    recording = data.recording
    return np.asarray((recording.phase == Phase.MAIN) & recording.valid)


def _period(data: RunData) -> slice:
    rows = data.recording.samples_per_period
    return slice(None) if rows is None else slice(-rows, None)
