"""From runs to a payload by one of the procedures of physics 11."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.consistency.closest_robot import jackknife_metric
from identification.estimation.estimate import Estimate
from identification.estimation.estimators import estimate_periodic, estimate_smoothed
from identification.model.options import ModelOptions
from identification.payload.body import PARAMETERS
from identification.payload.equations import (
    PayloadEquations,
    PayloadModel,
    Procedure,
    condense,
)
from identification.payload.estimate import PayloadEstimate, estimate_payload
from identification.payload.periodic_runs import PeriodicRuns, periodic_equations
from identification.payload.smoothed_runs import SmoothedRuns, smoothed_equations
from identification.payload.solution import Known, solve_payload

PASSES: Final = 4

Runs = PeriodicRuns | SmoothedRuns


@dataclass(frozen=True)
class PayloadOptions:
    """What a person may choose about a payload's estimate.

    Attributes
    ----------
    procedure : Procedure
        How the robot is told from the payload.
    options : ModelOptions
        The terms of the robot's model.
    robot : Estimate or None
        The robot without payload, for the procedure `model`.
    known : tuple of Known
        What is known of the payload otherwise.
    torque_constant_sigma : float
        Relative standard deviation of every joint's torque constant.
    """

    procedure: Procedure = "together"
    options: ModelOptions = field(default_factory=ModelOptions)
    robot: Estimate | None = None
    known: tuple[Known, ...] = ()
    torque_constant_sigma: float = 0.0


def weigh(
    robot: RobotDescription,
    runs: Runs,
    how: PayloadOptions | None = None,
    *,
    cell_name: str = "",
    run_ids: tuple[str, ...] = (),
) -> PayloadEstimate:
    """Estimate a payload from recordings.

    Parameters
    ----------
    robot : RobotDescription
        The robot.
    runs : PeriodicRuns or SmoothedRuns
        What was measured, with and without the payload.
    how : PayloadOptions, optional
        The procedure and what is known.
    cell_name, run_ids : str, tuple of str
        Provenance.

    Raises
    ------
    EstimationError
        The runs do not fit the procedure, or say nothing of a payload.
    """
    how = how or PayloadOptions()
    return estimate_payload(
        robot,
        equations_of(robot, runs, how),
        how.known,
        torque_constant_sigma=how.torque_constant_sigma,
        cell_name=cell_name,
        run_ids=run_ids,
    )


def equations_of(robot: RobotDescription, runs: Runs, how: PayloadOptions) -> PayloadEquations:
    """Return the equations of a procedure; arguments and errors as in `weigh`."""
    if not any(runs.loaded):
        raise EstimationError("no run carried the payload: name those that did")
    match how.procedure:
        case "together" | "difference":
            if all(runs.loaded):
                raise EstimationError(
                    "every run carried the payload, so that it cannot be told from the robot: add a"
                    " run without it, or give a model of the robot (procedure `model`)"
                )
        case "model":
            if how.robot is None:
                raise EstimationError("the procedure `model` needs a model of the robot alone")
        case "apart":
            return _apart(robot, runs, how)
    model = PayloadModel.of(robot, _options(how))
    if not model.model.nonlinear_names:
        return _equations(model, runs, how, None)
    if how.procedure == "together":
        joint = _joint_estimate(robot, runs, model.options)
        model = model.with_nonlinear(joint.model)
        return _equations(model, runs, how, joint.standard_values)
    # A gear's loss depends on what it carries: the payload's equations are made with the payload.
    standard = np.zeros(len(model.model.parameter_names))
    if how.robot is not None:
        standard[:-PARAMETERS_PER_LINK] = how.robot.standard_values
    equations = _equations(model, runs, how, standard)
    for _ in range(PASSES):
        values = solve_payload(equations, how.known, intervals=False).values
        standard[-PARAMETERS_PER_LINK:] = model.flange_to_link @ values
        equations = _equations(model, runs, how, standard)
    return equations


def _options(how: PayloadOptions) -> ModelOptions:
    if how.robot is not None and how.procedure == "model":
        return replace(how.robot.options, payload=True)
    return replace(how.options, payload=True)


def _equations(
    model: PayloadModel, runs: Runs, how: PayloadOptions, standard: FloatArray | None
) -> PayloadEquations:
    if isinstance(runs, PeriodicRuns):
        return periodic_equations(model, runs, how.procedure, robot=how.robot, standard=standard)
    return smoothed_equations(model, runs, how.procedure, robot=how.robot, standard=standard)


def _joint_estimate(
    robot: RobotDescription,
    runs: Runs,
    options: ModelOptions,
    payload: Sequence[bool] | None = None,
) -> Estimate:
    loaded = runs.loaded if payload is None else payload
    if isinstance(runs, PeriodicRuns):
        return estimate_periodic(
            robot,
            runs.averages,
            options=options,
            payload=loaded,
            band_hz=runs.band_hz,
            standstill_rad_s=runs.standstill_rad_s,
        )
    return estimate_smoothed(
        robot,
        runs.signals,
        options=options,
        payload=loaded,
        standstill_rad_s=runs.standstill_rad_s,
    )


def _apart(robot: RobotDescription, runs: Runs, how: PayloadOptions) -> PayloadEquations:
    """Identify the robot with the payload and without, and subtract.

    A payload on the last link adds to that link's ten parameters, so that the base parameters
    change by the columns of K that belong to it.
    """
    options = replace(how.options, payload=False)
    loaded = _only(runs, True)
    with_payload = _joint_estimate(robot, loaded, options, [False] * len(loaded.loaded))
    if how.robot is not None:
        alone = how.robot
    else:
        unloaded = _only(runs, False)
        alone = _joint_estimate(robot, unloaded, options, [False] * len(unloaded.loaded))
    return equations_apart(with_payload, alone)


def equations_apart(with_payload: Estimate, alone: Estimate) -> PayloadEquations:
    """Return the equations of a payload out of two estimates of one robot.

    Their friction is each its own. A base parameter's difference is a cluster of its own.

    Raises
    ------
    EstimationError
        The estimates are of different robots or have different terms.
    """
    if with_payload.base.expressions != alone.base.expressions:
        raise EstimationError(
            "the robots with and without payload were identified with different terms, or are"
            " different robots: identify both alike"
        )
    model = PayloadModel.of(with_payload.robot, with_payload.options)
    ten = PARAMETERS_PER_LINK
    last = slice(ten * (model.model.chain.n - 1), ten * model.model.chain.n)
    places = model.links
    columns = with_payload.base.combination[places, last] @ model.flange_to_link
    seen = np.flatnonzero(np.linalg.norm(columns, axis=1) > 0.0)
    columns = columns[seen]
    difference = (with_payload.values - alone.values)[places[seen]]
    pick = places[seen]
    covariance = sum(
        _covariance(estimate)[pick[:, np.newaxis], pick] for estimate in (with_payload, alone)
    )
    scale = np.sqrt(np.diagonal(covariance))
    lower = np.linalg.cholesky(covariance / np.outer(scale, scale))
    matrix: FloatArray = np.asarray(
        np.linalg.solve(lower, columns / scale[:, np.newaxis]), dtype=np.float64
    )
    rhs: FloatArray = np.asarray(np.linalg.solve(lower, difference / scale), dtype=np.float64)
    n = len(with_payload.robot.joints)
    nothing = [np.zeros((0, ten))] * (n - 1)
    factors = tuple(
        condense([matrix[[i]], *nothing], [rhs[[i]], *[np.zeros(0)] * (n - 1)], ten)
        for i in range(len(rhs))
    )
    return PayloadEquations(
        procedure="apart",
        joint_names=with_payload.robot.joint_names,
        names=PARAMETERS,
        factors=factors,
        joints=tuple(
            np.array([[*np.zeros(ten), residual]]) for residual in with_payload.residual_nm
        ),
        rows=(1,) * n,
        divisors=np.ones((2, n)),
        known=np.zeros((0, ten + 1)),
        runs=(0,) * len(factors),
    )


def _covariance(estimate: Estimate) -> FloatArray:
    sigma, factor = jackknife_metric(estimate)
    spread = sigma[:, np.newaxis] * factor
    return np.asarray(spread @ spread.T)


def _only(runs: Runs, loaded: bool) -> Runs:
    chosen = [i for i, own in enumerate(runs.loaded) if own is loaded]
    if not chosen:
        raise EstimationError(
            f"there is no run {'with' if loaded else 'without'} the payload to identify the robot"
            " from: add one"
        )
    flags = (loaded,) * len(chosen)
    if isinstance(runs, PeriodicRuns):
        return replace(runs, averages=tuple(runs.averages[i] for i in chosen), loaded=flags)
    return replace(runs, signals=tuple(runs.signals[i] for i in chosen), loaded=flags)
