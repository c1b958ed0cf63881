"""Columns of the torque equations: base parameters, and derivatives of the nonlinear ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from config.arrays import BoolArray, FloatArray, IntArray
from dynamics.model.memory import presliding_of_model
from dynamics.model.nonlinear_slopes import nonlinear_slopes
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, load_torque, regressor
from dynamics.model.transmission import Transmission
from dynamics.terms.conditions import Conditions
from dynamics.terms.memory import Memory
from dynamics.terms.term import NonlinearTerm
from identification.model.base_parameters import BaseParameters


def torque_columns(
    model: RobotModel,
    base: BaseParameters,
    motion: tuple[FloatArray, FloatArray, FloatArray],
    conditions: Conditions | None = None,
    standard: FloatArray | None = None,
) -> FloatArray:
    """Return the base regressor and the derivatives with respect to the nonlinear parameters.

    Near nonlinear parameters xi0 and standard parameters theta0 the torque is, to first order,
    Phi(xi0) theta + S (xi - xi0) with S = d(Phi theta0)/d xi: Gauss-Newton's equations.

    Args:
        model: The model, at xi0.
        base: Its base parameters.
        motion: Tuple of (samples, n) arrays. q, v, a.
        conditions: Temperature and payload. The load is computed here, unless it is given.
        standard: Shape (parameters,). theta0. Without it there are no derivatives, and gears are
            lossless.

    Returns:
        (samples, n, b) array, or (samples, n, b + s) with theta0.
    """
    if standard is None:
        lossless = replace(model, transmission=Transmission())
        return base.columns(regressor(lossless, *motion, conditions))
    if model.transmission.losses and (conditions is None or conditions.load_nm is None):
        load = load_torque(model, *motion, standard, conditions)
        conditions = replace(conditions or Conditions(), load_nm=load)
    phi = regressor(model, *motion, conditions)
    if not model.nonlinear_names:
        return base.columns(phi)
    columns = np.empty((*phi.shape[:2], len(base) + len(model.nonlinear_names)))
    columns[:, :, : len(base)] = phi.take(base.kept, axis=2)
    columns[:, :, len(base) :] = nonlinear_slopes(model, *motion, standard, conditions)
    return columns


def changing_columns(model: RobotModel, base: BaseParameters) -> BoolArray:
    """Return a mask of the base columns that depend on nonlinear parameters, (b,).

    Gear losses are not considered: they change all transmitted torques.
    """
    changing = np.zeros(len(model.parameter_names), dtype=bool)
    for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True):
        if isinstance(term, NonlinearTerm):
            changing[columns] = term.changing
    return changing[list(base.kept)]


def changing_torque_columns(
    model: RobotModel,
    base: BaseParameters,
    motion: tuple[FloatArray, FloatArray, FloatArray],
    conditions: Conditions | None = None,
    standard: FloatArray | None = None,
) -> FloatArray:
    """Return the columns of `torque_columns` in `changing_columns`, followed by the derivatives.

    Gears are lossless here.
    """
    some = replace(
        model,
        terms=tuple(
            term.with_changing_only() for term in model.terms if isinstance(term, NonlinearTerm)
        ),
        transmission=Transmission(),
    )
    kept = {name: i for i, name in enumerate(some.parameter_names)}
    heads = [kept[name] for name in base.names if name in kept]
    columns = regressor(some, *motion, conditions)[:, :, heads]
    if standard is None:
        return columns
    return np.concatenate([columns, nonlinear_slopes(model, *motion, standard, conditions)], axis=2)


def wrench_columns(
    model: RobotModel,
    base: BaseParameters,
    motion: tuple[FloatArray, FloatArray, FloatArray],
    conditions: Conditions | None = None,
    standard: FloatArray | None = None,
) -> FloatArray:
    """Return the columns of the base wrench as `torque_columns` does, (samples, 6, b or b + s).

    The nonlinear parameters act inside the robot and have no effect on the base wrench.
    """
    columns = base.columns(base_wrench_regressor(model, *motion, conditions))
    if standard is None or not model.nonlinear_names:
        return columns
    return np.concatenate(
        [columns, np.zeros((*columns.shape[:2], len(model.nonlinear_names)))], axis=2
    )


def torque_structure(model: RobotModel, base: BaseParameters, slopes: bool) -> tuple[IntArray, ...]:
    """Return for each joint the indices of `torque_columns` on which its torque can depend.

    Preceding links do not affect a joint's torque; the zero columns are found on random motions.
    """
    random = np.random.default_rng(0)
    motion = tuple(random.normal(size=(3, 20, model.chain.n)))
    standard = random.normal(size=len(model.parameter_names)) if slopes else None
    warm = np.full(model.chain.n, 310.0)
    seen = np.zeros(
        (model.chain.n, len(base) + (len(model.nonlinear_names) if slopes else 0)), bool
    )
    directions = random.uniform(-1.0, 1.0, (3, 20, model.chain.n))
    own = tuple(each.joint for each in presliding_of_model(model))
    direction, by_distance, by_share = directions[:, :, own]
    known = np.ones((20, len(own)), dtype=bool)
    memory = Memory(own, direction, by_distance, by_share, known)
    for payload in (False, True):
        conditions = Conditions(temperature_k=warm, payload=payload, memory=memory)
        columns = torque_columns(model, base, motion, conditions, standard)
        seen |= np.any(columns != 0.0, axis=0)
    return tuple(np.flatnonzero(row) for row in seen)
