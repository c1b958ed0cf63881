"""`EstimateDifference`: two estimates of one robot, parameter by parameter, in standard deviations.

Of m differences that noise alone makes, one exceeds `limit_sigmas` in a hundredth of all cases
(Bonferroni's inequality on normal errors), however the parameters are correlated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import ndtri

from config.arrays import FloatArray
from config.errors import EstimationError
from identification.estimation.estimate import Estimate

CHANCE: Final = 0.01
"""Of calling two estimates different that are not."""


@dataclass(frozen=True, eq=False)
class EstimateDifference:
    """What two estimates say of the same parameters.

    Attributes:
        names, units: The m parameters that both have, as the same combination of standard ones.
        first, second: Shape (m,). Their values.
        first_sigma, second_sigma: Shape (m,). Their standard deviations (`Estimate.sigma`).
        only_first, only_second: Parameters that only one has, or that are other combinations in the
            other.
        shared_runs: Runs behind both: then they err alike, and differ less than their sigmas say.
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
        """Second minus first, in standard deviations of that difference, shape (m,)."""
        sigma = np.hypot(self.first_sigma, self.second_sigma)
        return np.asarray((self.second - self.first) / sigma)

    @property
    def limit_sigmas(self) -> float:
        """The largest difference that noise explains."""
        return float(-ndtri(CHANCE / (2.0 * len(self.names))))

    @property
    def worst(self) -> int:
        """The parameter that differs most."""
        return int(np.argmax(np.abs(self.sigmas)))

    @property
    def agree(self) -> bool:
        """Whether noise explains every difference."""
        return bool(np.abs(self.sigmas).max() <= self.limit_sigmas)


def compare_estimates(first: Estimate, second: Estimate) -> EstimateDifference:
    """Compare two estimates.

    Args:
        first, second: Of robots with the same joints; their models may differ.

    Raises:
        EstimationError: The joints differ, or no parameter is in both.
    """
    joints = first.robot.joint_names
    if second.robot.joint_names != joints:
        raise EstimationError(
            f"the first model is of {', '.join(joints)}, the second of"
            f" {', '.join(second.robot.joint_names)}: these are two robots",
            code="RID-ROBOT-OTHER",
        )
    one, other = _entries(first), _entries(second)
    both = [key for key in one if key in other]
    if not both:
        raise EstimationError(
            "no parameter is in both models: identify both with the same --model and robot file",
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
    """Return value, sigma and unit of each parameter, by its name and what it stands for."""
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
