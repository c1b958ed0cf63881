"""`design_model`: the model that is used for the design of a motion."""

from __future__ import annotations

from dataclasses import replace

from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from dynamics.model.transmission import Transmission


def design_model(robot: RobotDescription, sign_smoothing_rad_s: float = 0.0) -> RobotModel:
    """Return a robot's model without temperature-dependent friction and without gear losses."""
    joints = tuple(
        joint.model_copy(
            update={"friction": tuple(t for t in joint.friction if t != "temperature")}
        )
        for joint in robot.joints
    )
    model = RobotModel.from_description(
        robot.model_copy(update={"joints": joints}), sign_smoothing_rad_s=sign_smoothing_rad_s
    )
    return replace(model, transmission=Transmission())
