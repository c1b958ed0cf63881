"""Whether a payload's estimate is good enough to be given to a controller, and repeats of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.choices import REPORTED, PayloadLimits
from identification.consistency.consistency_test import SMALLEST_P
from identification.payload.body import REPORTED_UNITS
from identification.payload.estimate import PayloadEstimate
from identification.payload.findings import largest_moment
from identification.payload.measured_runs import MeasuredRuns
from identification.payload.procedures import PayloadOptions, identify_payload
from identification.payload.rating import HeaviestPayload

LARGEST_SCATTER: Final = 3.0
LARGEST_CONTRADICTION: Final = 4.0
BAD_FIT: Final = (
    "An axis whose torque is not explained carries no payload that can be trusted: look for torques"
    " of two axes that are swapped, a sign, a torque constant, or a robot file of another robot."
)
CONTRADICTED: Final = (
    "What is known is held to, and the recordings contradict it: look for grams given as kilograms,"
    " millimetres as metres, or another payload on the scales than on the flange."
)
LEFT_ON: Final = (
    "By the model of the robot, something hung on the flange in the runs without payload: it is"
    " missing from the payload. Take it off and record them again."
)
NO_BODY: Final = (
    "What hung on the flange in the unloaded runs is subtracted from the payload, and leaves a body"
    " that cannot exist where it was heavy: look there first, then for a wrong torque constant."
)


HEAVY: Final = (
    "A robot carries less than its rating, and than it weighs: look for a wrong torque constant,"
    " for currents taken as torques, or for a wrong gear. State rated_payload_kg in the robot file"
    " if it is right."
)


@dataclass(frozen=True)
class PayloadCheck:
    """One line of a verdict: what was reached, how it must stand to its limit.

    `advice` says what to look for where it fails; it is not kept in files.
    """

    text: str
    value: float
    relation: str
    limit: float
    unit: str = ""
    advice: str = ""

    @property
    def passed(self) -> bool:
        """Whether the limit is kept."""
        kept = self.value <= self.limit if self.relation == "≤" else self.value >= self.limit
        return bool(kept)


@dataclass(frozen=True, eq=False)
class PayloadResult:
    """A payload, and the verdict on it.

    Attributes:
        estimate: The payload.
        checks: What it was held against.
    """

    estimate: PayloadEstimate
    checks: tuple[PayloadCheck, ...]

    @property
    def passed(self) -> bool:
        """Whether every limit was kept, and there was one."""
        return bool(self.checks) and all(line.passed for line in self.checks)

    @property
    def fits(self) -> bool:
        """Whether the residual of every axis kept its limit."""
        return all(line.passed for line in self.checks if line.advice == BAD_FIT)


@dataclass(frozen=True, eq=False)
class Repeats:
    """The same payload from each run that carried it alone.

    Attributes:
        values, sigma: Shape (runs, 10). `REPORTED` and their standard deviations, run by run.
    """

    values: FloatArray
    sigma: FloatArray

    @property
    def scatter(self) -> FloatArray:
        """Standard deviation between the runs, shape (10,)."""
        return np.asarray(self.values.std(axis=0, ddof=1))

    @property
    def ratio(self) -> float:
        """Scatter over quoted standard deviation, all together; near 1 where these hold.

        Values that are held do not scatter, and do not count; 0 where all are held.
        """
        free = (self.sigma > 0.0).all(axis=0)
        deviation = (self.values - self.values.mean(axis=0))[:, free] / self.sigma[:, free]
        freedom = max((len(self.values) - 1) * int(free.sum()), 1)
        return float(np.sqrt(np.sum(deviation**2) / freedom))


def checks(
    estimate: PayloadEstimate,
    limits: PayloadLimits,
    repeats: Repeats | None = None,
    left_on: tuple[float, float] | None = None,
) -> tuple[PayloadCheck, ...]:
    """Hold an estimate against limits.

    Args:
        estimate: The payload.
        limits: What it must keep.
        repeats: The same from each run alone, where there were several.
        left_on: Mass and standard deviation of what `left_on_flange` finds.
    """
    rank = PayloadCheck(
        "independent parameters that the motion shows", estimate.rank, "≥", PARAMETERS_PER_LINK
    )
    names, shares = estimate.robot.joint_names, estimate.residual_share.tolist()
    fit = [
        PayloadCheck(
            f"residual of {joint} (RMS, of its torque)",
            100.0 * share,
            "≤",
            limits.residual_percent,
            "%",
            BAD_FIT,
        )
        for joint, share in zip(names, shares, strict=True)
    ]
    agreed = [
        PayloadCheck(
            f"{known.name} = {known.value:g} {REPORTED_UNITS[REPORTED.index(known.name)]} as known,"
            " from what the recordings say",
            off,
            "≤",
            LARGEST_CONTRADICTION,
            "σ",
            CONTRADICTED,
        )
        for known, off in zip(estimate.known, estimate.contradictions, strict=True)
    ]
    if left_on is not None:
        mass, sigma = left_on
        said = "mass on the flange in the runs without payload, by the model"
        limit = LARGEST_CONTRADICTION * sigma
        agreed.append(PayloadCheck(said, abs(mass), "≤", limit, "kg", LEFT_ON))
    if not rank.passed:
        return (rank, *agreed, *fit)
    two_sigma = 2.0 * estimate.sigma
    heaviest = HeaviestPayload.of(estimate.robot)
    if heaviest is not None:
        share = 100.0 * float(estimate.reported[0] - two_sigma[0]) / heaviest.mass_kg
        said = f"mass of the payload, as a share of {heaviest.source} ({heaviest.mass_kg:.4g} kg)"
        agreed.append(PayloadCheck(said, share, "≤", 100.0, "%", HEAVY))
    lines = [
        rank,
        *agreed,
        *fit,
        PayloadCheck(
            "interval of the mass (2σ)",
            100.0 * float(two_sigma[0] / abs(estimate.reported[0])),
            "≤",
            limits.mass_percent,
            "%",
        ),
        PayloadCheck(
            "interval of the centre of gravity (2σ, worst coordinate)",
            1e3 * float(two_sigma[1:4].max()),
            "≤",
            limits.centre_mm,
            "mm",
        ),
        PayloadCheck(
            "interval of the inertia (2σ, worst, of the largest about the flange)",
            100.0 * float(two_sigma[4:].max()) / largest_moment(estimate),
            "≤",
            limits.inertia_percent,
            "%",
        ),
        PayloadCheck(
            "probability that a body that can exist explains the data",
            estimate.consistent[1],
            "≥",
            SMALLEST_P,
            advice=NO_BODY,
        ),
    ]
    if repeats is not None:
        lines.append(
            PayloadCheck(
                f"scatter between {len(repeats.values)} runs over the quoted standard deviation",
                repeats.ratio,
                "≤",
                LARGEST_SCATTER,
            )
        )
    return tuple(lines)


def repeated(robot: RobotDescription, runs: MeasuredRuns, how: PayloadOptions) -> Repeats | None:
    """Estimate the payload from each run that carried it alone; None where there is only one.

    Raises:
        EstimationError: A run alone does not tell the payload.
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
