"""`KinematicParameter`: names of the parameters, and the set that measured points can show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from config.arrays import FloatArray
from dynamics.geometry.kinematics import Chain

Kind = Literal["frame", "point", "row", "compliance"]

_AXES: Final = ("x", "y", "z")
_ROW: Final = ("alpha", "beta", "theta", "a", "d")
_PARALLEL: Final = 0.996
"""Cosine of the angle, about 5 degrees, below which neighbouring axes count as nearly parallel."""
_DEPENDENT: Final = 1e-6
"""Part of a column, relative to its length, that must be independent of the columns before it."""
_WITHOUT_EFFECT: Final = 1e-9


@dataclass(frozen=True)
class KinematicParameter:
    """One parameter of a calibration.

    Attributes:
        kind: Base frame, measured point, row of the Denavit-Hartenberg table, or compliance.
        element: Frame: 0 to 2 position, 3 to 5 rotation. Point: 0 to 2. Row: alpha, beta, theta, a,
            d. Compliance: 0.
        joint: Index of the joint, for rows and compliances.
        name: Name for people.
        unit: SI unit of its change.
    """

    kind: Kind
    element: int
    joint: int
    name: str
    unit: str


def geometry_candidates(chain: Chain, joints: Sequence[str]) -> tuple[KinematicParameter, ...]:
    """Return all geometric parameters in the order in which they are preferred.

    Base frame and measured point come first. `choose_identifiable` then leaves out elements of the
    first and the last row that have the same effect on the point. Of each row, Hayati's angle beta
    comes before d if the two axes are nearly parallel, because d is then ill-conditioned (Hayati
    1983).

    Args:
        chain: The nominal geometry.
        joints: Names of the joints.
    """
    frame = [KinematicParameter("frame", k, 0, f"base {axis}", "m") for k, axis in enumerate(_AXES)]
    frame += [
        KinematicParameter("frame", 3 + k, 0, f"base rotation {axis}", "rad")
        for k, axis in enumerate(_AXES)
    ]
    point = [
        KinematicParameter("point", k, 0, f"point {axis}", "m") for k, axis in enumerate(_AXES)
    ]
    rows = [
        KinematicParameter(
            "row", element, joint, f"{name} {_ROW[element]}", "m" if element > 2 else "rad"
        )
        for joint, name in enumerate(joints)
        for element in _row_order(chain, joint)
    ]
    return (*frame, *point, *rows)


def compliance_candidates(chain: Chain, joints: Sequence[str]) -> tuple[KinematicParameter, ...]:
    """Return the compliances of all gears."""
    units = ["m/N" if sliding else "rad/(N m)" for sliding in chain.prismatic]
    return tuple(
        KinematicParameter("compliance", 0, joint, f"{name} compliance", unit)
        for joint, (name, unit) in enumerate(zip(joints, units, strict=True))
    )


def choose_identifiable(
    slopes: FloatArray, candidates: Sequence[KinematicParameter]
) -> tuple[KinematicParameter, ...]:
    """Return the candidates whose effect on the point is independent of the earlier ones.

    The number of chosen parameters is the rank of `slopes`. A parameter that is not chosen stays at
    its value: its effect is the same as a combination of chosen ones, or it has none.

    Args:
        slopes: Shape (samples, 3, candidates). Derivatives of the point.
        candidates: In the order of preference.
    """
    columns = slopes.reshape(-1, len(candidates))
    size = np.linalg.norm(columns, axis=0)
    is_gear = np.array([each.kind == "compliance" for each in candidates])
    largest = np.where(is_gear, size[is_gear].max(initial=0.0), size[~is_gear].max(initial=0.0))
    basis = np.zeros((len(columns), 0))
    chosen = []
    for column, each in enumerate(candidates):
        if size[column] <= _WITHOUT_EFFECT * largest[column]:
            continue
        left = columns[:, column] / size[column]
        for _ in range(2):  # twice, because once loses digits
            left = left - basis @ (basis.T @ left)
        length = float(np.linalg.norm(left))
        if length > _DEPENDENT:
            basis = np.column_stack([basis, left / length])
            chosen.append(each)
    return tuple(chosen)


def scaled_condition(slopes: FloatArray) -> float:
    """Return the condition number of slopes whose columns are scaled to length one."""
    columns = slopes.reshape(-1, slopes.shape[-1])
    return float(np.linalg.cond(columns / np.linalg.norm(columns, axis=0)))


def _row_order(chain: Chain, joint: int) -> tuple[int, ...]:
    alpha, beta, theta, a, d = range(5)
    is_parallel = joint > 0 and abs(chain.fixed_rotations[joint][2, 2]) > _PARALLEL
    return (theta, alpha, a, beta, d) if is_parallel else (theta, alpha, a, d, beta)
