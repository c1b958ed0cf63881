"""`EstimatedFriction`: the friction of an identified model, to compare measured friction with."""

from __future__ import annotations

from dataclasses import dataclass

from config.arrays import FloatArray
from config.errors import ConfigError
from config.plausible import ZERO_CELSIUS_K
from dynamics.terms.friction import Friction
from identification.estimation.at_temperature import by_temperature
from identification.estimation.estimate import Estimate
from identification.friction.curve import friction_columns


@dataclass(frozen=True, eq=False)
class EstimatedFriction:
    """The friction that a model has by its estimate, joint by joint.

    Attributes:
        estimate: The model; it has friction.

    Raises:
        ConfigError: The model has no friction.
    """

    estimate: Estimate

    def __post_init__(self) -> None:
        if not any(isinstance(term, Friction) for term in self.estimate.model.terms):
            raise ConfigError(
                "the model file has no friction to compare with", code="RID-MODEL-NO-FRICTION"
            )

    def torque(self, joint: int, speed: FloatArray) -> FloatArray:
        """Return the friction of a joint, from 0, at signed speeds, shape (s,) [N m or N].

        Temperatures are the reference's; what load adds is left out.
        """
        model = self.estimate.model
        values = self.estimate.standard_values[model.parameter_groups["friction"]]
        return friction_columns(model, joint, speed) @ values

    def circumstances(self, joint: int) -> str:
        """Return in words what `torque` holds for, of a joint, from 0.

        Such as "as after a long rest and without what load adds"; empty where friction depends on
        speed alone.
        """
        estimate = self.estimate
        taken = []
        if by_temperature(estimate)[joint]:
            reference_k = estimate.robot.joints[joint].reference_temperature_k
            warm = f"at {reference_k - ZERO_CELSIUS_K:.3g} °C"
            taken.append(warm if estimate.warming is None else "as after a long rest")
        if any(loss.joint == joint for loss in estimate.model.transmission.losses):
            taken.append("without what load adds")
        return " and ".join(taken)
