"""`FittedPeriods`: averaged periods with their fitted solution.

An `Estimate` is made from it. Two other analyses also need its equations: the improvement by the
force plate, and the agreement of torque constants and plate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.processing.periods import PeriodAverage
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from identification.equations.bins import BinEquations, mean_motion
from identification.equations.plate_fit import PlateFit
from identification.equations.whitened import residual_covariance
from identification.estimation.estimate import Estimate, position_range
from identification.estimation.lossy_gears import separate_rotors
from identification.estimation.nonlinear_parameters import fit_nonlinear
from identification.estimation.options import EstimationOptions
from identification.estimation.periodic_fit import PeriodicFit, PeriodicProblem
from identification.estimation.prior import prior_rows
from identification.model.base_parameters import BaseParameters, base_parameters
from identification.model.inertia import base_inertia_squares, inertia_size
from identification.model.known_loads import Bodies, known_values
from identification.model.options import ModelOptions
from identification.model.still_joints import StillJoint, still_joints
from identification.regression.intervals import covariance_at_least
from identification.regression.least_squares import Solution

MOST_STEPS: Final = 20
SETTLED_SIGMAS: Final = 0.01
LONGEST_DELAY_S: Final = 0.25
PLATE_LATE: Final = "RID-PLATE-LATE"


@dataclass(frozen=True, eq=False)
class FittedPeriods:
    """A problem, its equations and their solution.

    Attributes:
        options: The terms of the model, with the fitted nonlinear parameters.
        model: The model with these options.
        problem: The averages, with the estimated weights and delays.
        equations: Equations of each run.
        fit: The solution.
        still: The joints that no run moves.
        gear_torque_nm: See `Estimate`.
    """

    robot: RobotDescription
    options: ModelOptions
    model: RobotModel
    problem: PeriodicProblem
    equations: tuple[BinEquations, ...]
    fit: PeriodicFit
    still: tuple[StillJoint, ...] = ()
    gear_torque_nm: FloatArray | None = None

    @property
    def base(self) -> BaseParameters:
        """The base parameters, which are the first b values of the solution."""
        return self.problem.base

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations of the solution, from the residuals, shape (p,)."""
        solution = self.fit.solution
        covariance = residual_covariance(self.fit.white, solution.values, solution.covariance)
        return np.asarray(np.sqrt(np.diagonal(covariance)))

    def estimate(self, cell_name: str = "", run_ids: tuple[str, ...] = ()) -> Estimate:
        """Return the estimate, with the names of the cell and the runs."""
        problem, fit, weighting = self.problem, self.fit, self.problem.weighting
        covariance, of_base, of_nonlinear = fit.solution.covariance, fit.of_base, fit.of_nonlinear
        scatter = problem.scatter(fit)
        clustered = scatter.quoted
        residual = residual_covariance(fit.white, fit.solution.values, covariance)
        unfitted = np.zeros((len(self.model.nonlinear_names),) * 2)
        plate = None
        if self.options.kind != "internal":
            plate = PlateFit.of(
                problem.averages,
                self.equations,
                problem.base_inertia,
                fit.solution.values[fit.of_model],
                problem.delays_s,
                np.sqrt(np.diagonal(covariance)[fit.of_delays]),
            )
        return Estimate(
            robot=self.robot,
            options=self.options,
            base=self.base,
            values=fit.solution.values[of_base],
            covariance_noise=None if weighting == "ls" else covariance[of_base, of_base],
            covariance_residual=residual[of_base, of_base],
            covariance_jackknife=clustered[of_base, of_base],
            plate=plate,
            nonlinear_covariance=(
                covariance_at_least(
                    clustered[of_nonlinear, of_nonlinear], residual[of_nonlinear, of_nonlinear]
                )
                if fit.nonlinear
                else unfitted
            ),
            clusters=scatter.clusters,
            condition_number=fit.solution.condition_number,
            equations=fit.solution.rows,
            residual_nm=fit.residual_nm,
            noise_nm=None if weighting == "ls" else fit.noise_nm,
            torque_nm=None if problem.kind == "external" else fit.torque_nm,
            left_out_fraction=np.mean([e.left_out_fraction for e in self.equations], axis=0),
            method="periodic",
            band_hz=min(e.harmonics / e.period_s for e in self.equations),
            standstill_rad_s=problem.standstill_rad_s,
            weighting=weighting,
            periods=sum(average.periods_kept for average in problem.averages),
            cell_name=cell_name,
            run_ids=run_ids,
            still=self.still,
            position_range=position_range([each.position for each in problem.averages]),
            gear_torque_nm=self.gear_torque_nm,
        )


