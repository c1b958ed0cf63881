"""`FittedSignals`: smoothed recordings with their fitted solution.

An `Estimate` is made from it. Its intervals cost more time than the solution, so that a
cross-validation, which only predicts torques, uses the fit without intervals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from identification.equations.time_domain import count_rows, time_runs
from identification.estimation.estimate import Estimate, position_range
from identification.estimation.fitted_periods import build_model
from identification.estimation.lossy_gears import separate_rotors
from identification.estimation.options import EstimationOptions
from identification.estimation.prior import prior_rows
from identification.estimation.smoothed_fit import (
    SmoothedFit,
    SmoothedProblem,
    fit_from,
    fit_with_nonlinear,
)
from identification.model.base_parameters import BaseParameters
from identification.model.known_loads import Bodies, known_values
from identification.model.options import ModelOptions
from identification.model.still_joints import JERK_SHARE, StillJoint
from identification.regression.intervals import covariance_at_least


@dataclass(frozen=True, eq=False)
class FittedSignals:
    """A problem and its solution.

    Attributes:
        options: The terms of the model, with the fitted nonlinear parameters.
        model: The model with these options.
        problem: The recordings and their weights.
        standard: Shape (p,). Point of the equations' linearisation; None if the model is linear.
        fit: The solution.
        still: The joints that no run moves.
    """

    robot: RobotDescription
    options: ModelOptions
    model: RobotModel
    problem: SmoothedProblem
    standard: FloatArray | None
    fit: SmoothedFit
    still: tuple[StillJoint, ...] = ()

    @property
    def base(self) -> BaseParameters:
        """The base parameters of the model."""
        return self.problem.base

    @property
    def values(self) -> FloatArray:
        """Values of the base parameters, shape (b,)."""
        return self.fit.solution.values[: len(self.base)]

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations of the solution, from residuals that count as white, shape (p,)."""
        return np.asarray(np.sqrt(np.diagonal(self.fit.solution.covariance)))

    @property
    def standard_values(self) -> FloatArray:
        """Standard parameters with the same torques, shape (p,); see `Estimate`."""
        return self.base.to_standard(self.values)

    @property
    def left_out_fraction(self) -> FloatArray:
        """Fraction of the rows that were left out, mostly near standstill, shape (n,)."""
        return 1.0 - self.fit.rows_used / sum(
            count_rows(self.model, run) for run in self.problem.runs
        )

    def estimate(self, cell_name: str = "", run_ids: tuple[str, ...] = ()) -> Estimate:
        """Return the estimate with its intervals, and the names of the cell and the runs."""
        fit, problem, b = self.fit, self.problem, len(self.base)
        covariance = fit.solution.covariance
        scatter = problem.scatter(self.model, self.standard, fit)
        clustered = scatter.quoted
        return Estimate(
            robot=self.robot,
            options=self.options,
            base=self.base,
            values=self.values,
            covariance_noise=None,
            covariance_residual=covariance[:b, :b],
            covariance_jackknife=clustered[:b, :b],
            nonlinear_covariance=covariance_at_least(clustered[b:, b:], covariance[b:, b:]),
            clusters=scatter.clusters,
            condition_number=fit.solution.condition_number,
            equations=fit.solution.rows,
            residual_nm=fit.residual_nm,
            noise_nm=None,
            torque_nm=fit.torque_nm,
            left_out_fraction=self.left_out_fraction,
            method="smoothed",
            band_hz=min(run.signals.cutoff_hz for run in problem.runs),
            standstill_rad_s=problem.standstill_rad_s,
            weighting=problem.weighting,
            cell_name=cell_name,
            run_ids=run_ids,
            still=self.still,
            position_range=position_range([run.signals.position for run in problem.runs]),
        )


def fit_smoothed(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions | None = None,
    *,
    payload: Sequence[bool] | None = None,
    bodies: Sequence[Bodies] | None = None,
) -> FittedSignals:
    """Solve the equations of recordings that are not periodic, in the time domain.

    A joint's equation is left out while the joint is slower than the standstill speed. The weight
    of each joint is one over its residuals' standard deviation, found by iteration. Neighbouring
    rows are not independent; the cluster-robust covariance treats the residuals of one second as
    one cluster.

    Args:
        signals: Smoothed recording of each run.
        options: The model's terms and the weighting of the rows.
        payload: For each run, True if it carried the unknown payload; all False by default.
        bodies: For each run, the known bodies that it carried; none by default.

    Raises:
        EstimationError: The joints are not those of the robot, the motion does not determine the
            parameters, or the model's friction depends on known bodies.
    """
    options = options or EstimationOptions()
    motions = [(run.position, run.velocity) for run in signals]
    model, base, terms, still = build_model(
        robot, options.model, motions, options.standstill_rad_s, JERK_SHARE
    )
    if terms.kind != "internal":
        raise EstimationError(
            f"the {terms.kind} model is identified from periodic runs only: record a periodic"
            " motion, or use --model internal",
            code="RID-MODEL-KIND",
        )

    def problem_of(model: RobotModel, base: BaseParameters) -> SmoothedProblem:
        known = None if bodies is None else known_values(model, base, bodies)
        return SmoothedProblem(
            base=base,
            runs=time_runs(model, signals, payload or [False] * len(signals), known),
            standstill_rad_s=options.standstill_rad_s,
            weighting=options.weighting,
            prior=prior_rows(base, options.prior),
            still=tuple(robot.joint_names.index(each.joint) for each in still),
        )

    problem = problem_of(model, base)
    model, standard, fit = fit_with_nonlinear(model, base, problem.fit)
    found = FittedSignals(robot, terms, model, problem, standard, fit, still)

    def refit(separate: BaseParameters) -> tuple[FittedSignals, FloatArray, FloatArray]:
        problem = problem_of(model, separate)
        values = found.standard_values[list(separate.kept)]
        fitted = fit_from(model, separate, problem.fit, values, fit.scale_nm)
        again = replace(found, problem=problem, model=fitted[0], standard=fitted[1], fit=fitted[2])
        return again, again.values, again.sigma[: len(separate)]

    if standard is not None:
        sigma = found.sigma[len(base) :]
        found = separate_rotors(model, base, sigma, refit, options=terms, still=still) or found
    return replace(found, options=terms.fitted(found.model, found.base))
