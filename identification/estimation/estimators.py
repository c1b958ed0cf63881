"""From averaged periods or smoothed recordings to an `Estimate`.

Maximum likelihood with Gaussian noise of known variance per channel is weighted least squares,
solved by QR (physics: section 9). The same functions do ordinary and robust least squares, take a
Bayesian prior, and fit nonlinear parameters on the same cost.
"""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.processing.periods import PeriodAverage
from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from identification.equations.time_domain import time_runs
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import fit_periodic, model_of
from identification.estimation.nonlinear_parameters import fit_nonlinear
from identification.estimation.options import EstimationOptions
from identification.estimation.prior import prior_rows
from identification.estimation.smoothed_fit import SmoothedProblem
from identification.regression.least_squares import Solution


def estimate_periodic(
    robot: RobotDescription,
    averages: Sequence[PeriodAverage],
    options: EstimationOptions | None = None,
    *,
    payload: Sequence[bool] | None = None,
    cell_name: str = "",
    run_ids: tuple[str, ...] = (),
) -> Estimate:
    """Estimate from averaged periods, on their DFT bins; see `fit_periodic`.

    Parameters
    ----------
    robot, averages, options, payload
        As for `fit_periodic`.
    cell_name, run_ids : str, tuple of str
        Provenance.

    Raises
    ------
    EstimationError
        The joints do not fit, or the motion does not show the parameters.
    """
    return fit_periodic(robot, averages, options, payload=payload).estimate(cell_name, run_ids)


def estimate_smoothed(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions | None = None,
    *,
    payload: Sequence[bool] | None = None,
    cell_name: str = "",
    run_ids: tuple[str, ...] = (),
) -> Estimate:
    """Estimate from recordings that are not periodic, in the time domain.

    A joint's equation is left out while the joint is slower than the standstill speed. The weight
    of each joint is one over its residuals' standard deviation, found by iteration. Neighbouring
    rows are not independent; the cluster-robust covariance takes the residuals of one second as
    one event.

    Parameters
    ----------
    robot : RobotDescription
        The robot.
    signals : sequence of SmoothedSignals
        One a run.
    options : EstimationOptions, optional
        The model's terms and how rows count.
    payload : sequence of bool, optional
        Which runs carried the unknown payload; none by default.
    cell_name, run_ids : str, tuple of str
        Provenance.

    Raises
    ------
    EstimationError
        The joints do not fit, or the motion does not show the parameters.
    """
    options = options or EstimationOptions()
    model, base, terms = model_of(robot, options.model)
    if terms.kind != "internal":
        raise EstimationError(
            f"the {terms.kind} model is estimated from periodic runs only: record a periodic"
            " motion, or identify the internal model"
        )
    problem = SmoothedProblem(
        base=base,
        runs=time_runs(model, signals, payload or [False] * len(signals)),
        standstill_rad_s=options.standstill_rad_s,
        weighting=options.weighting,
        prior=prior_rows(base, options.prior),
    )
    standard = None
    fit = problem.fit(model, None)
    if model.nonlinear_names:
        scale = fit.scale_nm

        def solve(model: RobotModel, standard: FloatArray | None) -> Solution:
            return problem.fit(model, standard, scale).solution

        shaped = fit_nonlinear(model, base, solve)
        model, standard = shaped.model, shaped.standard
        fit = problem.fit(model, standard)
    b, covariance = len(base), fit.solution.covariance
    clustered = problem.jackknife_covariance(model, standard, fit)
    return Estimate(
        robot=robot,
        options=terms.with_nonlinear_of(model),
        base=base,
        values=fit.solution.values[:b],
        covariance_noise=None,
        covariance_residual=covariance[:b, :b],
        covariance_jackknife=clustered[:b, :b],
        nonlinear_covariance=clustered[b:, b:],
        condition_number=fit.solution.condition_number,
        equations=fit.solution.rows,
        residual_nm=fit.residual_nm,
        noise_nm=None,
        left_out_fraction=1.0 - fit.rows_used / problem.samples,
        method="smoothed",
        band_hz=min(smoothed.cutoff_hz for smoothed in signals),
        standstill_rad_s=options.standstill_rad_s,
        weighting=options.weighting,
        cell_name=cell_name,
        run_ids=run_ids,
    )
