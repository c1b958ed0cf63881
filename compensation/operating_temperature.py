"""A model at the operating temperature, if its friction depends on temperature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.number import parse_numbers
from config.plausible import ZERO_CELSIUS_K
from identification.estimation.at_temperature import at_temperature, depends_on_temperature
from identification.estimation.estimate import Estimate

COLD: Final = "cold"
WARM: Final = "warm"
LOWEST_C, HIGHEST_C = -40.0, 200.0


@dataclass(frozen=True, eq=False)
class AtOperation:
    """A model at one temperature.

    Attributes:
        estimate: The model; its friction is that at the temperature and no longer depends on it.
        sentence: The temperature in words; empty if friction does not depend on it.
    """

    estimate: Estimate
    sentence: str = ""

    @property
    def notes(self) -> list[str]:
        """The sentence as a list; empty if friction does not depend on temperature."""
        return [self.sentence] if self.sentence else []


def at_operating_temperature(
    estimate: Estimate, requested: str | None, velocity: FloatArray | None
) -> AtOperation:
    """Return a model at the requested temperature.

    Args:
        requested: Requested temperature. For a model identified with measured temperatures: degrees
            Celsius, as one value, or as one per joint separated by commas. For a model that
            computes warming without thermometers: `cold`, or `warm` for the steady state after many
            repetitions of the motion.
        velocity: Shape (samples, n). The whole motion [rad/s or m/s]; None if it is not known in
            advance.

    Raises:
        ConfigError: The friction depends on temperature but no temperature was given; a temperature
            was given but the friction does not depend on it; or the value does not fit the model or
            is not a temperature.
    """
    depends = depends_on_temperature(estimate)
    names = [joint.name for joint in estimate.robot.joints]
    if not depends.any():
        if requested is not None:
            raise ConfigError(
                f"--temperature {requested}: has no effect: friction in this model does not depend"
                " on temperature; leave the option out",
                code="RID-OPTION-NO-EFFECT",
            )
        return AtOperation(estimate)
    affected = ", ".join(name for name, own in zip(names, depends, strict=True) if own)
    words = (COLD, WARM)
    if estimate.warming is None:
        if requested is None or requested in words:
            raise ConfigError(
                f"friction of {affected} depends on measured temperatures: state the drives'"
                " temperature in degrees Celsius, such as --temperature 40, or one value per"
                " joint separated by commas",
                code="RID-MODEL-TEMPERATURE",
            )
        return _at_degrees(estimate, requested, names)
    if requested not in words:
        raise ConfigError(
            f"friction of {affected} depends on warming without thermometers: use --temperature"
            f" {WARM} for the state after many repetitions of the motion, or --temperature {COLD}"
            " for a robot after a long rest",
            code="RID-MODEL-TEMPERATURE",
        )
    cold = np.array([joint.reference_temperature_k for joint in estimate.robot.joints])
    if requested == COLD:
        return AtOperation(
            at_temperature(estimate, cold), f"Friction of {affected} after a long rest."
        )
    if velocity is None:
        raise ConfigError(
            f"--temperature {WARM}: the motion arrives point by point, so the warming it causes is"
            f" not known: use --temperature {COLD}, or a motion file",
            code="RID-MODEL-TEMPERATURE",
        )
    settled = estimate.warming.steady_temperatures(estimate.robot, velocity)
    heat = ", ".join(
        f"{rise:.3g} W in {name}"
        for name, rise, own in zip(names, settled - cold, depends, strict=True)
        if own
    )
    return AtOperation(
        at_temperature(estimate, settled),
        "Friction after many repetitions of the motion, when it no longer changes. Heat of"
        f" friction: {heat}. Until then, friction differs.",
    )


def _at_degrees(estimate: Estimate, requested: str, names: list[str]) -> AtOperation:
    code = ""
    degrees: tuple[float, ...] = ()
    try:
        degrees = parse_numbers(requested)
    except ConfigError:
        code = "RID-OPTION-SYNTAX"
    if degrees and len(degrees) not in (1, len(names)):
        code = "RID-OPTION-COUNT"
    elif not all(LOWEST_C <= each <= HIGHEST_C for each in degrees):
        code = "RID-OPTION-RANGE"
    if code:
        raise ConfigError(
            f"--temperature {requested}: give one temperature of {LOWEST_C:g} to {HIGHEST_C:g} °C,"
            f" or {len(names)} separated by commas",
            code=code,
        )
    each = np.broadcast_to(np.array(degrees), (len(names),))
    shown = ", ".join(f"{value:g} °C" for value in degrees)
    return AtOperation(at_temperature(estimate, each + ZERO_CELSIUS_K), f"Friction at {shown}.")
