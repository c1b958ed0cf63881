"""`Goal`: accuracy that a measurement must reach; `GoalState`: the accuracy reached so far."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from dynamics.model.robot_model import RobotModel
from dynamics.terms.conditions import Conditions
from identification.estimation.estimate import Estimate
from identification.model.base_parameters import BaseParameters
from identification.model.torque_columns import torque_columns

POSES: Final = 400
TORQUE: Final = "torque"

_GOAL = re.compile(r"\s*([A-Za-z]\w*)\s*<\s*([0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*(\S.*)?")


@dataclass(frozen=True)
class Goal:
    """Largest allowed standard deviation of a quantity.

    Attributes:
        name: A base parameter's name, or `torque` for the predicted torque; its standard deviation
            is the RMS over the motion, of the least certain joint.
        limit: Largest standard deviation, in the parameter's unit (N m for torque), or relative to
            its value.
        relative: True if `limit` is relative to the value.
        text: The goal as the user wrote it.
    """

    name: str
    limit: float
    relative: bool
    text: str


@dataclass(frozen=True)
class GoalState:
    """State of a goal.

    Attributes:
        sigma, limit: Current and allowed standard deviation, in `unit`.
        noise: Part of `sigma` that falls with more periods; None if it is not known.
    """

    goal: Goal
    sigma: float
    limit: float
    noise: float | None
    unit: str

    @property
    def reached(self) -> bool:
        """True if the standard deviation is within the limit."""
        return self.sigma <= self.limit

    def sentence(self, periods: int) -> str:
        """Return a sentence: the accuracy after some averaged periods, and what to do if known."""
        so_far = f"{self.goal.text}: σ is {self.sigma:.3g} {self.unit} after {periods} periods"
        if self.reached:
            return f"{so_far}, reached"
        if self.noise is None or self.noise <= 0.0:
            return so_far
        model_part = math.sqrt(max(self.sigma**2 - self.noise**2, 0.0))
        if model_part >= self.limit:
            return (
                f"{so_far}; {model_part:.3g} {self.unit} are due to model error, which more"
                " periods do not reduce: choose a better model (identify --choose) or a larger"
                " motion"
            )
        share = self.noise**2 / (self.limit**2 - model_part**2)
        return f"{so_far}; about {math.ceil(periods * share)} periods in total are enough"


def parse_goals(texts: Sequence[str], model: RobotModel, base: BaseParameters) -> tuple[Goal, ...]:
    """Parse goals such as `sx3<0.01kgm`, `fv_axis1<5%` or `torque<1.5Nm`.

    Args:
        texts: Texts of the goals; without a unit, the parameter's own unit is used.
        model: The robot model.
        base: Its base parameters.

    Raises:
        ConfigError: A goal has a syntax error, a wrong unit or a limit of 0, or names a parameter
            that is unknown or cannot be identified.
    """
    return tuple(_parse(text, model, base) for text in texts)


def goal_states(
    goals: Sequence[Goal], estimate: Estimate, motion: tuple[FloatArray, FloatArray, FloatArray]
) -> tuple[GoalState, ...]:
    """Compare an estimate with goals.

    Args:
        estimate: The current estimate.
        motion: Tuple of (samples, n) arrays. Positions, velocities and accelerations at which a
            torque goal is evaluated.
    """
    return tuple(_state(goal, estimate, motion) for goal in goals)


def _parse(text: str, model: RobotModel, base: BaseParameters) -> Goal:
    match = _GOAL.fullmatch(text)
    if match is None:
        raise ConfigError(
            f"--until {text}: write a parameter, <, a number, and a unit or %, such as"
            " sx3<0.01kgm, fv_axis1<5% or torque<1.5Nm",
            code="RID-OPTION-SYNTAX",
        )
    name, number, unit = match[1], float(match[2]), (match[3] or "").replace(" ", "")
    if number <= 0.0:
        raise ConfigError(
            f"--until {text}: the standard deviation must be above 0", code="RID-OPTION-RANGE"
        )
    if name == TORQUE:
        own = "Nm"
    elif name in base.names:
        own = base.units[base.names.index(name)].replace(" ", "")
    elif name in model.parameter_names:
        index = base.standard_names.index(name)
        inside = [
            w for w, row in zip(base.expressions, base.combination, strict=True) if row[index]
        ]
        where = (
            f"the torques depend on this parameter only through {inside[0]!r}"
            if inside
            else "the torques do not depend on this parameter"
        )
        raise ConfigError(
            f"--until {text}: {name} cannot be identified separately: {where}",
            code="RID-OPTION-NAME",
        )
    else:
        raise ConfigError(
            f"--until {text}: {name} is not a parameter of this robot; use one of {TORQUE},"
            f" {', '.join(base.names)}",
            code="RID-OPTION-NAME",
        )
    if unit == "%":
        if name == TORQUE:
            raise ConfigError(
                f"--until {text}: a torque goal needs a value in Nm, not %",
                code="RID-OPTION-SYNTAX",
            )
        return Goal(name, number / 100.0, True, text)
    if unit not in ("", own):
        raise ConfigError(
            f"--until {text}: write the limit of {name} in {own}, not in {unit}",
            code="RID-OPTION-SYNTAX",
        )
    return Goal(name, number, False, text)


def _state(
    goal: Goal, estimate: Estimate, motion: tuple[FloatArray, FloatArray, FloatArray]
) -> GoalState:
    if goal.name == TORQUE:
        noise = estimate.covariance_noise
        return GoalState(
            goal,
            _torque_sigma(estimate, estimate.covariance_jackknife, motion),
            goal.limit,
            None if noise is None else _torque_sigma(estimate, noise, motion),
            "N m",
        )
    index = estimate.base.names.index(goal.name)
    size = abs(float(estimate.values[index])) if goal.relative else 1.0
    noise_sigma = estimate.sigma_noise
    return GoalState(
        goal,
        float(estimate.sigma[index]),
        goal.limit * size,
        None if noise_sigma is None else float(noise_sigma[index]),
        estimate.base.units[index],
    )


def _torque_sigma(
    estimate: Estimate, covariance: FloatArray, motion: tuple[FloatArray, FloatArray, FloatArray]
) -> float:
    """Return the RMS standard deviation of the predicted torque, of the least certain joint."""
    step = max(1, len(motion[0]) // POSES)
    q, v, a = (part[::step] for part in motion)
    reference_k = np.array([joint.reference_temperature_k for joint in estimate.robot.joints])
    warmth = Conditions(temperature_k=reference_k)
    phi = torque_columns(estimate.model, estimate.base, (q, v, a), warmth)
    variance = np.einsum("snb,bc,snc->n", phi, covariance, phi) / len(phi)
    return float(np.sqrt(variance.max()))
