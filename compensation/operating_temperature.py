"""`at_operation`: a model at the temperature that joints work at, where friction depends on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.number import parse_numbers
from config.plausible import ZERO_CELSIUS_K
from identification.estimation.at_temperature import at_temperature, by_temperature
from identification.estimation.estimate import Estimate

COLD: Final = "cold"
WARM: Final = "warm"
LOWEST_C, HIGHEST_C = -40.0, 200.0


@dataclass(frozen=True, eq=False)
class AtOperation:
    """A model at one temperature.

    Attributes:
        estimate: It, without friction that depends on temperature.
        sentence: How warm that is, in words; empty where its friction does not depend on it.
    """

    estimate: Estimate
    sentence: str = ""

    @property
    def notes(self) -> list[str]:
        """The sentence, where there is one."""
        return [self.sentence] if self.sentence else []


def at_operation(estimate: Estimate, asked: str | None, velocity: FloatArray | None) -> AtOperation:
    """Return a model at the temperature that a person asks for.

    Args:
        estimate: The model.
        asked: Degrees Celsius, one or one a joint separated by commas, for a model that was
            identified with measured temperatures; `cold`, or `warm` as the motion makes them that
            is repeated, for one that follows warmth without thermometers.
        velocity: Shape (samples, n). Of the whole motion [rad/s or m/s]; None where nobody knows it
            ahead.

    Raises:
        ConfigError: Nothing was asked and the friction depends on temperature, or it does not and
            something was; or what was asked is not known of this model, or is no temperature.
    """
    depends = by_temperature(estimate)
    names = [joint.name for joint in estimate.robot.joints]
    if not depends.any():
        if asked is not None:
            raise ConfigError(
                f"--temperature {asked}: has no effect, friction in this model does not depend on"
                " temperature; leave it out",
                code="RID-OPTION-NO-EFFECT",
            )
        return AtOperation(estimate)
    told = ", ".join(name for name, own in zip(names, depends, strict=True) if own)
    words = (COLD, WARM)
    if estimate.warming is None:
        if asked is None or asked in words:
            raise ConfigError(
                f"friction of {told} depends on temperatures that were measured: say at how many"
                " degrees Celsius the drives work, --temperature 40, or one for each joint"
                " separated by commas",
                code="RID-MODEL-TEMPERATURE",
            )
        return _at_degrees(estimate, asked, names)
    if asked not in words:
        raise ConfigError(
            f"friction of {told} depends on warmth that nobody measured: say --temperature {WARM},"
            f" as the motion makes them that is repeated, or --temperature {COLD}, as after a long"
            " rest",
            code="RID-MODEL-TEMPERATURE",
        )
    cold = np.array([joint.reference_temperature_k for joint in estimate.robot.joints])
    if asked == COLD:
        return AtOperation(
            at_temperature(estimate, cold), f"Friction of {told} as after a long rest."
        )
    if velocity is None:
        raise ConfigError(
            f"--temperature {WARM}: the motion comes point by point, nobody knows how warm it makes"
            f" the joints: give --temperature {COLD}, or a motion file",
            code="RID-MODEL-TEMPERATURE",
        )
    settled = estimate.warming.settled(estimate.robot, velocity)
    heat = ", ".join(
        f"{rise:.3g} W in {name}"
        for name, rise, own in zip(names, settled - cold, depends, strict=True)
        if own
    )
    return AtOperation(
        at_temperature(estimate, settled),
        f"Friction as the motion makes it when it is repeated until nothing changes: it leaves"
        f" {heat}. Until then joints rub otherwise.",
    )


def _at_degrees(estimate: Estimate, asked: str, names: list[str]) -> AtOperation:
    try:
        degrees = parse_numbers(asked)
    except ConfigError:
        degrees = ()
    if len(degrees) not in (1, len(names)) or not all(
        LOWEST_C <= each <= HIGHEST_C for each in degrees
    ):
        raise ConfigError(
            f"--temperature {asked}: give one temperature of {LOWEST_C:g} to {HIGHEST_C:g} °C, or"
            f" {len(names)} separated by commas",
            code="RID-OPTION-SYNTAX",
        )
    each = np.broadcast_to(np.array(degrees), (len(names),))
    said = ", ".join(f"{value:g} °C" for value in degrees)
    return AtOperation(at_temperature(estimate, each + ZERO_CELSIUS_K), f"Friction as at {said}.")
