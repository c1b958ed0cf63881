"""Checks an estimated payload before a controller uses it, and estimates it from each run."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

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
    "The model does not explain the torque of this axis, so the payload is not reliable: look for"
    " swapped torques of two axes, a wrong sign or torque constant, or a wrong robot file."
)
CONTRADICTED: Final = (
    "The recordings contradict this known value: look for grams given as kilograms, millimetres as"
    " metres, or a different payload on the scales and on the flange."
)
LEFT_ON: Final = (
    "According to the model of the robot, something was on the flange in the runs without payload,"
    " and is missing from the payload. Remove it and record these runs again."
)
NO_BODY: Final = (
    "A heavy object on the flange in the runs without payload is subtracted from the payload, and"
    " the rest may be physically impossible: check the flange first, then the torque constants."
)


HEAVY: Final = (
    "A payload should be lighter than the robot's rated payload and than the robot itself: look"
    " for a wrong torque constant, currents used as torques, or a wrong gear ratio. If the mass is"
    " right, set rated_payload_kg in the robot file."
)

ROUNDED = (
    "Rounding errors of the positions make inertias too small: record positions with more digits,"
    " or velocities as well; or use a lower --band."
)


@dataclass(frozen=True)
class PayloadCheck:
    """One line of a verdict: a value, a limit, and their required relation.

    `advice` is the advice if the check fails; it is not stored in files.
    """

    text: str
    value: float
    relation: str
    limit: float
    unit: str = ""
    advice: str = ""

    @property
    def passed(self) -> bool:
        """True if the limit is satisfied."""
        kept = self.value <= self.limit if self.relation == "≤" else self.value >= self.limit
        return bool(kept)


class Reached(NamedTuple):
    """A value and its upper limit, both in `unit`."""

    text: str
    value: float
    limit: float
    unit: str

    @property
    def share(self) -> float:
        """Value relative to the limit: at most 1 if the limit is satisfied."""
        if self.limit == 0.0:
            return 0.0 if self.value == 0.0 else math.inf
        return self.value / self.limit

    def or_absolute(
        self, text: str, value: float, limit: float | None, unit: str, advice: str = ""
    ) -> PayloadCheck:
        """Return the check of this relative limit and of an absolute alternative.

        The returned check uses the limit that leaves more margin. If there are two limits, the
        check's text names the one that is used, and the other one.

        Args:
            text: Name of the absolute value.
            value: The absolute value, in `unit`.
            limit: Its limit, in `unit`; None if there is none.
            unit: Unit of the absolute value.
            advice: Advice if no limit is satisfied.
        """
        if limit is None:
            return PayloadCheck(self.text, self.value, "≤", self.limit, self.unit, advice)
        absolute = Reached(text, value, limit, unit)
        is_absolute = absolute.share <= self.share
        used, other = (absolute, self) if is_absolute else (self, absolute)
        said = (
            f"{used.text}, {'absolute' if is_absolute else 'relative'} limit (alternative:"
            f" {other.value:.3g} {other.unit}, limit {other.limit:.3g} {other.unit})"
        )
        return PayloadCheck(said, used.value, "≤", used.limit, used.unit, advice)


@dataclass(frozen=True, eq=False)
class PayloadResult:
    """A payload, and the verdict on it.

    Attributes:
        estimate: The payload.
        checks: The checks of the verdict.
    """

    estimate: PayloadEstimate
    checks: tuple[PayloadCheck, ...]

    @property
    def passed(self) -> bool:
        """True if every limit is satisfied, and there is at least one."""
        return bool(self.checks) and all(line.passed for line in self.checks)


@dataclass(frozen=True, eq=False)
class Repeats:
    """Estimates of the same payload from each run separately.

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
        """Scatter over reported standard deviation for all values together; near 1 if they agree.

        Fixed values do not scatter and are left out. The ratio is 0 if all values are fixed.
        """
        free = (self.sigma > 0.0).all(axis=0)
        deviation = (self.values - self.values.mean(axis=0))[:, free] / self.sigma[:, free]
        freedom = max((len(self.values) - 1) * int(free.sum()), 1)
        return float(np.sqrt(np.sum(deviation**2) / freedom))


