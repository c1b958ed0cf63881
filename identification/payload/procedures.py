"""Estimation of a payload from runs, by one of the procedures (theory: section 11)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.consistency.metric import full_rank_covariance
from identification.estimation.estimate import Estimate
from identification.estimation.transformed import with_rotors_in_links
from identification.model.options import ModelOptions
from identification.payload.body import PARAMETERS
from identification.payload.equations import (
    PayloadEquations,
    PayloadModel,
    Procedure,
    condense_cluster,
)
from identification.payload.estimate import PayloadEstimate
from identification.payload.known import KnownPayloadValue
from identification.payload.measured_runs import MeasuredRuns
from identification.payload.solution import SEEN, PayloadSolution, solve_payload
from identification.regression.intervals import covariance_at_least

PASSES: Final = 4
TORQUE_CONSTANT_SIGMA: Final = 0.01


@dataclass(frozen=True)
class PayloadOptions:
    """Options of a payload's estimate.

    Attributes:
        procedure: Procedure that separates the payload from the robot.
        options: The terms of the robot's model.
        robot: The robot without payload, for `model` and `apart`. With the other procedures, the
            runs without payload are checked against this model. Its friction terms replace those of
            the robot file.
        known: Quantities of the payload that are known from another source.
        torque_constant_sigma: Relative standard deviation of every joint's torque constant.
            `TORQUE_CONSTANT_SIGMA` is that of drives without calibration. The procedure `apart`
            cannot use it.
    """

    procedure: Procedure = "together"
    options: ModelOptions = field(default_factory=ModelOptions)
    robot: Estimate | None = None
    known: tuple[KnownPayloadValue, ...] = ()
    torque_constant_sigma: float = 0.0


def identify_payload(
    robot: RobotDescription,
    runs: MeasuredRuns,
    how: PayloadOptions | None = None,
    *,
    cell_name: str = "",
    run_ids: tuple[str, ...] = (),
) -> PayloadEstimate:
    """Estimate a payload from recordings.

    Args:
        runs: Runs with and without the payload.
        how: The procedure and prior knowledge.
        cell_name, run_ids: Names of the cell and of the runs.

    Raises:
        EstimationError: The runs do not fit the procedure, or do not determine a payload.
    """
    how = how or PayloadOptions()
    if not 0.0 <= how.torque_constant_sigma < 1.0:
        raise EstimationError(
            "the relative standard deviation of the torque constants is"
            f" {how.torque_constant_sigma:g}, but must be at least 0 and less than 1, such as"
            " 0.01",
            code="RID-OPTION-RANGE",
        )
    equations = equations_of(robot, runs, how)
    solution = solve_payload(equations, how.known)
    slopes = solution.gain_slopes
    if equations.procedure == "apart":  # has no gain slopes
        if how.torque_constant_sigma > 0.0:
            raise EstimationError(
                "the procedure `apart` cannot include the uncertainty of torque constants: use"
                " another procedure",
                code="RID-PAYLOAD-PROCEDURE",
            )
        slopes = np.zeros_like(slopes)
    spread = how.torque_constant_sigma * slopes
    clustered = covariance_at_least(solution.covariance_jackknife, solution.covariance_noise)
    torque, residual = _torque_and_residual(equations, solution)
    caused = [np.linalg.norm(columns @ solution.values) for columns in equations.payload_columns]
    estimate = PayloadEstimate(
        robot=robot,
        procedure=equations.procedure,
        values=solution.values,
        covariance=clustered + spread @ spread.T,
        covariance_noise=solution.covariance_noise,
        gain_slopes=slopes,
        unseen=solution.unseen,
        condition_number=solution.condition_number,
        known=how.known,
        contradictions=solution.contradictions,
        torque_constant_sigma=how.torque_constant_sigma,
        torque_nm=torque,
        residual_nm=residual,
        noise_nm=equations.noise_nm,
        payload_nm=np.array(caused, dtype=np.float64),
        equations=sum(equations.rows),
        cell_name=cell_name,
        run_ids=run_ids,
    )
    mass = estimate.values[0]
    if estimate.is_parameter_determined[0] and mass <= 0.0:
        raise EstimationError(
            f"the estimated mass of the payload is {mass:.3g} ±"
            f" {2 * estimate.sigma_parameters[0]:.2g} kg, which is not positive: check which runs"
            " carried the payload and which did not",
            code="RID-PAYLOAD-RUNS",
        )
    return estimate


def _torque_and_residual(
    equations: PayloadEquations, solution: PayloadSolution
) -> tuple[FloatArray, FloatArray]:
    """Return the RMS of each joint's torque, and of its residual [N m or N]."""
    power = np.array(
        [
            [
                np.sum(factor[:, -1] ** 2),
                np.sum((factor[:, -1] - factor[:, :-1] @ solution.unknowns) ** 2),
            ]
            for factor in equations.joints
        ]
    ).T
    torque, residual = np.sqrt(power / np.maximum(equations.divisors[0], 1.0))
    return np.hypot(torque, equations.explained_nm), residual


