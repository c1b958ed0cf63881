"""`Mistake`: what may be wrong between a robot and what its files say of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import combinations
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.wiring.signals import WiredSignals

OFFSET_STEPS: Final = 12
FACTORS: Final = (2.0, 0.5, 10.0, 0.1)
TORQUE_FACTORS: Final = (*FACTORS, 1000.0, 0.001)
CLOCKS: Final = (0.9, 1.1, 2.0, 0.5, 10.0, 0.1, 1000.0, 0.001)
DEGREES: Final = math.pi / 180.0


class Kind(StrEnum):
    """What kind of mistake it is."""

    POSITION_SIGN = "position sign"
    POSITION_FACTOR = "position factor"
    POSITION_OFFSET = "zero position"
    POSITION_ORDER = "order of positions"
    TORQUE_SIGN = "torque sign"
    TORQUE_FACTOR = "torque factor"
    TORQUE_ORDER = "order of torques"
    DIRECTION = "direction"
    AXIS_ORDER = "order of axes"
    CLOCK = "clock"
    CONVENTION = "convention"
    COUPLING = "coupling"
    MOUNTING = "mounting"


@dataclass(frozen=True, eq=False)
class Mistake:
    """One mistake, as what has to be done to the stated signals to undo it.

    Attributes
    ----------
    kind : Kind
        What is wrong.
    joints : tuple of int
        Of which joints, from 0; none where all are meant. Of an order: joint i's signal stands at
        joint `joints[i]`'s place where all are named, else the two are swapped.
    factor : float
        What the stated numbers must be multiplied with; of a zero position what must be added
        [rad], of a clock the seconds that a second of the stamps is.
    position, torque : ndarray, shape (n, n)
        Right positions and torques are these times the stated ones.
    offset_rad : ndarray, shape (n,)
        What is added to positions [rad or m].
    clock : float
        Seconds that a second of the time stamps is.
    robot : RobotDescription or None
        The right robot, where the mistake is in its file.
    """

    kind: Kind
    joints: tuple[int, ...]
    factor: float
    position: FloatArray
    torque: FloatArray
    offset_rad: FloatArray
    clock: float = 1.0
    robot: RobotDescription | None = field(default=None)

    @property
    def moves(self) -> bool:
        """Whether undoing it changes the motion or the robot, not the torques alone."""
        n = len(self.offset_rad)
        still = np.array_equal(self.position, np.eye(n)) and not self.offset_rad.any()
        return self.robot is not None or self.clock != 1.0 or not still

    def undone(self, signals: WiredSignals) -> WiredSignals:
        """Return signals and robot as they are where this mistake was made."""
        right = signals.moved(self.position, self.offset_rad, self.clock)
        torque_nm = signals.torque_nm @ self.torque.T
        return replace(right, robot=self.robot or signals.robot, torque_nm=torque_nm)


def common_mistakes(robot: RobotDescription) -> Iterator[Mistake]:
    """Yield the mistakes that people make, one after the other.

    Parameters
    ----------
    robot : RobotDescription
        The robot as its file says it is.
    """
    n = len(robot.joints)
    for j in range(n):
        yield from _of_joint(robot, j)
    for kind in (Kind.POSITION_ORDER, Kind.TORQUE_ORDER, Kind.AXIS_ORDER):
        for first, second in combinations(range(n), 2):
            order = list(range(n))
            order[first], order[second] = second, first
            yield _order(kind, (first, second), order)
        if n > 2:
            for order in ([*range(1, n), 0], [n - 1, *range(n - 1)], [*reversed(range(n))]):
                yield _order(kind, tuple(order), order)
    everyone = np.ones(n)
    for factor in (DEGREES, 1.0 / DEGREES):
        yield _mistake(Kind.POSITION_FACTOR, (), factor, position=factor * everyone)
    for factor in CLOCKS:
        yield replace(_mistake(Kind.CLOCK, (), factor, position=everyone), clock=factor)
    for other in _conventions(robot):
        yield replace(_mistake(Kind.CONVENTION, (), 1.0, position=everyone), robot=other)
    for joints, other in _couplings(robot):
        mistake = replace(_mistake(Kind.COUPLING, joints, 1.0, position=everyone), robot=other)
        yield mistake  # the motors' positions are right, and the joints' follow from them
        yield replace(mistake, position=np.linalg.inv(_matrix(other)) @ _matrix(robot))
    for other in _mountings(robot):
        yield replace(_mistake(Kind.MOUNTING, (), 1.0, position=everyone), robot=other)


def offset(robot: RobotDescription, joint: int, offset_rad: float) -> Mistake:
    """Return the mistake of a zero position that lies elsewhere."""
    n = len(robot.joints)
    shift = np.zeros(n)
    shift[joint] = offset_rad
    mistake = _mistake(Kind.POSITION_OFFSET, (joint,), offset_rad, position=np.ones(n))
    return replace(mistake, offset_rad=shift)


def _of_joint(robot: RobotDescription, j: int) -> Iterator[Mistake]:
    n, gear = len(robot.joints), robot.joints[j].gear_ratio

    def scaled(factor: float) -> FloatArray:
        values = np.ones(n)
        values[j] = factor
        return values

    yield _mistake(Kind.POSITION_SIGN, (j,), -1.0, position=scaled(-1.0))
    yield _mistake(Kind.TORQUE_SIGN, (j,), -1.0, torque=scaled(-1.0))
    yield _mistake(Kind.DIRECTION, (j,), -1.0, position=scaled(-1.0), torque=scaled(-1.0))
    own = {abs(gear), 1.0 / abs(gear)} - {1.0}
    for factor in (*FACTORS, DEGREES, 1.0 / DEGREES, *sorted(own)):
        yield _mistake(Kind.POSITION_FACTOR, (j,), factor, position=scaled(factor))
    for factor in (*TORQUE_FACTORS, *sorted(own)):
        yield _mistake(Kind.TORQUE_FACTOR, (j,), factor, torque=scaled(factor))
    if robot.joints[j].type == "revolute":
        for step in range(1, OFFSET_STEPS):
            angle = math.remainder(2.0 * math.pi * step / OFFSET_STEPS, 2.0 * math.pi)
            yield offset(robot, j, angle)


def _mistake(
    kind: Kind,
    joints: tuple[int, ...],
    factor: float,
    *,
    position: FloatArray | None = None,
    torque: FloatArray | None = None,
) -> Mistake:
    """Return a mistake of factors (n,), one a joint."""
    n = len(position if position is not None else torque if torque is not None else ())
    whole = np.eye(n)
    return Mistake(
        kind,
        joints,
        factor,
        whole if position is None else np.diag(position),
        whole if torque is None else np.diag(torque),
        np.zeros(n),
    )


def _order(kind: Kind, joints: tuple[int, ...], order: list[int]) -> Mistake:
    whole = np.eye(len(order))
    right = whole[order]
    position = whole if kind is Kind.TORQUE_ORDER else right
    torque = whole if kind is Kind.POSITION_ORDER else right
    return Mistake(kind, joints, 1.0, position, torque, np.zeros(len(order)))


def _conventions(robot: RobotDescription) -> Iterator[RobotDescription]:
    """Yield the robot with its table read by the other convention."""
    table = robot.kinematics
    other = "standard_dh" if table.convention == "modified_dh" else "modified_dh"
    if any(row.beta_rad for row in table.calibrated_rows):
        return  # Hayati's angle exists in one convention only
    yield robot.model_copy(update={"kinematics": table.model_copy(update={"convention": other})})


def _couplings(
    robot: RobotDescription,
) -> Iterator[tuple[tuple[int, ...], RobotDescription]]:
    """Yield robots with another coupling: none, reversed, or one of neighbours where none is."""
    n, stated = len(robot.joints), robot.coupling
    if stated is not None:
        matrix = np.array(stated)
        joints = tuple(np.flatnonzero((matrix != np.eye(n)).any(axis=1)).tolist())
        yield joints, robot.model_copy(update={"coupling": None})
        reversed_ = np.where(np.eye(n, dtype=bool), matrix, -matrix)
        for other in (reversed_, np.linalg.inv(matrix), matrix.T):
            if not np.allclose(other, matrix):
                yield joints, _coupled(robot, other)
        return
    for moved in range(max(1, n - 2), n):
        for sign in (1.0, -1.0):
            matrix = np.eye(n)
            matrix[moved, moved - 1] = sign
            yield (moved - 1, moved), _coupled(robot, matrix)


def _matrix(robot: RobotDescription) -> FloatArray:
    """Return C of q = C alpha."""
    n = len(robot.joints)
    return np.eye(n) if robot.coupling is None else np.array(robot.coupling, dtype=np.float64)


def _mountings(robot: RobotDescription) -> Iterator[RobotDescription]:
    """Yield the robot on the ceiling and on walls, where its file says the floor, and so on."""
    stated = np.array(robot.gravity_m_s2)
    size = float(np.linalg.norm(stated))
    for axis in (*np.eye(3), *-np.eye(3)):
        if stated @ axis < 0.99 * size:
            gravity = tuple((size * axis).tolist())
            yield robot.model_copy(update={"gravity_m_s2": gravity})


def _coupled(robot: RobotDescription, matrix: FloatArray) -> RobotDescription:
    rows = tuple(tuple(row) for row in matrix.tolist())
    return robot.model_copy(update={"coupling": rows})
