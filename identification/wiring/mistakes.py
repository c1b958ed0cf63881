"""`Mistake`: a possible difference between a robot and its files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.wiring.signals import WiredSignals

DEGREES: Final = math.pi / 180.0
ROUNDING: Final = 1e-12


class MistakeKind(StrEnum):
    """Kind of a mistake."""

    POSITION_SIGN = "position sign"
    POSITION_FACTOR = "position factor"
    POSITION_OFFSET = "zero position"
    POSITION_ORDER = "order of positions"
    TORQUE_SIGN = "torque sign"
    TORQUE_FACTOR = "torque factor"
    TORQUE_ORDER = "order of torques"
    TORQUE_UNIT = "torque unit"
    TORQUE_QUANTITY = "torque quantity"
    DIRECTION = "direction"
    AXIS_ORDER = "order of axes"
    CLOCK = "clock"
    TORQUE_TIME = "time of torques"
    CONVENTION = "convention"
    COUPLING = "coupling"
    MOUNTING = "mounting"
    GRAVITY_REMOVED = "gravity removed"
    KINEMATICS = "kinematics"


ORDERS: Final = (MistakeKind.POSITION_ORDER, MistakeKind.TORQUE_ORDER, MistakeKind.AXIS_ORDER)


@dataclass(frozen=True, eq=False)
class Mistake:
    """One mistake, described by the correction of the stated signals.

    Attributes:
        kind: Kind of the mistake.
        joints: Joints concerned, from 0; empty for all joints. For a wrong order: if all joints are
            listed, joint i's signal is in the columns of joint `joints[i]`; otherwise the two are
            swapped.
        factor: Factor for the stated values; for a zero position the angle to add [rad], for a
            clock the true seconds per second of the time stamps, for late torques the delay [s].
        position, torque: Shape (n, n). Matrices from stated to true positions and torques.
        offset_rad: Shape (n,). Offset to add to positions [rad or m].
        clock: True seconds per second of the time stamps.
        robot: The correct robot, if the mistake is in its file.
        what: The unit or the quantity of torques or positions, or the mistake in the kinematic
            table, in words; empty for other mistakes.
    """

    kind: MistakeKind
    joints: tuple[int, ...]
    factor: float
    position: FloatArray
    torque: FloatArray
    offset_rad: FloatArray
    clock: float = 1.0
    robot: RobotDescription | None = field(default=None)
    what: str = ""

    @property
    def is_first_zero(self) -> bool:
        """True for a wrong zero position of the first joint."""
        return self.kind is MistakeKind.POSITION_OFFSET and self.joints == (0,)

    @property
    def delay_s(self) -> float:
        """Delay of the torques of `changed` [s]."""
        return self.factor if self.kind is MistakeKind.TORQUE_TIME else 0.0

    @property
    def moves(self) -> bool:
        """True if the correction changes the motion or the robot, not only the torques."""
        n = len(self.offset_rad)
        still = np.array_equal(self.position, np.eye(n)) and not self.offset_rad.any()
        return self.robot is not None or self.clock != 1.0 or not still

    @property
    def multiplies(self) -> bool:
        """True if the correction only multiplies the torques by a matrix, row by row."""
        return not (self.moves or self.delay_s)

    @property
    def changes_torque(self) -> bool:
        """True if the correction changes the torques."""
        return not np.array_equal(self.torque, np.eye(len(self.offset_rad)))

    @property
    def changed(self) -> tuple[int, ...]:
        """The joints whose values the correction changes, from 0."""
        everyone = tuple(range(len(self.offset_rad)))
        if self.kind in ORDERS and len(self.joints) == len(everyone):
            return tuple(i for i, other in enumerate(self.joints) if i != other)
        return self.joints or everyone

    def at_joints(self, coupling: FloatArray) -> Mistake:
        """Return the same mistake in the positions of the joints instead of the motors.

        Args:
            coupling: Shape (n, n). C of q = C alpha.
        """
        moved = np.linalg.solve(coupling, self.position @ coupling)
        position: FloatArray = np.asarray(moved, dtype=np.float64)
        position[np.abs(position) < ROUNDING * np.abs(position).max()] = 0.0
        return replace(self, position=position)

    def correct(self, signals: WiredSignals) -> WiredSignals:
        """Return signals and robot with this mistake corrected."""
        right = signals.transform(self.position, self.offset_rad, self.clock)
        torque_nm = signals.torque_recorded_later(self.delay_s, self.changed) @ self.torque.T
        shifted_nm = None if signals.shifted_nm is None else signals.shifted_nm @ self.torque.T
        return replace(
            right,
            robot=self.robot or signals.robot,
            torque_nm=torque_nm,
            shifted_nm=None if self.delay_s else shifted_nm,
        )


def scale_mistake(
    kind: MistakeKind,
    joints: tuple[int, ...],
    factor: float,
    *,
    n: int,
    position: FloatArray | None = None,
    torque: FloatArray | None = None,
) -> Mistake:
    """Return a mistake with one factor per joint (n,); without factors nothing is scaled."""
    ones = np.ones(n)
    return Mistake(
        kind,
        joints,
        factor,
        np.diag(ones if position is None else position),
        np.diag(ones if torque is None else torque),
        np.zeros(n),
    )


def position_factor(n: int, joint: int, factor: float) -> Mistake:
    """Return the mistake of a factor in the position of one of n joints."""
    factors = factor_of_one(n, joint, factor)
    return scale_mistake(MistakeKind.POSITION_FACTOR, (joint,), factor, n=n, position=factors)


def torque_factor(n: int, joint: int, factor: float) -> Mistake:
    """Return the mistake of a factor in the torque of one of n joints."""
    factors = factor_of_one(n, joint, factor)
    return scale_mistake(MistakeKind.TORQUE_FACTOR, (joint,), factor, n=n, torque=factors)


def reversed_joint(n: int, joint: int) -> Mistake:
    """Return the mistake of a wrong sign of position and torque of one of n joints."""
    signs = factor_of_one(n, joint, -1.0)
    return scale_mistake(MistakeKind.DIRECTION, (joint,), -1.0, n=n, position=signs, torque=signs)


def factor_of_one(n: int, joint: int, factor: float) -> FloatArray:
    """Return the factors of n joints, (n,), of which only one differs from 1."""
    factors = np.ones(n)
    factors[joint] = factor
    return factors


def zero_mistake(robot: RobotDescription, joint: int, offset_rad: float) -> Mistake:
    """Return the mistake of a wrong zero position."""
    n = len(robot.joints)
    shift = np.zeros(n)
    shift[joint] = offset_rad
    return replace(
        scale_mistake(MistakeKind.POSITION_OFFSET, (joint,), offset_rad, n=n), offset_rad=shift
    )


def order_mistake(kind: MistakeKind, joints: tuple[int, ...], order: Sequence[int]) -> Mistake:
    """Return a mistake of one of the `ORDERS`: joint i's signal is in place order[i]."""
    whole = np.eye(len(order))
    right = whole[list(order)]
    position = whole if kind is MistakeKind.TORQUE_ORDER else right
    torque = whole if kind is MistakeKind.POSITION_ORDER else right
    return Mistake(kind, joints, 1.0, position, torque, np.zeros(len(order)))


def robot_mistake(kind: MistakeKind, joints: tuple[int, ...], right: RobotDescription) -> Mistake:
    """Return a mistake of the robot file, from the correct robot."""
    return replace(scale_mistake(kind, joints, 1.0, n=len(right.joints)), robot=right)


def late_torques(n: int, joints: tuple[int, ...], delay_s: float) -> Mistake:
    """Return the mistake of late torques of some of n joints; no joints stand for all."""
    return scale_mistake(MistakeKind.TORQUE_TIME, joints, delay_s, n=n)
