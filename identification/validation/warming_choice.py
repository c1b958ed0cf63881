"""Choice of the joints that warm up by their own friction, if temperatures were not measured.

Friction falls while a robot warms up. This is a function of time in every recording, but so are
many other effects. Therefore a joint counts as warming up only under three conditions:
1. Coulomb and viscous friction that change with the temperature rise (`Warming`) lower the
   logarithm of the joint's error on held-out seconds by more than its standard error, and by at
   least `LEAST_GAIN` of `nested_choice`.
2. At least one of the two changes is distinct from zero.
3. The time constant is longer than `SHORTEST_S`. Plus and minus two standard deviations, it is
   above zero and below the length of the longest recording.

Time constants are first searched on a grid, for all joints at once because each affects only its
own joint. Then they are estimated by Gauss-Newton together with all other parameters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import BoolArray, FloatArray
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from identification.equations.segments import thin_rows
from identification.equations.time_domain import time_blocks
from identification.equations.warming import Warming
from identification.estimation.fitted_signals import FittedSignals, fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.regression.nested_choice import DISTINCT_SIGMAS, joints_that_gain
from identification.validation.held_out import held_out_errors
from identification.validation.parameter_steps import additional_parameter_steps
from identification.validation.robot_terms import with_friction

SHORTEST_S: Final = 20.0
"""Shortest time constant [s]: motors and gears take minutes to warm up."""
SHORTEST_RECORDING_S: Final = 60.0
"""Shortest recording that is used [s]: in shorter ones temperatures hardly change."""
STEP: Final = 2.0
ROUNDS: Final = 3
EVENTS: Final = 30
_CLASSICAL: Final[tuple[FrictionTerm, ...]] = ("coulomb", "viscous", "offset")


def choose_warming(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions | None = None,
) -> Warming | None:
    """Return the warming of the joints; None if no joint shows it.

    Args:
        robot: The robot with all its other friction terms.
        signals: The recordings of the training runs, without temperatures.
        options: The other terms of the model, and the speed above which a joint counts as moving.

    Raises:
        EstimationError: The recordings are too short to be split, or do not determine the model.
    """
    options = options or EstimationOptions()
    parts = [thin_rows(run) for run in signals]
    longest_s = max(float(part.time_s[-1] - part.time_s[0]) for part in parts)
    if longest_s < SHORTEST_RECORDING_S or any(part.temperature_k is not None for part in parts):
        return None
    plain = fit_smoothed(robot, parts, options)
    warming = _search_grid(
        _heating_friction(robot, parts, options), robot, parts, options, longest_s
    )
    if not warming.joints.any():
        return None
    full, sigma_s = _fit(warming, robot, parts, options), np.zeros(len(robot.joints))
    seconds = max(1, math.ceil(sum(part.time_s[-1] - part.time_s[0] for part in parts) / EVENTS))
    for _ in range(ROUNDS):
        step_s, sigma_s = additional_parameter_steps(
            full, _slope_by_time_constant(full, warming, robot, parts), seconds
        )
        before_s = warming.time_constant_s
        moved_s = np.clip(before_s + step_s, before_s / STEP, before_s * STEP)
        warming = replace(
            warming,
            time_constant_s=np.where(
                warming.joints, np.clip(moved_s, SHORTEST_S, STEP * longest_s), 0.0
            ),
        )
        full = _fit(warming, robot, parts, options)
    margin_s = 2.0 * sigma_s
    shown = warming.joints & _changes_with_temperature(full)
    shown &= warming.time_constant_s - margin_s > 0.0
    shown &= warming.time_constant_s + margin_s < longest_s
    shown &= warming.time_constant_s > SHORTEST_S
    shown &= joints_that_gain(*held_out_errors(plain, full))
    if not shown.any():
        return None
    return replace(
        warming,
        time_constant_s=warming.time_constant_s * shown,
        time_constant_sigma_s=sigma_s * shown,
    )


def _heating_friction(
    robot: RobotDescription, parts: Sequence[SmoothedSignals], options: EstimationOptions
) -> Warming:
    """Return the friction that heats the joints (Coulomb and viscous), without time constants."""
    simple = with_friction(robot, [_CLASSICAL] * len(robot.joints))
    fitted = fit_smoothed(simple, parts, options)
    values = dict(zip(fitted.base.names, fitted.values.tolist(), strict=True))
    coulomb, viscous = (
        np.array([max(values.get(f"{symbol}_{name}", 0.0), 0.0) for name in robot.joint_names])
        for symbol in ("fc", "fv")
    )
    nothing = np.zeros(len(robot.joints))
    return Warming(nothing, nothing, coulomb, viscous)


def _search_grid(
    cold: Warming,
    robot: RobotDescription,
    parts: Sequence[SmoothedSignals],
    options: EstimationOptions,
    longest_s: float,
) -> Warming:
    """Return the warming with each joint's best time constant of a grid."""
    heated = (cold.coulomb_nm > 0.0) | (cold.viscous_nm_s > 0.0)
    count = 1 + math.floor(math.log(longest_s / SHORTEST_S) / math.log(STEP))
    tried_s = SHORTEST_S * STEP ** np.arange(count)
    residuals = [
        _fit(
            replace(cold, time_constant_s=np.where(heated, each_s, 0.0)), robot, parts, options
        ).fit.residual_nm
        for each_s in tried_s
    ]
    return replace(
        cold, time_constant_s=np.where(heated, tried_s[np.argmin(residuals, axis=0)], 0.0)
    )


def _fit(
    warming: Warming,
    robot: RobotDescription,
    parts: Sequence[SmoothedSignals],
    options: EstimationOptions,
) -> FittedSignals:
    warmed = [warming.with_temperatures(robot, part) for part in parts]
    return fit_smoothed(warming.robot(robot), warmed, options)


def _slope_by_time_constant(
    full: FittedSignals,
    warming: Warming,
    robot: RobotDescription,
    parts: Sequence[SmoothedSignals],
) -> FloatArray:
    """Return the derivative of each joint's torque by its time constant, (rows, n) [N m/s]."""
    runs = tuple(
        replace(
            run,
            signals=slopes,
            conditions=replace(run.conditions, temperature_k=slopes.temperature_k),
        )
        for run, slopes in zip(
            full.problem.runs,
            (warming.with_temperature_slopes(robot, part) for part in parts),
            strict=True,
        )
    )
    places = [_temperature_coefficients(full, name) for name in robot.joint_names]
    found = [
        np.stack(
            [block.columns[:, j, own] @ full.values[own] for j, own in enumerate(places)], axis=1
        )
        for block in time_blocks(
            full.model, full.base, runs, full.problem.standstill_rad_s, full.standard
        )
    ]
    return np.concatenate(found)


def _changes_with_temperature(full: FittedSignals) -> BoolArray:
    """Return a mask of the joints whose change with temperature is distinct from zero, (n,)."""
    sigma = full.estimate().sigma
    return np.array(
        [
            bool(np.any(np.abs(full.values[own]) > DISTINCT_SIGMAS * sigma[own]))
            for own in (_temperature_coefficients(full, name) for name in full.model.joint_names)
        ]
    )


def _temperature_coefficients(full: FittedSignals, joint: str) -> list[int]:
    """Return the indices of a joint's temperature coefficients among the base parameters."""
    names = full.base.names
    return [names.index(own) for own in (f"fcT_{joint}", f"fvT_{joint}") if own in names]
