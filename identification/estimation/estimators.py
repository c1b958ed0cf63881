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
from identification.estimation.estimate import Estimate, Weighting
from identification.estimation.fitted_periods import (
    Prior,
    fit_periodic,
    model_of,
    prior_rows,
)
from identification.estimation.nonlinear_parameters import fit_nonlinear
from identification.estimation.smoothed_fit import SmoothedProblem
from identification.model.options import ModelOptions
from identification.regression.least_squares import Solution

BAND_HZ = 10.0
STANDSTILL_RAD_S = 0.02


def estimate_periodic(
    robot: RobotDescription,
    averages: Sequence[PeriodAverage],
    *,
    options: ModelOptions | None = None,
    weighting: Weighting = "ml",
    prior: Prior | None = None,
    payload: Sequence[bool] | None = None,
    band_hz: float = BAND_HZ,
    standstill_rad_s: float = STANDSTILL_RAD_S,
    cell_name: str = "",
    run_ids: tuple[str, ...] = (),
) -> Estimate:
    """Estimate from averaged periods, on their DFT bins.

    Each row's noise is the torque's, from the scatter between periods with the anti-alias filter
    divided out, and the position's, through the inertia that the estimate itself shows. The
    external and the combined model (`options.kind`) count the base wrench of a force plate too,
    by its own noise (4.2, 4.3); its constant offsets count as unknown.

    Parameters
    ----------
    robot : RobotDescription
        The robot.
    averages : sequence of PeriodAverage
        One a run.
    options : ModelOptions, optional
        Terms of the model; what the robot file says by default.
    weighting : "ml", "ls" or "huber"
        Rows over their noise; all alike; over their noise with outliers held down.
    prior : (values, sigmas), optional
        Knowledge of the standard parameters (Bayesian estimate).
    payload : sequence of bool, optional
        Which runs carried the unknown payload; none by default.
    band_hz : float
        Highest frequency used [Hz].
    standstill_rad_s : float
        Below this speed a joint's friction is left free; 0 trusts sign(v) everywhere.
    cell_name, run_ids : str, tuple of str
        Provenance.

    Raises
    ------
    EstimationError
        The joints do not fit, or the motion does not show the parameters.
    """
    fitted = fit_periodic(
        robot,
        averages,
        options=options,
        weighting=weighting,
        prior=prior,
        payload=payload,
        band_hz=band_hz,
        standstill_rad_s=standstill_rad_s,
    )
    return fitted.estimate(cell_name, run_ids)


def estimate_smoothed(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    *,
    options: ModelOptions | None = None,
    weighting: Weighting = "ml",
    prior: Prior | None = None,
    payload: Sequence[bool] | None = None,
    standstill_rad_s: float = STANDSTILL_RAD_S,
    cell_name: str = "",
    run_ids: tuple[str, ...] = (),
) -> Estimate:
    """Estimate from recordings that are not periodic, in the time domain.

    A joint's equation is left out while the joint is slower than `standstill_rad_s`. The weight of
    each joint is one over its residuals' standard deviation, found by iteration. Neighbouring rows
    are not independent; the cluster-robust covariance takes the residuals of one second as one
    event.

    Parameters
    ----------
    robot : RobotDescription
        The robot.
    signals : sequence of SmoothedSignals
        One a run.
    options, weighting, prior, payload, standstill_rad_s, cell_name, run_ids
        As for `estimate_periodic`.

    Raises
    ------
    EstimationError
        The joints do not fit, or the motion does not show the parameters.
    """
    model, base, options = model_of(robot, options)
    if options.kind != "internal":
        raise EstimationError(
            f"the {options.kind} model is estimated from periodic runs only: record a periodic"
            " motion, or identify the internal model"
        )
    problem = SmoothedProblem(
        base=base,
        runs=time_runs(model, signals, payload or [False] * len(signals)),
        standstill_rad_s=standstill_rad_s,
        weighting=weighting,
        prior=prior_rows(base, prior),
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
        options=options.with_nonlinear_of(model),
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
        standstill_rad_s=standstill_rad_s,
        weighting=weighting,
        cell_name=cell_name,
        run_ids=run_ids,
    )
