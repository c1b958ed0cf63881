"""The size of the joint-space inertia over a motion, out of an estimate's values."""

from __future__ import annotations

import numpy as np

from acquisition.arrays import FloatArray
from dynamics.conditions import Conditions
from dynamics.robot_model import RobotModel
from identification.base_parameters import BaseParameters
from identification.torque_columns import torque_columns, wrench_columns

POSES = 100


def inertia_size(
    model: RobotModel,
    base: BaseParameters,
    position: FloatArray,
    values: FloatArray,
    *,
    of_base: bool = False,
) -> FloatArray:
    """Return the RMS over some positions of each element of the inertia, shape (n, n).

    With `of_base`, (6, n): of the base wrench per unit acceleration of each joint.

    Parameters
    ----------
    model, base : RobotModel, BaseParameters
        The model and what of it can be identified.
    position : ndarray, shape (samples, n)
        Joint positions [rad or m].
    values : ndarray, shape (b,)
        Base parameters.
    """
    q = position[:: max(1, len(position) // POSES)]
    rest = np.zeros_like(q)
    conditions = Conditions(temperature_k=np.full(q.shape[1], 300.0))
    columns_of = wrench_columns if of_base else torque_columns
    still = columns_of(model, base, (q, rest, rest), conditions)
    columns = []
    for j in range(q.shape[1]):
        unit = rest.copy()
        unit[:, j] = 1.0
        moving = columns_of(model, base, (q, rest, unit), conditions)
        columns.append((moving - still) @ values)
    return np.asarray(np.sqrt(np.mean(np.square(columns), axis=1)).T)
