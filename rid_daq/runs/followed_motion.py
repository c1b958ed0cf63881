"""Path errors of a run relative to its motion, with and without compensation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from acquisition.motion.samples import Phase
from compensation.feedforward.deflection import (
    Deflection,
    deflection,
    transmitted_torques,
)
from compensation.feedforward.file import FeedforwardFile
from compensation.feedforward.tracking_error import TrackingError, tracking_error
from compensation.ramped_load import RampedLoad
from config.arrays import BoolArray, FloatArray
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
    estimates: Mapping[str, Estimate | RampedLoad],
) -> FollowedMotion:
    """Compare measured with commanded positions, in one or two runs of a motion.

    Args:
        after: The run, usually with compensation.
        before: A run of the same motion to compare with; None without one.
        robot: Robot with the stiffness of its gears.
        estimates: Model of each run by its id, from which the transmitted torques of the gears are
            computed; for a run without model, the measured motor torques are used instead.

    Raises:
        DataQualityError: A run has no commanded positions.
    """
    step_s = after.cell.cycle_time_s

    def run_of(run: MotionRun) -> FollowedRun:
        data = run.data
        return FollowedRun(
            path_error_of_run(data, run.file),
            _last_period(data),
            step_s,
            deflection_of_run(data, robot, estimates.get(run.run_id), run.file),
        )

    return FollowedMotion.of(
        after.motion.describe(),
        after.use,
        run_of(after),
        None if before is None else run_of(before),
    )


def path_error_of_run(data: RunData, file: FeedforwardFile | None = None) -> TrackingError:
    """Return the path errors of a run's main part, by the encoders at the motors.

    If the motors were commanded ahead of the path by the deflection of the gears, this lead is
    subtracted from commanded and measured positions.

    Args:
        file: Feedforward of the run; None without one.

    Raises:
        DataQualityError: The run has no main part or no commanded positions.
    """
    wanted, lead = _wanted_positions(data, file)
    reached = data.recording.position[_main_rows(data)] - lead
    return tracking_error(Chain.from_description(data.robot), wanted, reached)


def deflection_of_run(
    data: RunData,
    robot: RobotDescription,
    estimate: Estimate | RampedLoad | None = None,
    file: FeedforwardFile | None = None,
) -> Deflection | None:
    """Return the estimated deflection of the gears in a run's main part; None if unknown."""
    recording, main = data.recording, _main_rows(data)
    wanted = _wanted_positions(data, file)[0]
    if estimate is None:
        return deflection(robot, recording.position[main], recording.torque_nm[main], wanted)
    time_s, position, torque_nm = transmitted_torques(estimate, robot, recording)
    columns = (np.interp(time_s, recording.time_s[main], column) for column in wanted.T)
    return deflection(robot, position, torque_nm, np.column_stack(list(columns)))


def _wanted_positions(data: RunData, file: FeedforwardFile | None) -> tuple[FloatArray, FloatArray]:
    """Return the desired positions of the links in the main part, and the motors' lead.

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
    lead = motor_lead(data, file)[main]
    return recording.target_position[main] - lead, lead


def motor_lead(data: RunData, file: FeedforwardFile | None) -> FloatArray:
    """Return the lead of the commanded motor positions over the path, (rows, n) [rad or m].

    Outside the motion, the value is that of the closest row of the motion.
    """
    index = data.recording.sample_index
    inside = np.flatnonzero(index >= 0)
    bent = None if file is None else file.bent_rows(len(file.feedforward))
    if bent is None or not inside.size:
        return np.zeros_like(data.recording.position)
    closest = np.round(np.interp(np.arange(len(index)), inside, np.arange(len(inside))))
    return np.asarray(bent[index[inside[closest.astype(int)]]])


def _main_rows(data: RunData) -> BoolArray:
    """Return a mask of the rows of the motion's main part with a valid answer of every drive."""
    recording = data.recording
    return np.asarray((recording.phase == Phase.MAIN) & recording.valid)


def _last_period(data: RunData) -> slice:
    rows = data.recording.samples_per_period
    return slice(None) if rows is None else slice(-rows, None)