def fit_periodic(
    robot: RobotDescription,
    averages: Sequence[PeriodAverage],
    options: EstimationOptions | None = None,
    *,
    payload: Sequence[bool] | None = None,
    bodies: Sequence[Bodies] | None = None,
) -> FittedPeriods:
    """Solve the equations of averaged periods.

    The noise of each row has two sources. One is the torque noise, from the scatter between periods
    with the anti-alias filter divided out. The other is the position noise, multiplied by the
    inertia of the estimate. The external and the combined model (`ModelOptions.kind`) also use the
    base wrench of a force plate, with its own noise (4.2, 4.3); its constant offsets count as
    unknown.

    Args:
        averages: Mean period of each run.
        options: The model's terms and the weighting of the rows.
        payload: For each run, True if it carried the unknown payload; all False by default.
        bodies: For each run, the known bodies that it carried; none by default.

    Raises:
        EstimationError: The joints are not those of the robot, the motion does not determine the
            parameters, a plate that the model needs is missing, or the model's friction depends on
            known bodies.
    """
    options = options or EstimationOptions()
    problem, model, terms, still = _set_up_problem(robot, averages, options, payload)
    base = problem.base
    if bodies is not None:
        problem = replace(problem, known=known_values(model, base, bodies))
    equations = problem.equations(model, None)
    values = problem.fit(model, None, equations).solution.values
    # The torque noise due to position noise depends on the inertia, which is known only now.
    sizes = [inertia_size(model, base, a.position, values) for a in averages]
    squares = [base_inertia_squares(model, base, a.position, values) for a in averages]
    problem = replace(problem, inertia=np.array(sizes), base_inertia=np.array(squares))
    problem, fit = _solve_with_delays(problem, model, None, equations)
    if model.nonlinear_names and terms.kind != "external":
        values = fit.solution.values[fit.of_base]
        problem, model, equations, fit = _fit_nonlinear(problem, model, values)
    found = FittedPeriods(robot, terms, model, problem, equations, fit, still)

    def refit(separate: BaseParameters) -> tuple[FittedPeriods, FloatArray, FloatArray]:
        standard = base.to_standard(fit.solution.values[fit.of_base])
        changed = replace(
            problem,
            base=separate,
            prior=prior_rows(separate, options.prior),
            known=None if bodies is None else known_values(model, separate, bodies),
        )
        fitted = _fit_nonlinear(changed, model, standard[list(separate.kept)])
        again = FittedPeriods(robot, terms, fitted[1], fitted[0], fitted[2], fitted[3], still)
        return again, again.fit.solution.values[again.fit.of_base], again.sigma[again.fit.of_base]

    if fit.nonlinear:
        sigma = found.sigma[fit.of_nonlinear]
        found = separate_rotors(model, base, sigma, refit, options=terms, still=still) or found
    return replace(found, options=terms.fitted(found.model, found.base))


def _fit_nonlinear(
    problem: PeriodicProblem, model: RobotModel, values: FloatArray
) -> tuple[PeriodicProblem, RobotModel, tuple[BinEquations, ...], PeriodicFit]:
    """Fit the nonlinear parameters, beginning with the base parameters `values`, shape (b,)."""

    def solve(model: RobotModel, standard: FloatArray) -> Solution:
        return problem.fit(model, standard, problem.equations(model, standard)).solution

    shaped = fit_nonlinear(model, problem.base, values, solve)
    equations = problem.equations(shaped.model, shaped.standard)
    fitted, fit = _solve_with_delays(problem, shaped.model, shaped.standard, equations)
    return fitted, shaped.model, equations, fit


