"""`CrossCheck`: the same parameters by another way of thinking, held against an estimate.

Each of the other methods (energies, joint after joint, a Kalman filter) is less precise, but makes
other mistakes. Where one contradicts the estimate, something that both take for granted differently
is wrong, and which method it is tells what.
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
    """A way to estimate that differs from the estimate's own."""

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
        "look at what it does without: accelerations (delays, filters, the band) and"
        " forces that a motion there and back takes twice"
    ),
    CrossMethod.LINK_BY_LINK: (
        "some joint's torque or geometry is off: torque constants, gear ratios and"
        " the rows of the robot file, or friction that the model lacks"
    ),
    CrossMethod.KALMAN: (
        "the simulated robot moves otherwise than the real one: something that moves is"
        " missing in the model, or positions and torques are not of the same instant"
    ),
}


_BY_EQUATIONS: Final = frozenset({CrossMethod.LINK_BY_LINK})
"""Methods with the joints' torque equations, whose columns pass the channel of the torque.

A work or a simulation needs the torque that acted, and the recorded torque is never deconvolved.
"""


@dataclass(frozen=True, eq=False)
class CrossCheck:
    """What one other method finds.

    Attributes:
        values, sigma: Shape (b,). Its base parameters and their standard deviations; empty where it
            cannot be used.
        difference: Shape (b,). Its values less the estimate's, over both standard deviations
            together.
        worst: The parameter that differs most, in words.
        trouble: Why the method cannot be used here; empty where it can.
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
        """Whether it agrees with the estimate; None where it cannot be used."""
        return None if self.trouble else self.p_value >= SIGNIFICANT_P

    @property
    def sentence(self) -> str:
        """The finding in words."""
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
        runs: The recordings that it comes from.
    """
    for method in CrossMethod:
        yield check(method, estimate, runs)


def check(method: CrossMethod, estimate: Estimate, runs: tuple[TimeRun, ...]) -> CrossCheck:
    """Estimate by one other method.

    The two estimates come from the same data, so their difference scatters less than the sum of
    the variances says: the test is on the safe side of agreement.
    """
    try:
        if method not in _BY_EQUATIONS:
            _refuse_channels(runs)
        values, covariance = _FUNCTIONS[method](estimate, runs)
    except EstimationError as error:
        nothing = np.zeros(0)
        return CrossCheck(method, nothing, nothing, nothing, "", str(error))
    sigma = np.sqrt(np.diagonal(covariance))
    combined = np.sqrt(sigma**2 + estimate.sigma**2)
    difference = (values - estimate.values) / np.maximum(combined, 1e-300)
    worst = estimate.base.expressions[int(np.argmax(np.abs(difference)))]
    return CrossCheck(method, values, sigma, difference, worst)


def _refuse_channels(runs: tuple[TimeRun, ...]) -> None:
    """Refuse recordings whose torque is late or was filtered."""
    for run in runs:
        channel = run.signals.channel
        if channel is not None and channel.changes:
            raise EstimationError(
                f"the recorded torque passed a channel ({channel.kind}), and this method needs the"
                " torque that acted: switch the filter of the drives off, or correct the time of"
                " the torques in the recording",
                code="RID-CROSS-CHECK-CHANNEL",
            )