def equations_of(
    robot: RobotDescription, runs: MeasuredRuns, how: PayloadOptions
) -> PayloadEquations:
    """Return the equations of a procedure; arguments and errors as in `identify_payload`."""
    if not any(runs.loaded):
        raise EstimationError(
            "no run carried the payload: name the runs that carried it (--loaded)",
            code="RID-PAYLOAD-RUNS",
        )
    match how.procedure:
        case "together" | "difference":
            if all(runs.loaded):
                raise EstimationError(
                    "every run carried the payload, so it cannot be distinguished from the"
                    " robot: add a run without it, or provide a model of the robot (procedure"
                    " `model`)",
                    code="RID-PAYLOAD-NOT-UNLOADED",
                )
        case "model":
            if how.robot is None:
                raise EstimationError(
                    "the procedure `model` needs a model of the robot without payload",
                    code="RID-OPTION-NEEDS",
                )
        case "apart":
            return _subtract_two_robots(robot, runs, how)
    described = described_robot(robot, how)
    model = PayloadModel.of(described, robot_options(how))
    if how.procedure == "difference" and model.model.transmission.losses:
        raise EstimationError(
            "torques can be subtracted only if a gear's loss is the same with and without the"
            " payload: use `together` with the friction term load, or with efficiencies",
            code="RID-MODEL-LOAD-FRICTION",
        )
    if how.procedure == "difference" or not model.model.nonlinear_names:
        return runs.equations(model, how.procedure, robot=how.robot)
    if how.procedure == "together":
        joint = runs.estimate(described, model.options, runs.loaded)
        model = PayloadModel.of(described, joint.options)
        return runs.equations(model, how.procedure, robot=how.robot, standard=joint.standard_values)
    # A gear's loss depends on its load, so the equations are iterated with the payload's estimate.
    standard = np.zeros(len(model.model.parameter_names))
    if how.robot is not None:
        standard[:-PARAMETERS_PER_LINK] = how.robot.standard_values
    equations = runs.equations(model, how.procedure, robot=how.robot, standard=standard)
    for _ in range(PASSES):
        values = solve_payload(equations, how.known, intervals=False).values
        standard[-PARAMETERS_PER_LINK:] = model.flange_to_link @ values
        equations = runs.equations(model, how.procedure, robot=how.robot, standard=standard)
    return equations


def mass_left_on_flange(
    robot: RobotDescription, runs: MeasuredRuns, how: PayloadOptions
) -> tuple[float, float] | None:
    """Estimate the mass on the flange in the runs without payload, with the model of the robot.

    Returns:
        Mass and its standard deviation [kg]; None without a model or such runs, or if their motion
        does not determine the mass.

    Raises:
        EstimationError: The model is of another robot.
    """
    empty = [i for i, carried in enumerate(runs.loaded) if not carried]
    if how.robot is None or not empty:
        return None
    weighed = replace(how, procedure="model")
    solution = solve_payload(equations_of(robot, runs.part(empty, carrying=True), weighed))
    if np.linalg.norm(solution.unseen[0]) > SEEN:
        return None
    variance = max(solution.covariance_jackknife[0, 0], solution.covariance_noise[0, 0])
    return float(solution.values[0]), float(np.sqrt(variance))


def robot_options(how: PayloadOptions) -> ModelOptions:
    """Return the terms of the robot's model, with the columns of a payload."""
    return replace(how.options if how.robot is None else how.robot.options, payload=True)


