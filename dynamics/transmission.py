"""`Transmission`: what the gears take of the torque that they transmit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from config.errors import EstimationError
from config.robot import RobotDescription
from dynamics.kinematics import FloatArray
from dynamics.motion import Motion
from dynamics.shape import ShapeParameter

LOWEST_EFFICIENCY: Final = 0.2
HIGHEST_LOAD_FRICTION: Final = 0.5
START_LOAD_FRICTION: Final = 0.02


@dataclass(frozen=True)
class GearLoss:
    """The loss of one gear: an efficiency, or friction in proportion to the load."""

    joint: int
    kind: Literal["efficiency", "load"]
    parameter: ShapeParameter


@dataclass(frozen=True)
class Transmission:
    """Losses in proportion to the torque that a gear transmits.

    With s = 1 where the motor drives the load, s = -1 where the load drives the motor, the torque
    behind the gear is multiplied by eta^-s (5.16, 5.17), or by 1 + c s: friction c |load| sign(v).
    """

    losses: tuple[GearLoss, ...] = ()

    @classmethod
    def from_description(cls, robot: RobotDescription, *, friction: bool = True) -> Transmission:
        """Take the gears' losses out of a robot description."""
        losses: list[GearLoss] = []
        for j, joint in enumerate(robot.joints):
            if joint.efficiency is not None:
                eta = ShapeParameter(
                    f"eta_{joint.name}", "1", joint.efficiency, LOWEST_EFFICIENCY, 1.0
                )
                losses.append(GearLoss(j, "efficiency", eta))
            if friction and "load" in joint.friction:
                share = ShapeParameter(
                    f"cl_{joint.name}", "1", START_LOAD_FRICTION, 0.0, HIGHEST_LOAD_FRICTION
                )
                losses.append(GearLoss(j, "load", share))
        return cls(tuple(losses))

    @property
    def shape(self) -> tuple[ShapeParameter, ...]:
        """The nonlinear parameters, gear by gear."""
        return tuple(loss.parameter for loss in self.losses)

    def with_shape(self, values: FloatArray) -> Transmission:
        """Return the same gears with other values of the nonlinear parameters."""
        return Transmission(
            tuple(
                replace(loss, parameter=replace(loss.parameter, value=float(value)))
                for loss, value in zip(self.losses, values, strict=True)
            )
        )

    def factors(self, motion: Motion) -> FloatArray | None:
        """Return what the torque behind each gear is multiplied by, (samples, n); None for 1.

        Raises
        ------
        EstimationError
            Where the gears lose something and the motion's load is not known.
        """
        if not self.losses:
            return None
        if motion.conditions.load_nm is None:
            names = ", ".join(parameter.name for parameter in self.shape)
            raise EstimationError(
                f"{names} depend on the torque that the gears transmit: give"
                " `Conditions.load_nm`, as `load_torque` computes it"
            )
        speed = motion.actuator[1]
        direction = np.sign(np.broadcast_to(motion.conditions.load_nm, speed.shape) * speed)
        factors: FloatArray = np.ones_like(speed)
        for loss in self.losses:
            s, value = direction[:, loss.joint], loss.parameter.value
            factors[:, loss.joint] *= value**-s if loss.kind == "efficiency" else 1.0 + value * s
        return factors
