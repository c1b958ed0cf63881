"""`design_model`: the model that a motion is designed for."""

from __future__ import annotations

from dataclasses import replace

from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from dynamics.model.transmission import Transmission


def design_model(robot: RobotDescription, sign_smoothing_rad_s: float = 0.0) -> RobotModel:
    """Return the model whose columns count in a design: those that the motion has a say in.

    Friction's dependence on temperature and the gears' losses are left out.
    """
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
