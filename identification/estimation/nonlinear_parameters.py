"""Nonlinear parameters, fitted together with the linear ones by Gauss-Newton steps on one cost.

The torque is nonlinear in Stribeck speeds, presliding parameters and gear losses. For given values
of these, it is linear in all other parameters, which are solved for exactly (variable projection:
Golub and Pereyra 1973). The step of the nonlinear parameters comes from the equations linearised
with `torque_columns`. It is halved, at most five times, until the cost falls, and limited to the
parameters' bounds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.model.robot_model import RobotModel
from identification.model.base_parameters import BaseParameters
from identification.regression.least_squares import Solution, Triangle

MOST_STEPS: Final = 25
MOST_HALVINGS: Final = 6
SETTLED_SIGMAS: Final = 0.01
WORTH_A_STEP: Final = 0.02
"""Smallest useful decrease of the cost; the cost is about the number of equations."""

Solve = Callable[[RobotModel, FloatArray], Solution]
"""Function that solves a model's equations, linearised at given standard values."""


@dataclass(frozen=True, eq=False)
class NonlinearFit:
    """A model with fitted nonlinear parameters, and the standard values of its linearisation."""

    model: RobotModel
    standard: FloatArray
    solution: Solution
    cost: float


def fit_nonlinear(
    model: RobotModel, base: BaseParameters, values: FloatArray, solve: Solve
) -> NonlinearFit:
    """Fit the nonlinear parameters together with the linear ones.

    Args:
        model: The model with its starting values.
        base: The base parameters of its linear part.
        values: Shape (b,). Base parameters for lossless gears: the first point of the
            linearisation.
        solve: Function that solves for the columns of `torque_columns`; it must weight the rows
            equally in every call.

    Raises:
        EstimationError: The motion does not determine the parameters.
    """
    best = _solve_at(model, base.to_standard(values), base, solve)
    for _ in range(MOST_STEPS):
        low, high = best.model.nonlinear_bounds.T
        start, step = best.model.nonlinear_values, best.solution.values[len(base) :]
        sigma = np.sqrt(np.diagonal(best.solution.covariance)[len(base) :])
        if np.all(np.abs(np.clip(start + step, low, high) - start) <= SETTLED_SIGMAS * sigma):
            break
        for halving in range(MOST_HALVINGS):
            moved = np.clip(start + step / 2.0**halving, low, high)
            tried = _solve_at(best.model.with_nonlinear(moved), best.standard, base, solve)
            if tried.cost < best.cost:
                gain, best = best.cost - tried.cost, tried
                break
        else:
            break
        if gain < WORTH_A_STEP:
            break
    return best


def step_prior(model: RobotModel, b: int, width: int | None = None) -> Triangle:
    """Return equations that limit the steps of nonlinear parameters to the size of their ranges.

    They have no effect on parameters that the data determine. They keep the steps of other
    parameters small, for example of the Stribeck speed of a term whose coefficient is zero. In the
    unknowns, the steps follow `b` base parameters; `width` is the number of all unknowns.
    """
    low, high = model.nonlinear_bounds.T
    columns = np.arange(b, b + len(low))
    factor = np.column_stack([np.diag(1.0 / (high - low)), np.zeros(len(low))])
    return Triangle(factor, columns, width or b + len(low), len(low))


def _solve_at(
    model: RobotModel, standard: FloatArray, base: BaseParameters, solve: Solve
) -> NonlinearFit:
    """Solve for the linear parameters, and linearise the model at this solution."""
    values, cost = solve(model, standard).leading(len(base))
    standard = base.to_standard(values)
    return NonlinearFit(model, standard, solve(model, standard), cost)
