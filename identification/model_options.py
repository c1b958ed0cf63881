"""`ModelOptions`: which terms an estimate's model has."""

from __future__ import annotations

from dataclasses import dataclass

from config.robot import FrictionTerm, RobotDescription
from dynamics.robot_model import RobotModel


@dataclass(frozen=True)
class ModelOptions:
    """Which terms the model has; see `RobotModel.from_description`.

    `friction_terms` replaces the terms of every joint where it is given, `shape` the values of the
    model's nonlinear parameters (`RobotModel.shape_names`).
    """

    rotors: bool = True
    friction: bool = True
    spring: bool = True
    sign_smoothing_rad_s: float = 0.0
    friction_terms: tuple[FrictionTerm, ...] | None = None
    payload: bool = False
    shape: tuple[float, ...] | None = None

    def build(self, robot: RobotDescription) -> RobotModel:
        """Build the model of a robot with these terms.

        Raises
        ------
        EstimationError
            Where `shape` has not as many values as the model has nonlinear parameters.
        """
        if self.friction_terms is not None:
            terms = {"friction": self.friction_terms}
            joints = tuple(joint.model_copy(update=terms) for joint in robot.joints)
            robot = robot.model_copy(update={"joints": joints})
        model = RobotModel.from_description(
            robot,
            rotors=self.rotors,
            friction=self.friction,
            spring=self.spring,
            payload=self.payload,
            sign_smoothing_rad_s=self.sign_smoothing_rad_s,
        )
        return model if self.shape is None else model.with_shape(self.shape)
