"""`common_mistakes`: the common mistakes of wiring, units and files."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, combinations
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.wiring.mistakes import (
    DEGREES,
    ORDERS,
    Mistake,
    MistakeKind,
    factor_of_one,
    late_torques,
    order_mistake,
    position_factor,
    reversed_joint,
    robot_mistake,
    scale_mistake,
    torque_factor,
    zero_mistake,
)
from identification.wiring.signals import tried_delays_s

OFFSET_STEPS: Final = 12
TURN: Final = 2.0 * math.pi
FACTORS: Final = (2.0, 0.5, 10.0, 0.1)
TORQUE_FACTORS: Final = (*FACTORS, 1000.0, 0.001)
CLOCKS: Final = (0.9, 1.1, 2.0, 0.5, 10.0, 0.1, 1000.0, 0.001)
MOST_SIGN_SETS: Final = 7
"""Largest number of joints of a robot for which all sets of reversed torques are tried."""


def common_mistakes(robot: RobotDescription) -> Iterator[Mistake]:
    """Yield the common mistakes, one after the other.

    A wrong position of a coupled wrist can be wrong at the motor, as on a bus, or at the joint, as
    in a recording of joint positions. Both are tried, except for zero positions.

    Args:
        robot: The robot as described in its file.
    """
    n, coupling = len(robot.joints), _matrix(robot)
    for mistake in _of_wiring(robot):
        yield mistake
        if robot.coupling is not None and mistake.kind is not MistakeKind.POSITION_OFFSET:
            at_joints = mistake.at_joints(coupling)
            if not np.allclose(at_joints.position, mistake.position):
                yield at_joints
    for factor in CLOCKS:
        yield replace(scale_mistake(MistakeKind.CLOCK, (), factor, n=n), clock=factor)
    for delay_s in tried_delays_s():
        yield late_torques(n, (), delay_s)
    for other in _conventions(robot):
        yield robot_mistake(MistakeKind.CONVENTION, (), other)
    for joints, other in _couplings(robot):
        mistake = robot_mistake(MistakeKind.COUPLING, joints, other)
        # First the recorded positions are those of the motors, then those of the joints.
        yield mistake
        yield replace(mistake, position=np.linalg.inv(_matrix(other)) @ _matrix(robot))
    yield from torque_units(robot)


def _of_wiring(robot: RobotDescription) -> Iterator[Mistake]:
    """Yield mistakes of single or all positions and torques, except wrong torque units."""
    n = len(robot.joints)
    for j in range(n):
        yield from _of_joint(robot, j)
    yield from _signs(n)
    yield from _orders(n)
    yield from _position_units(robot)


def _position_units(robot: RobotDescription) -> Iterator[Mistake]:
    """Yield wrong units of all positions together."""
    n = len(robot.joints)
    for factor in (DEGREES, 1.0 / DEGREES):
        yield scale_mistake(
            MistakeKind.POSITION_FACTOR, (), factor, n=n, position=np.full(n, factor)
        )
    gears = np.array([abs(joint.gear_ratio) for joint in robot.joints])
    units = (
        ("in turns", np.full(n, TURN)),
        ("in mrad", np.full(n, 1e-3)),
        ("measured at the motor, before the gear", 1.0 / gears),
    )
    for what, factors in units:
        if np.any(factors != 1.0):
            typical = float(np.exp(np.mean(np.log(factors))))
            mistake = scale_mistake(MistakeKind.POSITION_FACTOR, (), typical, n=n, position=factors)
            yield replace(mistake, what=what)


def torque_units(robot: RobotDescription) -> Iterator[Mistake]:
    """Yield wrong units of all torques together; the right unit is N m at the joint.

    Rated torques are not in a robot file: the joints' torque limits are used instead.
    """
    n = len(robot.joints)
    limits = np.array([joint.limits.torque for joint in robot.joints])
    gears = np.array([abs(joint.gear_ratio) for joint in robot.joints])
    constants = [joint.torque_constant_nm_per_a for joint in robot.joints]
    units = [
        ("per mille of each joint's rated torque", limits / 1000.0),
        ("percent of each joint's rated torque", limits / 100.0),
        ("N m at the motor, before the gear", gears),
        ("mN m", np.full(n, 1e-3)),
    ]
    known = [value for value in constants if value is not None]
    if len(known) == n:
        units.append(("amperes, not N m", np.array(known)))
    for what, factors in units:
        if np.any(factors != 1.0):
            typical = float(np.exp(np.mean(np.log(factors))))
            yield replace(
                scale_mistake(MistakeKind.TORQUE_UNIT, (), typical, n=n, torque=factors), what=what
            )


def _of_joint(robot: RobotDescription, j: int) -> Iterator[Mistake]:
    n, gear = len(robot.joints), robot.joints[j].gear_ratio
    signs = factor_of_one(n, j, -1.0)
    yield scale_mistake(MistakeKind.POSITION_SIGN, (j,), -1.0, n=n, position=signs)
    yield reversed_joint(n, j)
    own = {abs(gear), 1.0 / abs(gear)} - {1.0}
    for factor in (*FACTORS, DEGREES, 1.0 / DEGREES, *sorted(own)):
        yield position_factor(n, j, factor)
    for factor in (*TORQUE_FACTORS, *sorted(own)):
        yield torque_factor(n, j, factor)
    if robot.joints[j].type == "revolute":
        for step in range(1, OFFSET_STEPS):
            angle = math.remainder(2.0 * math.pi * step / OFFSET_STEPS, 2.0 * math.pi)
            yield zero_mistake(robot, j, angle)


def _signs(n: int) -> Iterator[Mistake]:
    """Yield reversed torques for sets of joints, and reversed positions of all joints."""
    everyone = -np.ones(n)
    sizes = range(1, n + 1) if n <= MOST_SIGN_SETS else (1, n)
    for joints in chain.from_iterable(combinations(range(n), size) for size in sizes):
        yield reversed_torques(joints, n)
    yield scale_mistake(MistakeKind.POSITION_SIGN, (), -1.0, n=n, position=everyone)
    yield scale_mistake(MistakeKind.DIRECTION, (), -1.0, n=n, position=everyone, torque=everyone)


def reversed_torques(joints: tuple[int, ...], n: int) -> Mistake:
    """Return the mistake of a reversed torque sign for some of n joints."""
    factors = np.ones(n)
    factors[list(joints)] = -1.0
    named = () if 1 < len(joints) == n else joints
    return scale_mistake(MistakeKind.TORQUE_SIGN, named, -1.0, n=n, torque=factors)


def _orders(n: int) -> Iterator[Mistake]:
    """Yield wrong orders: two joints swapped, three in a cycle, all shifted by one or reversed."""
    for kind in ORDERS:
        for first, second in combinations(range(n), 2):
            order = list(range(n))
            order[first], order[second] = second, first
            yield order_mistake(kind, (first, second), order)
        for three in combinations(range(n), 3):
            for turned in ((1, 2, 0), (2, 0, 1)):
                order = list(range(n))
                for place, other in zip(three, turned, strict=True):
                    order[place] = three[other]
                yield order_mistake(kind, tuple(order), order)
        if n > 3:
            for order in ([*range(1, n), 0], [n - 1, *range(n - 1)], [*reversed(range(n))]):
                yield order_mistake(kind, tuple(order), order)


def _conventions(robot: RobotDescription) -> Iterator[RobotDescription]:
    """Yield the robot for the case that its kinematic table uses the other convention."""
    table = robot.kinematics
    other = "standard_dh" if table.convention == "modified_dh" else "modified_dh"
    if any(row.beta_rad for row in table.calibrated_rows):
        return  # Hayati's angle exists only in one convention
    yield robot.model_copy(update={"kinematics": table.model_copy(update={"convention": other})})


def _couplings(
    robot: RobotDescription,
) -> Iterator[tuple[tuple[int, ...], RobotDescription]]:
    """Yield robots with another wrist coupling: none, a changed one, or one of neighbours."""
    n, stated = len(robot.joints), robot.coupling
    if stated is not None:
        matrix = np.array(stated)
        coupled = matrix != np.eye(n)
        joints = tuple(np.flatnonzero(coupled.any(axis=0) | coupled.any(axis=1)).tolist())
        yield joints, robot.model_copy(update={"coupling": None})
        reversed_ = np.where(np.eye(n, dtype=bool), matrix, -matrix)
        for other in (reversed_, np.linalg.inv(matrix), matrix.T):
            if not np.allclose(other, matrix):
                yield joints, _with_coupling(robot, other)
        return
    for moved in range(max(1, n - 2), n):
        for sign in (1.0, -1.0):
            matrix = np.eye(n)
            matrix[moved, moved - 1] = sign
            yield (moved - 1, moved), _with_coupling(robot, matrix)


def _matrix(robot: RobotDescription) -> FloatArray:
    """Return C of q = C alpha."""
    n = len(robot.joints)
    return np.eye(n) if robot.coupling is None else np.array(robot.coupling, dtype=np.float64)


def _with_coupling(robot: RobotDescription, matrix: FloatArray) -> RobotDescription:
    rows = tuple(tuple(row) for row in matrix.tolist())
    return robot.model_copy(update={"coupling": rows})
