"""The torque that a motion takes by a model, held to the joints' limits before anything moves."""

from __future__ import annotations

import numpy as np

from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.samples import MotionSamples
from config.errors import LimitError
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate, predict


def refuse_torque(
    motion: AnyMotion, samples: MotionSamples, estimate: Estimate, robot: RobotDescription
) -> None:
    """Refuse a motion that takes more torque than a joint has.

    Parameters
    ----------
    motion : AnyMotion
        What its file says.
    samples : MotionSamples
        The motion as planned.
    estimate : Estimate
        The model that predicts its torque.
    robot : RobotDescription
        The limits.

    Raises
    ------
    LimitError
        It does; the text names joint, time and, of a path, the segment.
    """
    torque = np.abs(predict(estimate, samples.position, samples.velocity, samples.acceleration))
    for j, joint in enumerate(robot.joints):
        row = int(torque[:, j].argmax())
        if torque[row, j] <= joint.limits.torque:
            continue
        unit = "N m" if joint.type == "revolute" else "N"
        where = f"at {row * samples.sample_period_s:.4g} s"
        place = motion.where(robot, samples.sample_period_s, row)
        if place:
            where += f", {place},"
        raise LimitError(
            f"{where} the motion takes {torque[row, j]:.4g} {unit} of joint {joint.name!r} by the"
            f" model, its limit is {joint.limits.torque:g}: drive it more slowly"
        )
