"""`ModelOptions`: the terms of an estimate's model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pydantic import ValidationError

from config.errors import EstimationError
from config.ranges import Coefficient, Ranged, SmoothingRadS
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import Joint, RobotDescription
from config.wrong_value import explain_error
from dynamics.model.robot_model import RobotModel
from identification.model.base_parameters import (
    BaseParameters,
    ModelKind,
    base_parameters,
    joints_with_separate_rotors,
)
from identification.model.still_joints import StillJoint


@dataclass(frozen=True)
class ModelOptions(Ranged):
    """Terms of the model; see `RobotModel.from_description`.

    `kind` selects the measured quantities: the external and the combined model need a force plate.
    `friction_terms` replaces the terms of every joint if it is given, and `nonlinear` the values of
    the model's nonlinear parameters (`RobotModel.nonlinear_names`). `separate_rotors` are the
    joints with lossy gears whose rotor's inertia is a base parameter of its own; None: an estimate
    finds them (`identification.estimation.lossy_gears`).
    """

    kind: ModelKind = "internal"
    rotors: bool = True
    friction: bool = True
    spring: bool = True
    sign_smoothing_rad_s: SmoothingRadS = 0.0
    friction_terms: tuple[FrictionTerm, ...] | None = None
    payload: bool = False
    nonlinear: tuple[Coefficient, ...] | None = None
    separate_rotors: tuple[int, ...] | None = None

    def build(self, robot: RobotDescription) -> RobotModel:
        """Build the model of a robot with these terms.

        Raises:
            EstimationError: `nonlinear` does not have one value for each nonlinear parameter of the
                model, or the friction terms contradict each other or a joint.
        """
        if self.friction_terms is not None:
            joints = tuple(_with_friction(joint, self.friction_terms) for joint in robot.joints)
            robot = robot.model_copy(update={"joints": joints})
        model = RobotModel.from_description(
            robot,
            rotors=self.rotors,
            friction=self.friction,
            spring=self.spring,
            payload=self.payload,
            sign_smoothing_rad_s=self.sign_smoothing_rad_s,
        )
        return model if self.nonlinear is None else model.with_nonlinear(self.nonlinear)

    def base_parameters(
        self, robot: RobotDescription, still: Sequence[StillJoint] = ()
    ) -> BaseParameters:
        """Return the base parameters of a robot with these terms; see `base_parameters`."""
        return base_parameters(
            self.build(robot), kind=self.kind, still=still, lossy=self.separate_rotors or ()
        )

    def fitted(self, model: RobotModel, base: BaseParameters) -> ModelOptions:
        """Return these options with the nonlinear parameters and separate rotors of a fit."""
        return replace(
            self,
            nonlinear=tuple(model.nonlinear_values.tolist()) or None,
            separate_rotors=joints_with_separate_rotors(model, base),
        )


def _with_friction(joint: Joint, terms: tuple[FrictionTerm, ...]) -> Joint:
    try:
        return Joint.model_validate(joint.model_dump() | {"friction": terms})
    except ValidationError as error:
        message = explain_error(error.errors()[0])
        raise EstimationError(
            f"friction terms {', '.join(terms)} for joint {joint.name}: {message}",
            code="RID-OPTION-NAME",
        ) from None
