"""`PeriodicProblem`: least squares on the DFT bins of averaged periods."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.arrays import FloatArray
from acquisition.periods import PeriodAverage
from config.errors import EstimationError
from dynamics.robot_model import RobotModel
from identification.base_parameters import BaseParameters
from identification.bin_equations import BinEquations, bin_equations
from identification.estimate import Weighting
from identification.intervals import jackknife
from identification.least_squares import Solution, Triangle, solve
from identification.nonlinear import step_prior
from identification.prior import PriorRows
from identification.robust import huber_weights
from identification.white_equations import WhiteEquations, bin_clusters, whiten

REWEIGHTINGS = 20


@dataclass(frozen=True, eq=False)
class PeriodicFit:
    """The solution for one set of columns, and the whitened equations behind it."""

    solution: Solution
    white: tuple[tuple[WhiteEquations, ...], ...]

    @property
    def residual_nm(self) -> FloatArray:
        """RMS residual of each joint, shape (n,) [N m or N]."""
        values = self.solution.values
        power = [
            [np.sum((part.residual(values) * part.sigma) ** 2) for part in parts]
            for parts in self.white
        ]
        return np.asarray(np.sqrt(np.mean(power, axis=0)))

    @property
    def noise_nm(self) -> FloatArray:
        """RMS that the noise alone would leave, shape (n,) [N m or N]."""
        power = [
            [np.sum(part.sigma**2) * part.rows / len(part.rhs) for part in parts]
            for parts in self.white
        ]
        return np.asarray(np.sqrt(np.mean(power, axis=0)))


@dataclass(frozen=True, eq=False)
class PeriodicProblem:
    """Averaged periods, and how their rows are weighted.

    `inertia` (averages, n, n) is the size of the joint-space inertia, through which the noise of
    the positions becomes torque; zero before it is known.
    """

    base: BaseParameters
    averages: tuple[PeriodAverage, ...]
    payload: tuple[bool, ...]
    band_hz: float
    standstill_rad_s: float
    weighting: Weighting
    prior: PriorRows
    inertia: FloatArray

    def __post_init__(self) -> None:
        if len(self.payload) != len(self.averages):
            raise EstimationError(
                f"payload says of {len(self.payload)} runs whether they carry it, there are"
                f" {len(self.averages)}"
            )

    def equations(self, model: RobotModel, standard: FloatArray | None) -> tuple[BinEquations, ...]:
        """Return the equations of every average; `standard` as in `torque_columns`."""
        return tuple(
            bin_equations(
                model,
                self.base,
                average,
                band_hz=self.band_hz,
                standstill_rad_s=self.standstill_rad_s,
                payload=loaded,
                standard=standard,
            )
            for average, loaded in zip(self.averages, self.payload, strict=True)
        )

    def fit(
        self, model: RobotModel, standard: FloatArray | None, equations: tuple[BinEquations, ...]
    ) -> PeriodicFit:
        """Solve the equations.

        Raises
        ------
        EstimationError
            The motion does not show the parameters.
        """
        white = tuple(
            whiten(each, inertia, uniform=self.weighting == "ls")
            for each, inertia in zip(equations, self.inertia, strict=True)
        )
        names = (*self.base.names, *(model.shape_names if standard is not None else ()))
        known = [self.prior.triangle(len(names))]
        if standard is not None:
            known.append(step_prior(model, len(self.base)))
        fit = _solve(white, known, names)
        if self.weighting != "huber":
            return fit
        for _ in range(REWEIGHTINGS):
            values = fit.solution.values
            held_down = tuple(
                tuple(part.reweighted(huber_weights(part.residual(values))) for part in parts)
                for parts in white
            )
            better = _solve(held_down, known, names)
            change = np.abs(better.solution.values - values)
            fit = better
            if np.all(change <= 1e-3 * np.sqrt(np.diagonal(fit.solution.covariance))):
                break
        return fit

    def honest_covariance(self, fit: PeriodicFit) -> FloatArray:
        """Return the covariance of the solution that coloured residuals leave."""
        return jackknife(fit.solution.information, bin_clusters(fit.white, fit.solution.values))


def _solve(
    white: tuple[tuple[WhiteEquations, ...], ...], known: list[Triangle], names: tuple[str, ...]
) -> PeriodicFit:
    triangles = [
        Triangle.empty(len(names)).add(part.matrix, part.rhs, part.rows)
        for parts in white
        for part in parts
    ]
    solution = solve([*triangles, *known], [1.0] * (len(triangles) + len(known)), names)
    return PeriodicFit(solution, white)
