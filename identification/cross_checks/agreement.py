"""`CrossCheck`: the same parameters from another method, compared with an estimate.

Each of the other methods (energies, joint after joint, a Kalman filter) is less precise, but makes
different assumptions. If a method contradicts the estimate, an assumption in which the two differ
is probably wrong; the method indicates which assumption.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from scipy.special import ndtr

from config.arrays import FloatArray, freeze
from config.errors import EstimationError
from identification.cross_checks.energy import estimate_by_energy
from identification.cross_checks.kalman import estimate_by_kalman_filter
from identification.cross_checks.link_by_link import estimate_link_by_link
from identification.equations.time_domain import TimeRun
from identification.estimation.estimate import Estimate

SIGNIFICANT_P: Final = 0.01


class CrossMethod(StrEnum):
    """An estimation method that differs from the estimate's own."""

    ENERGY = "energies"
    LINK_BY_LINK = "joint after joint"
    KALMAN = "Kalman filter"


_FUNCTIONS: Final[dict[CrossMethod, Callable[..., tuple[FloatArray, FloatArray]]]] = {
    CrossMethod.ENERGY: estimate_by_energy,
    CrossMethod.LINK_BY_LINK: estimate_link_by_link,
    CrossMethod.KALMAN: estimate_by_kalman_filter,
}
_SUSPECTS: Final = {
    CrossMethod.ENERGY: (
        "this method does not use accelerations: check them (delays, filters, the band), and check"
        " forces whose work does not cancel over a motion in both directions"
    ),
    CrossMethod.LINK_BY_LINK: (
        "the torque or geometry of a joint is wrong: check torque constants, gear ratios, the"
        " rows of the robot file, and friction that the model lacks"
    ),
    CrossMethod.KALMAN: (
        "the simulated robot moves differently from the real one: the model lacks a moving part,"
        " or positions and torques are not sampled at the same instant"
    ),
}


_BY_EQUATIONS: Final = frozenset({CrossMethod.LINK_BY_LINK})
"""Methods that can use a torque that was recorded with a delay or through a filter.

These methods apply the same delay and filter (the torque channel) to the columns of the joints'
equations. The other methods, by energy or by simulation, need the torque that acted at the joint.
They refuse such recordings, because a recorded torque is never deconvolved.
"""


@dataclass(frozen=True, eq=False)
class CrossCheck:
    """Result of one other method.

    Attributes:
        values, sigma: Shape (b,). The method's base parameters and their standard deviations; empty
            if the method cannot be used.
        difference: Shape (b,). The method's values minus the estimate's, divided by the combined
            standard deviation.
        worst: Expression of the parameter that differs most.
        trouble: Reason why the method cannot be used; empty if it can.
    """

    method: CrossMethod
    values: FloatArray
    sigma: FloatArray
    difference: FloatArray
    worst: str
    trouble: str = ""

    def __post_init__(self) -> None:
        freeze(self, EstimationError, (None,), "values", "sigma", "difference")

    @property
    def largest(self) -> float:
        """The largest difference, in standard deviations."""
        return 0.0 if self.trouble else float(np.abs(self.difference).max())

    @property
    def p_value(self) -> float:
        """Probability of so large a difference among so many parameters by chance (Bonferroni)."""
        return min(1.0, 2.0 * len(self.difference) * float(ndtr(-self.largest)))

    @property
    def agrees(self) -> bool | None:
        """True if the method agrees with the estimate; None if it cannot be used."""
        return None if self.trouble else self.p_value >= SIGNIFICANT_P

    @property
    def sentence(self) -> str:
        """The method's agreement with the estimate, in one sentence."""
        name = f"{self.method[0].upper()}{self.method[1:]}"
        if self.trouble:
            return f"{name}: not checked: {self.trouble}"
        most = f"largest difference {self.largest:.1f} σ, at {self.worst}"
        if self.agrees:
            return f"{name}: agrees; {most}"
        return f"{name}: contradicts the estimate; {most}: {_SUSPECTS[self.method]}"


def cross_checks(estimate: Estimate, runs: tuple[TimeRun, ...]) -> Iterator[CrossCheck]:
    """Estimate by each of the other methods, one after the other.

    Args:
        estimate: The estimate to check.
        runs: The recordings of the estimate.
    """
    for method in CrossMethod:
        yield check_method(method, estimate, runs)


def check_method(method: CrossMethod, estimate: Estimate, runs: tuple[TimeRun, ...]) -> CrossCheck:
    """Estimate by one other method.

    Both estimates come from the same data, so that their difference scatters less than the sum of
    the variances suggests. Therefore the test reports false contradictions less often than its
    significance level.
    """
    try:
        if method not in _BY_EQUATIONS:
            _refuse_channels(runs)
        values, covariance = _FUNCTIONS[method](estimate, runs)
    except EstimationError as error:
        nothing = np.zeros(0)
        return CrossCheck(method, nothing, nothing, nothing, "", f"{error} [{error.refusal}]")
    sigma = np.sqrt(np.diagonal(covariance))
    combined = np.sqrt(sigma**2 + estimate.sigma**2)
    difference = (values - estimate.values) / np.maximum(combined, 1e-300)
    worst = estimate.base.expressions[int(np.argmax(np.abs(difference)))]
    return CrossCheck(method, values, sigma, difference, worst)


def _refuse_channels(runs: tuple[TimeRun, ...]) -> None:
    """Refuse recordings whose torque was delayed or filtered."""
    for run in runs:
        channel = run.signals.channel
        if channel is not None and channel.changes:
            raise EstimationError(
                f"the recorded torque was delayed or filtered ({channel.kind}), but this method"
                " needs the torque that acted at the joint: switch off the filter of the drives, or"
                " correct the time of the torques in the recording",
                code="RID-CROSS-CHECK-CHANNEL",
            )
