"""`at_temperature`: an estimate with temperature-dependent friction, evaluated at one temperature.

A command that is computed before a motion cannot use a measured temperature. At a fixed temperature
T, friction with the temperature coefficient k is friction without this dependence, f + k (T - T0);
its covariance is that of the sum.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from config.arrays import BoolArray, FloatArray
from config.errors import EstimationError
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import Joint
from dynamics.model.robot_model import RobotModel
from dynamics.terms.friction import Friction, FrictionColumn
from dynamics.terms.friction_functions import FrictionFunction
from identification.estimation.estimate import Estimate
from identification.estimation.transformed import transform

_BY_TEMPERATURE: Final[dict[FrictionFunction, tuple[FrictionFunction, ...]]] = {
    "coulomb_by_temperature": ("coulomb", "forward", "backward"),
    "viscous_by_temperature": ("viscous",),
}
"""For each temperature-dependent function: the joint's functions that take over its effect."""


def depends_on_temperature(estimate: Estimate) -> BoolArray:
    """Return a mask of the joints whose friction depends on temperature, (n,)."""
    found = np.zeros(len(estimate.robot.joints), dtype=bool)
    for column in _columns(estimate.model):
        found[column.joint] |= column.function in _BY_TEMPERATURE
    return found


def at_temperature(estimate: Estimate, temperature_k: FloatArray) -> Estimate:
    """Return an estimate without the friction term `temperature`, for one temperature per joint.

    Args:
        estimate: The identified estimate.
        temperature_k: Shape (n,). Temperature of each joint's drive [K]; any value for a joint
            whose friction does not depend on temperature.

    Raises:
        EstimationError: The number of temperatures is not the number of joints.
    """
    joints = estimate.robot.joints
    if np.shape(temperature_k) != (len(joints),):
        raise EstimationError(
            f"{np.size(temperature_k)} temperatures are given, but the model has {len(joints)}"
            " joints: give one temperature for each joint",
            code="RID-API-ARGUMENT",
        )
    if not depends_on_temperature(estimate).any():
        return estimate
    terms = estimate.options.friction_terms
    own = tuple(
        _without_temperature_term(joint, joint.friction if terms is None else terms)
        for joint in joints
    )
    robot = estimate.robot.model_copy(update={"joints": own})
    options = replace(estimate.options, friction_terms=None)
    model = options.build(robot)
    matrix = _matrix_at_temperature(estimate.model, model, temperature_k)
    return replace(transform(estimate, robot, options, matrix), warming=None)


def _without_temperature_term(joint: Joint, terms: tuple[FrictionTerm, ...]) -> Joint:
    """Return a joint without the term `temperature`, but with the terms that replace it."""
    if "temperature" not in terms:
        return joint.model_copy(update={"friction": terms})
    rest = [term for term in terms if term != "temperature"]
    if not {"coulomb", "asymmetric"} & set(rest):
        rest.append("coulomb")
    if "viscous" not in rest:
        rest.append("viscous")
    return joint.model_copy(update={"friction": tuple(rest)})


def _matrix_at_temperature(
    model: RobotModel, plain: RobotModel, temperature_k: FloatArray
) -> FloatArray:
    """Return the matrix (p', p) from a model's standard parameters to those at a temperature."""
    old = {name: k for k, name in enumerate(model.parameter_names)}
    new = {name: k for k, name in enumerate(plain.parameter_names)}
    matrix = np.zeros((len(new), len(old)))
    for name, k in new.items():
        if name in old:
            matrix[k, old[name]] = 1.0
    for column in _columns(model):
        for other in _columns(plain):
            targets = _BY_TEMPERATURE.get(column.function, ())
            if other.joint == column.joint and other.function in targets:
                warmer_k = temperature_k[column.joint] - column.reference_temperature_k
                matrix[new[other.parameter_name], old[column.parameter_name]] = warmer_k
    return matrix


def _columns(model: RobotModel) -> tuple[FrictionColumn, ...]:
    return tuple(c for term in model.terms if isinstance(term, Friction) for c in term.columns)
