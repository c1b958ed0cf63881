"""`Transmission`: losses of the gears."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.terms.motion import TermMotion
from dynamics.terms.term_parameter import NonlinearParameter

LOWEST_EFFICIENCY: Final = 0.2
HIGHEST_LOAD_FRICTION: Final = 0.5
START_LOAD_FRICTION: Final = 0.02


@dataclass(frozen=True)
class GearLoss:
    """The loss of one gear: an efficiency, or a friction that is proportional to the load."""

    joint: int
    kind: Literal["efficiency", "load"]
    parameter: NonlinearParameter

    @property
    def size(self) -> float:
        """Size of the loss; 0 for a lossless gear."""
        value = self.parameter.value
        return 1.0 - value if self.kind == "efficiency" else value

    def of_size(self, size: float) -> GearLoss:
        """Return this loss with another size."""
        value = 1.0 - size if self.kind == "efficiency" else size
        return replace(self, parameter=replace(self.parameter, value=value))


@dataclass(frozen=True)
class Transmission:
    """Losses of all gears; each loss is proportional to the torque that its gear transmits.

    Let s = 1 if the motor drives the load, and s = -1 if the load drives the motor; s = 0 at rest,
    and presliding hysteresis gives values in between. The torque of the load is multiplied by
    eta^-s (5.16, 5.17), or by 1 + c s for a load-dependent friction c |load| sign(v). A gear does
    not transmit the inertia torque of its own motor's rotor. But if an estimate does not
    distinguish the rotor's inertia from that of the link, both count as transmitted load
    (`identification.estimation.lossy_gears`).
    """

    losses: tuple[GearLoss, ...] = ()

    @classmethod
    def from_description(cls, robot: RobotDescription, *, friction: bool = True) -> Transmission:
        """Return the gears' losses in a robot description."""
        losses: list[GearLoss] = []
        for j, joint in enumerate(robot.joints):
            if joint.efficiency is not None:
                eta = NonlinearParameter(
                    f"eta_{joint.name}", "1", joint.efficiency, LOWEST_EFFICIENCY, 1.0
                )
                losses.append(GearLoss(j, "efficiency", eta))
            if friction and "load" in joint.friction:
                factor = NonlinearParameter(
                    f"cl_{joint.name}", "1", START_LOAD_FRICTION, 0.0, HIGHEST_LOAD_FRICTION
                )
                losses.append(GearLoss(j, "load", factor))
        return cls(tuple(losses))

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """The nonlinear parameters: one per loss."""
        return tuple(loss.parameter for loss in self.losses)

    def with_nonlinear(self, values: FloatArray) -> Transmission:
        """Return a copy with other values of the nonlinear parameters."""
        return Transmission(
            tuple(
                replace(loss, parameter=replace(loss.parameter, value=float(value)))
                for loss, value in zip(self.losses, values, strict=True)
            )
        )

    def factors(self, motion: TermMotion) -> FloatArray | None:
        """Return the factor of the load torque of each gear, (samples, n); None if all are 1.

        Raises:
            EstimationError: The gears have losses, but `Conditions.load_nm` is None.
        """
        if not self.losses:
            return None
        factors: FloatArray = np.ones_like(motion.actuator[1])
        direction = self._direction(motion)
        for loss in self.losses:
            s, value = direction[:, loss.joint], loss.parameter.value
            factors[:, loss.joint] *= value**-s if loss.kind == "efficiency" else 1.0 + value * s
        return factors

    def nonlinear_slopes(self, motion: TermMotion) -> FloatArray:
        """Return the torque's derivatives with respect to the losses, (samples, n, losses)."""
        slopes = np.zeros((*motion.joint.shape[1:], len(self.losses)))
        if not self.losses:
            return slopes
        direction = self._direction(motion)
        load = np.asarray(motion.conditions.load_nm)
        for k, loss in enumerate(self.losses):
            s, value = direction[:, loss.joint], loss.parameter.value
            slope = -s * value ** (-s - 1.0) if loss.kind == "efficiency" else s
            slopes[:, loss.joint, k] = slope * load[:, loss.joint]
        return slopes

    def _direction(self, motion: TermMotion) -> FloatArray:
        """Return s (see the class), (samples, n): 1 motor drives load, -1 load drives motor."""
        load = motion.conditions.load_nm
        if load is None:
            names = ", ".join(parameter.name for parameter in self.nonlinear)
            raise EstimationError(
                f"{names} depend on the torque that the gears transmit: give"
                " `Conditions.load_nm`, as `load_torque` computes it",
                code="RID-API-ARGUMENT",
            )
        direction = np.sign(load * motion.actuator[1])
        for j in self._joints_with_memory(motion):
            direction[:, j] = np.sign(load[:, j]) * _hysteretic_direction(motion, j)
        return np.asarray(direction)

    def _joints_with_memory(self, motion: TermMotion) -> list[int]:
        memory = motion.conditions.memory
        return [] if memory is None else [x.joint for x in self.losses if x.joint in memory.joints]

    def memory_slopes(self, motion: TermMotion) -> FloatArray:
        """Return the torque's derivative with respect to the hysteretic direction, (samples, n)."""
        slopes = np.zeros(motion.joint.shape[1:])
        if not self._joints_with_memory(motion):
            return slopes
        direction = self._direction(motion)
        load = np.abs(np.asarray(motion.conditions.load_nm))
        for loss in self.losses:
            if loss.joint in self._joints_with_memory(motion):
                s, value = direction[:, loss.joint], loss.parameter.value
                by_s = -np.log(value) * value**-s if loss.kind == "efficiency" else value
                slopes[:, loss.joint] += by_s * load[:, loss.joint]
        return slopes


def _hysteretic_direction(motion: TermMotion, joint: int) -> FloatArray:
    memory = motion.conditions.memory
    direction = None if memory is None else memory.of(joint)
    return np.sign(motion.actuator[1, :, joint]) if direction is None else direction