def described_robot(robot: RobotDescription, how: PayloadOptions) -> RobotDescription:
    """Return the robot with the joints of its model; their friction terms may differ."""
    if how.robot is None:
        return robot
    differences = robot.differences(how.robot.robot)
    if differences:
        raise EstimationError(
            f"the model is not of the runs' robot: {', '.join(differences)} differ. Identify the"
            " robot without payload from runs of this robot",
            code="RID-ROBOT-OTHER",
        )
    return robot.model_copy(update={"joints": how.robot.robot.joints})


def _subtract_two_robots(
    robot: RobotDescription, runs: MeasuredRuns, how: PayloadOptions
) -> PayloadEquations:
    """Identify the robot with the payload and without, and subtract.

    The payload's ten parameters add to those of the last link. Therefore each base parameter
    changes by the columns of K that belong to this link.
    """
    options = replace(robot_options(how), payload=False)
    described = described_robot(robot, how)

    def identified(loaded: bool) -> Estimate:
        chosen = [i for i, own in enumerate(runs.loaded) if own is loaded]
        if not chosen:
            raise EstimationError(
                f"there is no run {'with' if loaded else 'without'} the payload from which the"
                " robot could be identified: add such a run",
                code="RID-PAYLOAD-RUNS",
            )
        return runs.part(chosen).estimate(described, options, [False] * len(chosen))

    alone, with_payload = how.robot or identified(False), identified(True)
    equations = equations_of_two_robots(with_payload, alone, runs.torque_nm)
    return replace(equations, carried=_payload_columns_of_loaded_runs(runs, with_payload))


def _payload_columns_of_loaded_runs(runs: MeasuredRuns, robot: Estimate) -> tuple[FloatArray, ...]:
    """Return the payload's columns in the torques of the loaded runs, for each joint."""
    part = runs.part([i for i, carried in enumerate(runs.loaded) if carried])
    model = PayloadModel.of(robot.robot, robot.options)
    standard = np.zeros(len(model.model.parameter_names)) if robot.model.nonlinear_names else None
    return part.equations(model, "together", standard=standard).payload_columns


def equations_of_two_robots(
    with_payload: Estimate, alone: Estimate, torque_nm: FloatArray
) -> PayloadEquations:
    """Return the equations of a payload from two estimates of one robot.

    Each estimate has its own friction. The difference of each base parameter is one cluster.

    Args:
        with_payload, alone: The robot with the payload as part of its last link, and without
            payload.
        torque_nm: Shape (n,). RMS of each joint's torque [N m or N].

    Raises:
        EstimationError: The estimates are of different robots or have different terms.
    """
    with_payload, alone = map(with_rotors_in_links, (with_payload, alone))
    if with_payload.base.expressions != alone.base.expressions:
        raise EstimationError(
            "the robots with and without payload have different model terms, or are different"
            " robots: identify both in the same way",
            code="RID-MODEL-TERMS-DIFFER",
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
        full_rank_covariance(estimate)[pick[:, np.newaxis], pick]
        for estimate in (with_payload, alone)
    )
    scale = np.sqrt(np.diagonal(covariance))
    lower = np.linalg.cholesky(covariance / np.outer(scale, scale))
    matrix: FloatArray = np.asarray(
        np.linalg.solve(lower, columns / scale[:, np.newaxis]), dtype=np.float64
    )
    rhs: FloatArray = np.asarray(np.linalg.solve(lower, difference / scale), dtype=np.float64)
    n = len(with_payload.robot.joints)
    nothing = [np.zeros((0, ten))] * (n - 1)
    worse = with_payload.residual_nm >= alone.residual_nm
    residual = np.where(worse, with_payload.residual_nm, alone.residual_nm)
    noise = None
    if with_payload.noise_nm is not None and alone.noise_nm is not None:
        noise = np.where(worse, with_payload.noise_nm, alone.noise_nm)
    factors = tuple(
        condense_cluster([matrix[[i]], *nothing], [rhs[[i]], *[np.zeros(0)] * (n - 1)], ten)
        for i in range(len(rhs))
    )
    return PayloadEquations(
        procedure="apart",
        joint_names=with_payload.robot.joint_names,
        names=PARAMETERS,
        factors=factors,
        joints=tuple(np.array([[*np.zeros(ten), each]]) for each in residual),
        rows=(1,) * n,
        divisors=np.ones((2, n)),
        known=np.zeros((0, ten + 1)),
        runs=(0,) * len(factors),
        explained_nm=np.sqrt(np.maximum(torque_nm**2 - residual**2, 0.0)),
        noise_nm=noise,
    )
