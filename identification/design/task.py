"""`excitation_problem`: a design task from a cell and the existing knowledge of its robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from acquisition.motion.fourier import samples_of_period
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import RobotModel, regressor, torque
from dynamics.terms.conditions import Conditions
from identification.calibration.base_reaction import base_limits, with_known_mass
from identification.design.criteria import Condition, Criterion, DOptimal, Goals
from identification.design.model import design_model
from identification.design.problem import ExcitationProblem
from identification.estimation.estimate import Estimate, predict
from identification.estimation.transformed import with_rotors_in_links
from identification.model.base_parameters import BaseParameters, base_parameters

EXPECTED_NOISE_SHARE: Final = 0.01
LIMIT_FRACTION: Final = 0.95
CAD_TORQUE_SHARE: Final = 0.8
"""Usable fraction of torque limits for torques from `cad`, without friction and rotors."""
TORQUE: Final = "torque"
TORQUE_POSES: Final = 50
FRICTION_POSES: Final = 500
ROUNDING: Final = 1e-6


def criterion_of_options(robot: RobotDescription, name: str, wanted: Sequence[str]) -> Criterion:
    """Return the criterion for the options of a command.

    Args:
        name: "condition" or "d-optimal", used if `wanted` is empty.
        wanted: Base parameters by name, or `torque` for the predicted torques within all limits.

    Raises:
        ConfigError: A name is not a base parameter, or is given twice.
    """
    if not wanted:
        return Condition() if name == "condition" else DOptimal()
    model = design_model(robot)
    base = base_parameters(model)
    rows: list[FloatArray] = []
    for number, parameter in enumerate(wanted):
        if parameter in wanted[:number]:
            raise ConfigError(
                f"--for {parameter}: named twice; name it once", code="RID-OPTION-EXCLUSIVE"
            )
        if parameter == TORQUE:
            rows += list(_predictions(robot, model, base))
        elif parameter in base.names:
            rows.append(np.eye(len(base))[base.names.index(parameter)])
        else:
            raise ConfigError(
                f"--for {parameter}: the torques do not determine a parameter of this name; use"
                f" one of {TORQUE}, {', '.join(base.names)}",
                code="RID-OPTION-NAME",
            )
    return Goals(np.array(rows))


def excitation_problem(
    cell: CellConfig,
    robot: RobotDescription,
    *,
    period_s: float,
    harmonics: int,
    criterion: Criterion,
    model: Estimate | None = None,
    given: Sequence[Estimate] = (),
) -> ExcitationProblem:
    """Set up a design task from a cell and the existing knowledge of its robot.

    Torque limits are checked with `model`, or else with the robot file's `cad`, or else not at all.
    A reserve is kept for friction terms of `model` that the robot file does not have. The expected
    noise is the residual of `model` or of an earlier estimate, or else a fraction of the torque
    limits.

    Raises:
        ConfigError: A model is of another robot or has parameters that the robot file lacks, its
            friction exceeds a torque limit, or the period does not fit the cell.
    """
    samples = samples_of_period(period_s, cell.cycle_time_s)
    if 2 * harmonics >= samples:
        raise ConfigError(
            f"harmonic {harmonics} of a period of {samples} cycles is above half the sampling"
            " frequency: use fewer harmonics or a longer period",
            code="RID-MOTION-BAND",
        )
    planned = design_model(robot)
    noise = EXPECTED_NOISE_SHARE * np.array([joint.limits.torque for joint in robot.joints])
    known = [*given, *([model] if model is not None else [])]
    for estimate in known:
        if estimate.robot.joint_names != robot.joint_names:
            raise ConfigError(
                f"a model is of robot {estimate.robot.name!r}, but the cell's robot is"
                f" {robot.name!r}: use models of this robot",
                code="RID-ROBOT-OTHER",
            )
    if known:
        noise = np.maximum(known[-1].residual_nm, 1e-4 * noise)
    parameters = None
    if model is not None:
        parameters = _standard_values(planned, model)
    elif robot.cad is not None:
        parameters = cad_parameters(planned, robot)[0]
    return ExcitationProblem(
        robot=robot,
        period_s=period_s,
        harmonics=harmonics,
        criterion=criterion,
        limit_fraction=LIMIT_FRACTION,
        expected_noise_nm=noise,
        parameters=parameters,
        given=_information(base_parameters(planned), given) if given else None,
        workspace=cell.workspace,
        base_limits=_base_limits(cell, parameters, model),
        torque_share=CAD_TORQUE_SHARE if model is None else _torque_share(robot, planned, model),
    )


def _base_limits(
    cell: CellConfig, parameters: FloatArray | None, model: Estimate | None
) -> FloatArray | None:
    """Return the base limits if the cell has any and a model can predict the base wrench."""
    if cell.plate is None or cell.plate.limits is None or parameters is None:
        return None
    if model is not None and model.options.kind == "internal":
        return None
    return base_limits(cell.plate.limits)


def _torque_share(robot: RobotDescription, planned: RobotModel, model: Estimate) -> float:
    """Return the fraction of the torque limits that additional friction of `model` leaves free.

    Additional friction is that of the terms that the robot file does not have.
    """
    if model.options.kind == "external":
        return 1.0
    motion = _random_motion(robot, FRICTION_POSES)
    reference_k = np.array([joint.reference_temperature_k for joint in model.robot.joints])
    beyond = predict(model, *motion, Conditions(temperature_k=reference_k)) - torque(
        planned, *motion, _standard_values(planned, model)
    )
    limit = np.array([joint.limits.torque for joint in robot.joints])
    taken = np.abs(beyond).max(axis=0) / limit
    worst = int(np.argmax(taken))
    if taken[worst] >= LIMIT_FRACTION:
        raise ConfigError(
            f"the model of robot {model.robot.name!r} has friction terms that the robot file"
            f" lacks, with up to {taken[worst]:.0%} of the torque limit of"
            f" {robot.joint_names[worst]}: add these terms to the robot file, or correct the"
            " limit",
            code="RID-MODEL-TERMS-DIFFER",
        )
    return 1.0 if taken[worst] < ROUNDING else 1.0 - float(taken[worst])


def _predictions(robot: RobotDescription, model: RobotModel, base: BaseParameters) -> FloatArray:
    """Return regressor rows of the torques of random motions within the limits, (rows, b)."""
    motion = _random_motion(robot, TORQUE_POSES)
    return base.columns(regressor(model, *motion)).reshape(-1, len(base))


def _random_motion(robot: RobotDescription, rows: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return random positions, velocities and accelerations within the limits."""
    random = np.random.default_rng(0)
    limits = [joint.limits for joint in robot.joints]
    shape = (rows, len(limits))
    low, high = ([getattr(x, f"position_{end}") for x in limits] for end in ("min", "max"))
    q = random.uniform(low, high, shape)
    v = random.uniform(-1.0, 1.0, shape) * [each.velocity for each in limits]
    a = random.uniform(-1.0, 1.0, shape) * [each.acceleration for each in limits]
    return q, v, a


