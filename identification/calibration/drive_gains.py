"""`DriveGains`: ratio of true to measured torque of each drive, from a load of known mass.

If all torques are too large by one common factor, a robot that is too heavy by this factor explains
them equally well. A weighed load determines this factor. The differences between the joints follow
from the parameters that the joints' equations share.

The usual equation is g tau - Phi beta = Phi_L theta_L. It uses the measured torque, with its noise,
as a regressor. This has two known consequences:
- Least squares underestimates the gains, and can make them negative.
- Total least squares lets unmodelled torque change the gains in the same way; it needs long and
  clean recordings (Gautier and Briot 2014).

Here the noise stays on the torque: tau = (Phi beta + Phi_L theta_L) / g + noise. This equation is
bilinear, and is solved by Gauss-Newton.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import ndtr

from config.arrays import FloatArray, freeze
from config.errors import EstimationError
from identification.equations.time_domain import TimeRun, joint_equations
from identification.estimation.estimate import Estimate
from identification.regression.intervals import Cluster, jackknife
from identification.regression.least_squares import Solution, Triangle, solve

ITERATIONS: Final = 50
SETTLED: Final = 1e-6
SIGNIFICANT_P: Final = 0.01
MASS: Final = "mL"
PLAUSIBLE_GAINS: Final = (0.7, 1.4)
ALIKE: Final = 1.3
COMMON_FACTORS: Final = {
    1000.0: "grams were given as kilograms",
    0.001: "tonnes were given as kilograms",
    9.81: "newtons were given as kilograms",
    2.2: "pounds were given as kilograms",
    2.0: "the load has half of the stated mass",
    0.5: "the load has twice the stated mass",
}


@dataclass(frozen=True, eq=False)
class DriveGains:
    """True torque over measured torque of each joint.

    Attributes:
        joint_names: The joints.
        values, sigma: Shape (n,). Gains and their cluster-robust standard deviations; 1 if the
            torque constant is right.
        covariance: Shape (n, n). Covariance of the gains; the error of the load's mass correlates
            them.
    """

    joint_names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        freeze(self, EstimationError, (n,), "values")
        freeze(self, EstimationError, (n, n), "covariance")

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations, shape (n,)."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance)))

    @property
    def wrong(self) -> tuple[bool, ...]:
        """For each joint: True if its gain differs from 1 by more than chance (Bonferroni)."""
        deviation = np.abs(self.values - 1.0) / self.sigma
        chance = 2.0 * len(self.values) * ndtr(-deviation)
        return tuple((chance < SIGNIFICANT_P).tolist())

    def require_plausible(self, mass_kg: float) -> None:
        """Refuse implausible gains, and name the probable mistake.

        Args:
            mass_kg: The mass of the load as stated by the user.

        Raises:
            EstimationError: A gain is not within `PLAUSIBLE_GAINS`.
        """
        low, high = PLAUSIBLE_GAINS
        bad = [j for j, gain in enumerate(self.values) if not low <= gain <= high]
        if not bad:
            return
        bad_gains = ", ".join(f"{self.joint_names[j]} {self.values[j]:.3g}" for j in bad)
        common = float(np.median(self.values))
        spread = np.exp(np.abs(np.log(self.values / common)))
        if (spread < ALIKE).all():
            factor = min(COMMON_FACTORS, key=lambda each: abs(np.log(common / each)))
            near = abs(np.log(common / factor)) < np.log(ALIKE)
            mistake = (
                f"all by the same factor, as if the load had {mass_kg / common:.3g} kg instead of"
                f" {mass_kg:g} kg"
                + (f" ({COMMON_FACTORS[factor]})" if near else "")
                + ": state the load's mass in kg (--load-mass), or correct all torque constants by"
                " this factor"
            )
        else:
            mistake = (
                "not all by the same factor, so the load's mass is not the cause: correct the"
                " torque constant or gear ratio of these joints, or move them more"
            )
        raise EstimationError(
            f"drive gains outside {low} to {high}: {bad_gains}; {mistake}",
            code="RID-GAINS-IMPLAUSIBLE",
        )

    def sentences(self) -> list[str]:
        """Return one sentence for each joint."""
        found = []
        for name, value, sigma, wrong in zip(
            self.joint_names, self.values, self.sigma, self.wrong, strict=True
        ):
            words = (
                "multiply the joint's torque constant by this factor"
                if wrong
                else "no error of the torque constant is visible"
            )
            found.append(f"{name}: drive gain {value:.3f} ± {2.0 * sigma:.2g} (2σ): {words}")
        return found


def drive_gains(
    estimate: Estimate, runs: tuple[TimeRun, ...], mass_kg: float, mass_sigma_kg: float
) -> DriveGains:
    """Estimate the gains of all drives from runs with and without a weighed load.

    Args:
        estimate: Estimate from the same runs; its model has a payload, of which only the mass is
            known.
        runs: The recordings, some with the load.
        mass_kg, mass_sigma_kg: Mass of the load, and the scales' standard deviation.

    Raises:
        EstimationError: The model has no payload or has gear losses, the torques do not depend on
            the load's mass by itself, a mass or its deviation is not positive, or the motion does
            not determine a gain.
    """
    base, model = estimate.base, estimate.model
    if "payload" not in model.parameter_groups:
        raise EstimationError(
            "drive gains need runs with and without the weighed load: name the runs with the"
            " load (--loaded)",
            code="RID-PAYLOAD-RUNS",
        )
    if MASS not in base.names:
        raise EstimationError(
            f"the torques of {', '.join(model.joint_names)} show the load's mass only multiplied by"
            " its distance from a joint axis, so a weighed mass does not determine drive gains:"
            " leave --load-mass out, or record more joints of the robot, whose axes are not"
            " parallel",
            code="RID-LOAD-MASS-HIDDEN",
        )
    if model.transmission.losses:
        raise EstimationError(
            "drive gains need friction that does not depend on the load: remove the friction"
            " term `load` and the gear efficiencies from the model",
            code="RID-MODEL-LOAD-FRICTION",
        )
    if mass_kg <= 0.0 or mass_sigma_kg <= 0.0:
        raise EstimationError(
            f"the mass of the load ({mass_kg:g} kg) and its standard deviation ({mass_sigma_kg:g}"
            " kg) must be positive",
            code="RID-OPTION-RANGE",
        )
    n, b, standstill = model.chain.n, len(base), estimate.standstill_rad_s
    triangles = [Triangle.empty(b) for _ in range(n)]
    for rows in joint_equations(model, base, runs, standstill):
        triangles = [t.add(*equations) for t, equations in zip(triangles, rows, strict=True)]
    scales = _Scales(
        names=(*base.names, *(f"the drive gain of {name}" for name in model.joint_names)),
        factors=tuple(t.factor for t in triangles),
        rows=tuple(t.rows for t in triangles),
        mass=base.names.index(MASS),
        mass_kg=mass_kg,
        mass_sigma_kg=mass_sigma_kg,
    )
    values, shares, solution, sigma = scales.fit(estimate.values)

    def cluster(rows: list[tuple[FloatArray, FloatArray]]) -> Cluster:
        parts = [
            scales.rows_of(j, matrix, rhs, values, shares) for j, (matrix, rhs) in enumerate(rows)
        ]
        matrix = np.vstack([part[0] / s for part, s in zip(parts, sigma, strict=True)])
        return Cluster.of(
            matrix, np.concatenate([part[1] / s for part, s in zip(parts, sigma, strict=True)])
        )

    stretches = joint_equations(model, base, runs, standstill)
    covariance = jackknife(solution.information, (cluster(rows) for rows in stretches)).quoted
    # No cluster contains the uncertainty of the load's mass: it is added to the covariance.
    to_mass = solution.covariance[b:, scales.mass] / mass_sigma_kg
    of_shares = covariance[b:, b:] + np.outer(to_mass, to_mass)
    gains = 1.0 / shares
    return DriveGains(
        joint_names=model.joint_names,
        values=gains,
        covariance=of_shares * np.outer(gains**2, gains**2),
    )


@dataclass(frozen=True, eq=False)
class _Scales:
    """Equations tau_j = s_j Phi_j x + noise of the joints j, with s_j = 1 / gain.

    x are the base parameters; the load's mass is a known one.
    """

    names: tuple[str, ...]
    factors: tuple[FloatArray, ...]
    rows: tuple[int, ...]
    mass: int
    mass_kg: float
    mass_sigma_kg: float

    def fit(self, start: FloatArray) -> tuple[FloatArray, FloatArray, Solution, FloatArray]:
        """Return x, s, the last Gauss-Newton step's solution, and each joint's RMS residual."""
        x, s = (
            start * (self.mass_kg / start[self.mass]),
            np.full(len(self.factors), start[self.mass] / self.mass_kg),
        )
        if s[0] <= 0.0:
            raise EstimationError(
                "the estimated mass of the load is not positive: check which runs carried the load",
                code="RID-PAYLOAD-RUNS",
            )
        n, b = len(self.factors), len(x)
        for _ in range(ITERATIONS):
            triangles, sigma = [], []
            for j, factor in enumerate(self.factors):
                matrix, misfit = self.rows_of(j, factor[:, :-1], factor[:, -1], x, s)
                sigma.append(max(np.sqrt(np.sum(misfit**2) / max(self.rows[j], 1)), 1e-150))
                triangles.append(Triangle.empty(b + n).add(matrix, misfit, self.rows[j]))
            weighed = np.zeros((1, b + n))
            weighed[0, self.mass] = 1.0
            error = np.array([self.mass_kg - x[self.mass]])
            triangles.append(Triangle.empty(b + n).add(weighed, error))
            weights = [*(1.0 / np.array(sigma)), 1.0 / self.mass_sigma_kg]
            solution = solve(triangles, weights, self.names)
            step = solution.values
            x, s = x + step[:b], s + step[b:]
            if (s <= 0.0).any():
                worst = self.names[b + int(np.argmin(s))]
                raise EstimationError(
                    f"the motion does not determine {worst}: use a larger motion or a heavier load",
                    code="RID-MOTION-UNINFORMATIVE",
                )
            if np.all(np.abs(step[b:]) < SETTLED):
                return x, s, solution, np.array(sigma)
        raise EstimationError(
            "the drive gains do not converge: use a larger motion or a heavier load",
            code="RID-MOTION-UNINFORMATIVE",
        )

    def rows_of(
        self, joint: int, matrix: FloatArray, rhs: FloatArray, x: FloatArray, s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the equations of one joint, linearised about x and s: columns and residual."""
        predicted = matrix @ x
        slopes = np.zeros((len(rhs), len(x) + len(s)))
        slopes[:, : len(x)] = s[joint] * matrix
        slopes[:, len(x) + joint] = predicted
        return slopes, rhs - s[joint] * predicted
