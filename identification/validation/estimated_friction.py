"""`EstimatedFriction`: the friction of an identified model, to compare with measured friction."""

from __future__ import annotations

from dataclasses import dataclass

from config.arrays import FloatArray
from config.errors import ConfigError
from config.plausible import ZERO_CELSIUS_K
from dynamics.terms.friction import Friction
from identification.estimation.at_temperature import depends_on_temperature
from identification.estimation.estimate import Estimate
from identification.friction.curve import friction_columns


@dataclass(frozen=True, eq=False)
class EstimatedFriction:
    """The friction of an estimated model, joint by joint.

    Attributes:
        estimate: The estimate of a model with friction.

    Raises:
        ConfigError: The model has no friction.
    """

    estimate: Estimate

    def __post_init__(self) -> None:
        if not any(isinstance(term, Friction) for term in self.estimate.model.terms):
            raise ConfigError(
                "the model file has no friction to compare with: identify a model with friction",
                code="RID-MODEL-NO-FRICTION",
            )

    def torque(self, joint: int, speed: FloatArray) -> FloatArray:
        """Return the friction of a joint at signed speeds, shape (s,) [N m or N].

        It is computed at the reference temperatures and without load-dependent friction. `joint` is
        the joint's index, from 0.
        """
        model = self.estimate.model
        values = self.estimate.standard_values[model.parameter_groups["friction"]]
        return friction_columns(model, joint, speed) @ values

    def conditions_in_words(self, joint: int) -> str:
        """Return the conditions of `torque` for a joint in words.

        An example is "after a long rest and without load-dependent friction". The text is empty if
        friction depends only on speed. `joint` is the joint's index, from 0.
        """
        estimate = self.estimate
        taken = []
        if depends_on_temperature(estimate)[joint]:
            reference_k = estimate.robot.joints[joint].reference_temperature_k
            warm = f"at {reference_k - ZERO_CELSIUS_K:.3g} °C"
            taken.append(warm if estimate.warming is None else "for a joint after a long rest")
        if any(loss.joint == joint for loss in estimate.model.transmission.losses):
            taken.append("without load-dependent friction")
        return " and ".join(taken)