def _standard_values(planned: RobotModel, estimate: Estimate) -> FloatArray:
    """Return an estimate's parameters in the order of the planned model, 0 for missing ones."""
    standard = estimate.standard_values
    if estimate.options.kind != "internal":
        standard = estimate.base.to_standard(with_known_mass(estimate)[0])
    found = dict(zip(estimate.base.standard_names, standard, strict=True))
    return np.array([found.get(name, 0.0) for name in planned.parameter_names])


def _information(base: BaseParameters, given: Sequence[Estimate]) -> FloatArray:
    """Return the information of earlier estimates, divided by their numbers of samples.

    Friction is left out: it changes from day to day, and is estimated anew (theory: section 4).
    """
    information = np.zeros((len(base), len(base)))
    for estimate in map(with_rotors_in_links, given):
        carried = [k for k, rigid in enumerate(_lasting_parameters(estimate)) if rigid]
        words = [estimate.base.expressions[k] for k in carried]
        missing = [text for text in words if text not in base.expressions]
        if missing:
            raise ConfigError(
                f"the model of robot {estimate.robot.name!r} has the parameter {missing[0]},"
                " which this cell's robot does not have: use models of the same robot file with"
                " all its terms",
                code="RID-MODEL-TERMS-DIFFER",
            )
        places = [base.expressions.index(text) for text in words]
        covariance = estimate.covariance_residual[np.ix_(carried, carried)]
        samples = estimate.equations / len(estimate.robot.joints)
        information[np.ix_(places, places)] += np.linalg.inv(covariance) / samples
    return information


def _lasting_parameters(estimate: Estimate) -> list[bool]:
    """Return for each base parameter True unless it is friction, which changes over time."""
    friction = estimate.model.parameter_groups.get("friction", slice(0, 0))
    changing = set(range(*friction.indices(len(estimate.model.parameter_names))))
    return [head not in changing for head in estimate.base.kept]