def unsolved_equations(
    robot: RobotDescription, averages: Sequence[PeriodAverage], options: EstimationOptions
) -> tuple[tuple[BinEquations, ...], RobotModel, BaseParameters]:
    """Return the equations of averaged periods before anything is estimated.

    Args:
        averages: Mean period of each run.
        options: The model's terms and the weighting of the rows.

    Returns:
        `equations`. Equations of each run.
        `model`. The model of the equations.
        `base`. The base parameters of the model.
    """
    problem, model, *_ = _set_up_problem(robot, averages, options, None)
    return problem.equations(model, None), model, problem.base


def _set_up_problem(
    robot: RobotDescription,
    averages: Sequence[PeriodAverage],
    options: EstimationOptions,
    payload: Sequence[bool] | None,
) -> tuple[PeriodicProblem, RobotModel, ModelOptions, tuple[StillJoint, ...]]:
    """Return the problem with zero inertia and delays, which come later; its model and terms."""
    motions = [mean_motion(average, options.band_hz) for average in averages]
    model, base, terms, still = build_model(robot, options.model, motions, options.standstill_rad_s)
    n, runs = len(robot.joints), len(averages)
    problem = PeriodicProblem(
        base=base,
        averages=tuple(averages),
        payload=tuple(payload or [False] * runs),
        band_hz=options.band_hz,
        standstill_rad_s=options.standstill_rad_s,
        weighting=options.weighting,
        prior=prior_rows(base, options.prior),
        inertia=np.zeros((runs, n, n)),
        kind=terms.kind,
        base_inertia=np.zeros((runs, n, 6, 6)),
        delays_s=np.zeros(runs),
    )
    return problem, model, terms, still


def _solve_with_delays(
    problem: PeriodicProblem,
    model: RobotModel,
    standard: FloatArray | None,
    equations: tuple[BinEquations, ...],
) -> tuple[PeriodicProblem, PeriodicFit]:
    """Solve the equations; if there are plates, estimate their delays by Gauss-Newton."""
    fit = problem.fit(model, standard, equations)
    if problem.kind == "internal":
        return problem, fit
    near = fit.solution.values
    for _ in range(MOST_STEPS):
        fit = problem.fit(model, standard, equations, near)
        near, step = fit.solution.values[fit.of_model], fit.solution.values[fit.of_delays]
        sigma = np.sqrt(np.diagonal(fit.solution.covariance)[fit.of_delays])
        if np.all(np.abs(step) <= SETTLED_SIGMAS * sigma + 1e-9):
            return problem, fit
        problem = replace(problem, delays_s=problem.delays_s + step)
        if np.max(np.abs(problem.delays_s)) > LONGEST_DELAY_S:
            break
    raise EstimationError(
        "the estimated delay of the force plate's signals is"
        f" {1e3 * float(np.max(np.abs(problem.delays_s))):.3g} ms: check that they belong to this"
        " motion, and check the plate's clock",
        code=PLATE_LATE,
    )


def build_model(
    robot: RobotDescription,
    options: ModelOptions | None,
    motions: Sequence[tuple[FloatArray, FloatArray]] = (),
    standstill_rad_s: float = 0.0,
    moving_share: float = 0.0,
) -> tuple[RobotModel, BaseParameters, ModelOptions, tuple[StillJoint, ...]]:
    """Return the model with some options, and the base parameters that some motions identify.

    Returns:
        `model`. The model.
        `base`. Its base parameters.
        `options`. The options, without terms that this kind of model does not have.
        `still`. The joints at rest in every motion, except in at most the fraction
        `moving_share` of its samples.
    """
    options = options or ModelOptions()
    if options.kind == "external":  # internal torques have no effect on the base
        options = replace(options, friction=False, friction_terms=None, spring=False)
    model = options.build(robot)
    still = still_joints(model, motions, standstill_rad_s, moving_share) if motions else ()
    return model, base_parameters(model, kind=options.kind, still=still), options, still