def check_payload(
    estimate: PayloadEstimate,
    limits: PayloadLimits,
    repeats: Repeats | None = None,
    left_on: tuple[float, float] | None = None,
) -> tuple[PayloadCheck, ...]:
    """Compare an estimate with limits.

    If the motion does not determine all ten parameters, only their number, the known values and the
    residuals are checked.

    Args:
        estimate: The payload.
        limits: Limits of the verdict.
        repeats: Estimates from each run separately, if there are several runs.
        left_on: Mass on the flange in the runs without payload, and its standard deviation, from
            `mass_left_on_flange`.
    """
    rank = PayloadCheck(
        "independent parameters that the motion determines", estimate.rank, "≥", PARAMETERS_PER_LINK
    )
    fit = [
        Reached(
            f"residual of {joint.name} (RMS, relative to its torque)",
            100.0 * float(share),
            limits.residual_percent,
            "%",
        ).or_absolute(
            f"residual of {joint.name} (RMS)",
            float(residual),
            limits.residual_nm,
            joint.torque_unit,
            BAD_FIT,
        )
        for joint, share, residual in zip(
            estimate.robot.joints, estimate.residual_share, estimate.residual_nm, strict=True
        )
    ]
    agreed = [
        PayloadCheck(
            f"known value {known.name} = {known.value:g}"
            f" {REPORTED_UNITS[REPORTED.index(known.name)]}: distance from the recordings' result",
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
        text = "mass on the flange in the runs without payload, according to the model"
        limit = LARGEST_CONTRADICTION * sigma
        agreed.append(PayloadCheck(text, abs(mass), "≤", limit, "kg", LEFT_ON))
    if not rank.passed:
        return (rank, *agreed, *fit)
    two_sigma = 2.0 * estimate.sigma
    heaviest = HeaviestPayload.of(estimate.robot)
    if heaviest is not None:
        share = 100.0 * float(estimate.reported[0] - two_sigma[0]) / heaviest.mass_kg
        text = (
            f"mass of the payload (lower end of the 2σ interval), relative to {heaviest.source}"
            f" ({heaviest.mass_kg:.4g} kg)"
        )
        agreed.append(PayloadCheck(text, share, "≤", 100.0, "%", HEAVY))
    lines = [
        rank,
        *agreed,
        *fit,
        Reached(
            "interval of the mass (2σ)",
            100.0 * float(two_sigma[0] / abs(estimate.reported[0])),
            limits.mass_percent,
            "%",
        ).or_absolute("interval of the mass (2σ)", float(two_sigma[0]), limits.mass_kg, "kg"),
        PayloadCheck(
            "interval of the centre of gravity (2σ, worst coordinate)",
            1e3 * float(two_sigma[1:4].max()),
            "≤",
            limits.centre_mm,
            "mm",
        ),
        Reached(
            "interval of the inertia (2σ, worst element, relative to the largest about the flange)",
            100.0 * float(two_sigma[4:].max()) / largest_moment(estimate),
            limits.inertia_percent,
            "%",
        ).or_absolute(
            "interval of the inertia (2σ, worst element)",
            float(two_sigma[4:].max()),
            limits.inertia_kg_m2,
            "kg m²",
        ),
        PayloadCheck(
            "probability that a physically consistent body explains the data",
            estimate.consistent[1],
            "≥",
            SMALLEST_P,
            advice=NO_BODY,
        ),
    ]
    if repeats is not None:
        lines.append(
            PayloadCheck(
                f"scatter between {len(repeats.values)} runs, divided by the reported standard"
                " deviation",
                repeats.ratio,
                "≤",
                LARGEST_SCATTER,
            )
        )
    return tuple(lines)


def estimate_each_run(
    robot: RobotDescription, runs: MeasuredRuns, how: PayloadOptions
) -> Repeats | None:
    """Estimate the payload from each run with it separately; None if there is only one such run.

    Raises:
        EstimationError: A single run does not determine the payload.
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
