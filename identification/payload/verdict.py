"""Whether a payload's estimate is good enough to be given to a controller, and repeats of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.consistency.closest_robot import SMALLEST_P
from identification.payload.estimate import PayloadEstimate
from identification.payload.findings import inertia_size
from identification.payload.measured_runs import MeasuredRuns
from identification.payload.procedures import PayloadOptions, identify_payload

LARGEST_SCATTER: Final = 3.0


@dataclass(frozen=True)
class PayloadLimits:
    """How sure a payload must be: 2 sigma at most.

    Attributes
    ----------
    mass_percent : float
        Of the mass.
    centre_mm : float
        Of each coordinate of the centre of gravity.
    inertia_percent : float
        Of each moment and product of inertia, of the largest moment about the flange.
    """

    mass_percent: float = 5.0
    centre_mm: float = 10.0
    inertia_percent: float = 100.0


@dataclass(frozen=True)
class Check:
    """One line of a verdict: what was reached, how it must stand to its limit."""

    text: str
    value: float
    relation: str
    limit: float
    unit: str = ""

    @property
    def passed(self) -> bool:
        """Whether the limit is kept."""
        kept = self.value <= self.limit if self.relation == "≤" else self.value >= self.limit
        return bool(kept)


@dataclass(frozen=True, eq=False)
class PayloadResult:
    """A payload, and the verdict on it.

    Attributes
    ----------
    estimate : PayloadEstimate
        The payload.
    checks : tuple of Check
        What it was held against.
    """

    estimate: PayloadEstimate
    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Whether every limit was kept, and there was one."""
        return bool(self.checks) and all(line.passed for line in self.checks)


@dataclass(frozen=True, eq=False)
class Repeats:
    """The same payload from each run that carried it alone.

    Attributes
    ----------
    values, sigma : ndarray, shape (runs, 10)
        `REPORTED` and their standard deviations, run by run.
    """

    values: FloatArray
    sigma: FloatArray

    @property
    def scatter(self) -> FloatArray:
        """Standard deviation between the runs, shape (10,)."""
        return np.asarray(self.values.std(axis=0, ddof=1))

    @property
    def ratio(self) -> float:
        """Scatter over quoted standard deviation, all ten together; near 1 where these hold."""
        deviation = (self.values - self.values.mean(axis=0)) / self.sigma
        freedom = (len(self.values) - 1) * self.values.shape[1]
        return float(np.sqrt(np.sum(deviation**2) / freedom))


def checks(
    estimate: PayloadEstimate, limits: PayloadLimits, repeats: Repeats | None = None
) -> tuple[Check, ...]:
    """Hold an estimate against limits.

    Parameters
    ----------
    estimate : PayloadEstimate
        The payload.
    limits : PayloadLimits
        What it must keep.
    repeats : Repeats, optional
        The same from each run alone, where there were several.
    """
    rank = Check(
        "independent parameters that the motion shows", estimate.rank, "≥", PARAMETERS_PER_LINK
    )
    if not rank.passed:
        return (rank,)
    two_sigma = 2.0 * estimate.sigma
    lines = [
        rank,
        Check(
            "interval of the mass (2σ)",
            100.0 * float(two_sigma[0] / abs(estimate.reported[0])),
            "≤",
            limits.mass_percent,
            "%",
        ),
        Check(
            "interval of the centre of gravity (2σ, worst coordinate)",
            1e3 * float(two_sigma[1:4].max()),
            "≤",
            limits.centre_mm,
            "mm",
        ),
        Check(
            "interval of the inertia (2σ, worst, of the largest about the flange)",
            100.0 * float(two_sigma[4:].max()) / inertia_size(estimate),
            "≤",
            limits.inertia_percent,
            "%",
        ),
        Check(
            "probability that a body that can exist explains the data",
            estimate.consistent[1],
            "≥",
            SMALLEST_P,
        ),
    ]
    if repeats is not None:
        lines.append(
            Check(
                f"scatter between {len(repeats.values)} runs over the quoted standard deviation",
                repeats.ratio,
                "≤",
                LARGEST_SCATTER,
            )
        )
    return tuple(lines)


def repeated(robot: RobotDescription, runs: MeasuredRuns, how: PayloadOptions) -> Repeats | None:
    """Estimate the payload from each run that carried it alone; None where there is only one.

    Raises
    ------
    EstimationError
        A run alone does not tell the payload.
    """
    loaded = [i for i, carried in enumerate(runs.loaded) if carried]
    if len(loaded) < 2:
        return None
    others = [i for i, carried in enumerate(runs.loaded) if not carried]
    found = [identify_payload(robot, runs.part([*others, run]), how) for run in loaded]
    return Repeats(
        np.array([estimate.reported for estimate in found]),
        np.array([estimate.sigma for estimate in found]),
    )
