"""Magnitude of the joint-space inertia over a motion, from an estimate's values."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from config.arrays import FloatArray
from dynamics.model.robot_model import RobotModel
from dynamics.terms.conditions import Conditions
from identification.model.base_parameters import BaseParameters
from identification.model.torque_columns import torque_columns, wrench_columns

POSES = 100


def inertia_size(
    model: RobotModel, base: BaseParameters, position: FloatArray, values: FloatArray
) -> FloatArray:
    """Return the RMS over some positions of each element of the inertia, shape (n, n).

    Args:
        model: The robot model.
        base: Its base parameters.
        position: Shape (samples, n). Joint positions [rad or m].
        values: Shape (b,). Values of the base parameters.
    """
    columns = _per_acceleration(model, base, position, values, torque_columns)
    return np.asarray(np.sqrt(np.mean(np.square(columns), axis=1)).T)


def base_inertia_squares(
    model: RobotModel, base: BaseParameters, position: FloatArray, values: FloatArray
) -> FloatArray:
    """Return the mean over some positions of g g^T, shape (n, 6, 6).

    g is the base wrench per unit acceleration of a joint. Parameters are as for `inertia_size`.
    """
    columns = _per_acceleration(model, base, position, values, wrench_columns)
    return np.asarray(np.einsum("jpr,jps->jrs", columns, columns) / columns.shape[1])


def _per_acceleration(
    model: RobotModel,
    base: BaseParameters,
    position: FloatArray,
    values: FloatArray,
    columns_of: Callable[..., FloatArray],
) -> FloatArray:
    """Return the outputs for a unit acceleration of each joint, (n, poses, outputs)."""
    q = position[:: max(1, len(position) // POSES)]
    rest = np.zeros_like(q)
    conditions = Conditions(temperature_k=np.full(q.shape[1], 300.0))
    still = columns_of(model, base, (q, rest, rest), conditions)
    columns = []
    for j in range(q.shape[1]):
        unit = rest.copy()
        unit[:, j] = 1.0
        moving = columns_of(model, base, (q, rest, unit), conditions)
        columns.append((moving - still) @ values)
    return np.array(columns)
