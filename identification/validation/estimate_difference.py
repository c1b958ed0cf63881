"""`EstimateDifference`: two estimates of one robot, parameter by parameter, in standard deviations.

If the m differences are due to noise alone, the largest exceeds `limit_sigmas` in at most 1 % of
all cases (Bonferroni's inequality for normal errors), for any correlation of the parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import ndtri

from config.arrays import FloatArray
from config.errors import EstimationError
from identification.estimation.estimate import Estimate
from identification.estimation.transformed import with_rotors_in_links

CHANCE: Final = 0.01
"""Probability of a false difference between two estimates."""


@dataclass(frozen=True, eq=False)
class EstimateDifference:
    """Values of the same parameters in two estimates.

    Attributes:
        names, units: The m parameters that both have as the same combination of standard ones.
        first, second: Shape (m,). Values of the two estimates.
        first_sigma, second_sigma: Shape (m,). Standard deviations (`Estimate.sigma`).
        only_first, only_second: Parameters that only one estimate has, or that are different
            combinations.
        shared_runs: Runs that both estimates use. If there are any, the errors are correlated, and
            the differences are smaller than the standard deviations suggest.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    first: FloatArray
    second: FloatArray
    first_sigma: FloatArray
    second_sigma: FloatArray
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]
    shared_runs: tuple[str, ...]

    @property
    def sigmas(self) -> FloatArray:
        """Second minus first, in standard deviations of this difference, shape (m,)."""
        sigma = np.hypot(self.first_sigma, self.second_sigma)
        return np.asarray((self.second - self.first) / sigma)

    @property
    def limit_sigmas(self) -> float:
        """The largest difference that noise can explain [standard deviations]."""
        return float(-ndtri(CHANCE / (2.0 * len(self.names))))

    @property
    def worst(self) -> int:
        """Index of the parameter that differs most."""
        return int(np.argmax(np.abs(self.sigmas)))

    @property
    def agree(self) -> bool:
        """True if noise can explain every difference."""
        return bool(np.abs(self.sigmas).max() <= self.limit_sigmas)


def compare_estimates(first: Estimate, second: Estimate) -> EstimateDifference:
    """Compare two estimates.

    Args:
        first, second: Estimates of one robot; their models may differ.

    Raises:
        EstimationError: The names of robot or joints differ, or the estimates have no common
            parameter.
    """
    names = [(each.robot.name, *each.robot.joint_names) for each in (first, second)]
    if names[0] != names[1]:
        robots = [f"{robot} ({', '.join(joints)})" for robot, *joints in names]
        raise EstimationError(
            f"the first model is of robot {robots[0]}, but the second is of {robots[1]}: compare"
            " models of the same robot",
            code="RID-ROBOT-OTHER",
        )
    if first.options.separate_rotors != second.options.separate_rotors:
        first, second = with_rotors_in_links(first), with_rotors_in_links(second)
    one, other = _entries(first), _entries(second)
    both = [key for key in one if key in other]
    if not both:
        raise EstimationError(
            "the models have no common parameter: identify both with the same --model and robot"
            " file",
            code="RID-MODEL-TERMS-DIFFER",
        )
    table = np.array([[*one[key][:2], *other[key][:2]] for key in both])
    return EstimateDifference(
        names=tuple(name for name, _ in both),
        units=tuple(one[key][2] for key in both),
        first=table[:, 0],
        first_sigma=table[:, 1],
        second=table[:, 2],
        second_sigma=table[:, 3],
        only_first=tuple(name for name, words in one if (name, words) not in other),
        only_second=tuple(name for name, words in other if (name, words) not in one),
        shared_runs=tuple(run for run in first.run_ids if run in second.run_ids),
    )


def _entries(estimate: Estimate) -> dict[tuple[str, str], tuple[float, float, str]]:
    """Return value, sigma and unit of each parameter, by its name and its expression."""
    base, model = estimate.base, estimate.model
    entries = {
        (base.names[i], base.expressions[i]): (
            float(estimate.values[i]),
            float(estimate.sigma[i]),
            base.units[i],
        )
        for i in range(len(base))
    }
    shapes = zip(
        model.nonlinear_names,
        model.nonlinear_values,
        estimate.nonlinear_sigma,
        model.nonlinear_units,
        strict=True,
    )
    for name, value, sigma, unit in shapes:
        entries[name, name] = (float(value), float(sigma), unit)
    return {key: entry for key, entry in entries.items() if entry[1] > 0.0}
