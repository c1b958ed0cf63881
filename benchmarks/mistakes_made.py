"""Mistakes that `benchmarks.mistakes` injects into copies of a correct recording."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from benchmarks.sound_robots import SoundRecording
from config.arrays import FloatArray
from config.load import load_robot
from config.robot.robot import RobotDescription
from identification.wiring.mistakes import MistakeKind

DEGREE: Final = math.pi / 180.0
ALL_ROWS: Final = slice(None)
OTHERS: Final = {"kr15": "ur10e", "ur10e": "kr15"}


@dataclass(frozen=True, eq=False)
class UserFiles:
    """Files of an engineer: a table of recorded columns, its column map and the robot file.

    Attributes:
        robot: Content of the robot file.
        time_s: Shape (samples,). Time stamps [s].
        position, torque_nm: Shape (samples, n). Link side [rad, N m].
        gravity_nm: Shape (samples, n). Gravity torques contained in `torque_nm`; for a real arm,
            from its CAD data.
        unit: Unit of the positions according to the map.
        velocity: Shape (samples, n). Recorded velocities [rad/s]; None without such columns.
    """

    robot: RobotDescription
    time_s: FloatArray
    position: FloatArray
    torque_nm: FloatArray
    gravity_nm: FloatArray
    unit: str = "rad"
    velocity: FloatArray | None = None

    @classmethod
    def of(cls, sound: SoundRecording, rows: slice = ALL_ROWS) -> UserFiles:
        """Return some rows of a recording and its robot file, without any mistake."""
        return cls(
            sound.robot,
            sound.time_s[rows],
            sound.position[rows],
            sound.torque_nm[rows],
            sound.gravity_nm[rows],
        )

    @property
    def table(self) -> FloatArray:
        """Table of the columns that `map_text` describes."""
        columns = [self.time_s, self.position, self.torque_nm]
        return np.column_stack(columns if self.velocity is None else [*columns, self.velocity])

    @property
    def map_text(self) -> str:
        """Column map of the table."""
        n = len(self.robot.joints)
        lines = [
            "name: arm",
            "robot: robot.yaml",
            f"columns: {1 + (2 if self.velocity is None else 3) * n}",
            "time: {column: 0}",
            f"units: {{position: {self.unit}}}",
            "torques: motor_torque",
            "joints:",
        ]
        for j, name in enumerate(self.robot.joint_names):
            velocity = "" if self.velocity is None else f", velocity: {1 + 2 * n + j}"
            columns = f"position: {1 + j}, torque: {1 + n + j}{velocity}"
            lines.append(f"  - {{joint: {name}, {columns}}}")
        return "\n".join(lines) + "\n"


@dataclass(frozen=True, eq=False)
class InjectedMistake:
    """An injected mistake.

    Attributes:
        name: Description of the change.
        kinds: Kinds of mistake that count as a correct diagnosis.
        joints: Indices of the joints that must be named; empty if the mistake concerns all joints.
        stated: The user's files with the mistake.
        shown: True if the mistake is detectable although the wrong model fits as well as the true
            one.
    """

    name: str
    kinds: tuple[MistakeKind, ...]
    joints: tuple[int, ...]
    stated: UserFiles
    shown: bool = False


def mistakes(sound: UserFiles) -> Iterator[InjectedMistake]:
    """Yield copies of a correct recording, each with one mistake."""
    n = len(sound.robot.joints)
    yield from _of_one_joint(sound, 1)
    yield from _of_one_joint(sound, n - 1)
    for first, second in sorted({(0, 1), (1, 2), (n - 2, n - 1)}):
        order = list(range(n))
        order[first], order[second] = second, first
        yield from _orders(
            sound, f"axes {first + 1} and {second + 1} swapped", (first, second), order
        )
    for name, order in (
        ("shifted by one", [*range(1, n), 0]),
        ("in reverse order", [*reversed(range(n))]),
    ):
        yield from _orders(sound, name, None, order)
    if n > 3:
        for order in ([1, 2, 0, *range(3, n)], [0, 1, 4, 2, 3, *range(5, n)]):
            yield from _orders(sound, f"three in a cycle {order}", None, order)
    yield from _of_all(sound)
    yield from _of_torques(sound)
    yield from _of_velocities(sound)
    yield from _of_the_robot(sound)


def _of_one_joint(sound: UserFiles, j: int) -> Iterator[InjectedMistake]:
    gear, one = abs(sound.robot.joints[j].gear_ratio), f"axis {j + 1}"

    def moved(change: Callable[[FloatArray], FloatArray]) -> UserFiles:
        position = sound.position.copy()
        position[:, j] = change(position[:, j])
        return replace(sound, position=position)

    def driven(factor: float) -> UserFiles:
        torque_nm = sound.torque_nm.copy()
        torque_nm[:, j] *= factor
        return replace(sound, torque_nm=torque_nm)

    signs = (MistakeKind.POSITION_SIGN, MistakeKind.TORQUE_SIGN, MistakeKind.DIRECTION)
    yield InjectedMistake(f"{one}: position backwards", signs, (j,), moved(lambda q: -q))
    yield InjectedMistake(f"{one}: torque backwards", signs, (j,), driven(-1.0))
    both = replace(moved(lambda q: -q), torque_nm=driven(-1.0).torque_nm)
    yield InjectedMistake(f"{one}: position and torque backwards", signs, (j,), both)
    factors = (MistakeKind.POSITION_FACTOR,)
    for factor in (2.0, 0.5, 10.0, 0.1, DEGREE, 1.0 / DEGREE, gear, 1.0 / gear):
        stated = moved(lambda q, factor=factor: factor * q)  # type: ignore[misc]
        yield InjectedMistake(f"{one}: position times {factor:.4g}", factors, (j,), stated)
    for factor in (2.0, 0.5, 10.0, 0.1, 1000.0, 0.001, gear, 1.0 / gear):
        kinds = (MistakeKind.TORQUE_FACTOR,)
        yield InjectedMistake(f"{one}: torque times {factor:.4g}", kinds, (j,), driven(factor))
    for degrees in (90.0, -90.0, 180.0, 30.0):
        stated = moved(lambda q, degrees=degrees: q + degrees * DEGREE)  # type: ignore[misc]
        yield InjectedMistake(
            f"{one}: zero position off by {degrees:g} degrees",
            (MistakeKind.POSITION_OFFSET,),
            (j,),
            stated,
        )


def _orders(
    sound: UserFiles, name: str, joints: tuple[int, ...] | None, order: list[int]
) -> Iterator[InjectedMistake]:
    own = tuple(np.argsort(order).tolist()) if joints is None else joints
    moved = tuple(i for i, other in enumerate(order) if i != other)
    own = moved if len(moved) == 2 else own
    position, torque_nm = sound.position[:, order], sound.torque_nm[:, order]
    kind = MistakeKind.POSITION_ORDER
    yield InjectedMistake(f"positions: {name}", (kind,), own, replace(sound, position=position))
    kind = MistakeKind.TORQUE_ORDER
    yield InjectedMistake(f"torques: {name}", (kind,), own, replace(sound, torque_nm=torque_nm))
    both = replace(sound, position=position, torque_nm=torque_nm)
    yield InjectedMistake(f"columns: {name}", (MistakeKind.AXIS_ORDER,), own, both)


def _of_all(sound: UserFiles) -> Iterator[InjectedMistake]:
    in_degrees = replace(sound, position=sound.position / DEGREE)
    yield InjectedMistake("degrees read as radians", (MistakeKind.POSITION_FACTOR,), (), in_degrees)
    gears = np.array([abs(joint.gear_ratio) for joint in sound.robot.joints])
    for name, factors in (
        ("in turns", np.full(len(gears), 0.5 / math.pi)),
        ("in mrad", np.full(len(gears), 1000.0)),
        ("of the motors", gears),
    ):
        if np.any(factors != 1.0):
            unit = replace(sound, position=sound.position * factors)
            yield InjectedMistake(f"positions {name}", (MistakeKind.POSITION_FACTOR,), (), unit)
    as_degrees = replace(sound, unit="deg")
    yield InjectedMistake("radians read as degrees", (MistakeKind.POSITION_FACTOR,), (), as_degrees)
    for name, factor in (
        ("10 % fast", 1.0 / 0.9),
        ("10 % slow", 1.0 / 1.1),
        ("twice as fast", 0.5),
        ("in milliseconds", 1000.0),
    ):
        timed = replace(sound, time_s=factor * sound.time_s)
        yield InjectedMistake(f"clock: {name}", (MistakeKind.CLOCK,), (), timed)
    yield InjectedMistake(
        "torques in mN m",
        (MistakeKind.TORQUE_UNIT, MistakeKind.TORQUE_FACTOR),
        (),
        replace(sound, torque_nm=1e3 * sound.torque_nm),
    )
    for name, delay_s in (("50 ms late", 0.05), ("80 ms early", -0.08)):
        then_s = sound.time_s - delay_s
        columns = [np.interp(then_s, sound.time_s, column) for column in sound.torque_nm.T]
        late = replace(sound, torque_nm=np.column_stack(columns))
        yield InjectedMistake(f"all torques {name}", (MistakeKind.TORQUE_TIME,), (), late)
    twice = replace(
        sound,
        time_s=np.repeat(sound.time_s, 2),
        position=np.repeat(sound.position, 2, axis=0),
        torque_nm=np.repeat(sound.torque_nm, 2, axis=0),
    )
    yield InjectedMistake("every row twice", (), (), twice)
    stuck = sound.torque_nm.copy()
    stuck[:, 1] = stuck[0, 1]
    yield InjectedMistake("axis 2: torque stuck", (), (1,), replace(sound, torque_nm=stuck))


def _of_torques(sound: UserFiles) -> Iterator[InjectedMistake]:
    """Yield mistakes in the sign, unit or quantity of several torques at once."""
    n = len(sound.robot.joints)
    joints = sound.robot.joints

    def made(
        name: str, kind: MistakeKind, torque_nm: FloatArray, own: tuple[int, ...] = ()
    ) -> InjectedMistake:
        return InjectedMistake(name, (kind,), own, replace(sound, torque_nm=torque_nm))

    yield made("all torques backwards", MistakeKind.TORQUE_SIGN, -sound.torque_nm)
    sets = [(1, 2), tuple(range(n - 1))] + ([(0, 1, 2)] if n > 3 else [])
    for own in sets:
        torque_nm = sound.torque_nm.copy()
        torque_nm[:, list(own)] *= -1.0
        yield made(
            f"torques of {len(own)} axes with the wrong sign",
            MistakeKind.TORQUE_SIGN,
            torque_nm,
            own,
        )
    limits = np.array([joint.limits.torque for joint in joints])
    gears = np.array([abs(joint.gear_ratio) for joint in joints])
    units = [
        ("per mille of rated torque", 1000.0 / limits),
        ("percent of rated torque", 100.0 / limits),
        ("torques of the motors", 1.0 / gears),
    ]
    constants = [joint.torque_constant_nm_per_a for joint in joints]
    known = [value for value in constants if value is not None]
    if len(known) == n:
        units.append(("amperes called N m", 1.0 / np.array(known)))
    for name, factors in units:
        yield made(name, MistakeKind.TORQUE_UNIT, factors * sound.torque_nm)
    speed = np.gradient(sound.position, sound.time_s, axis=0)
    yield made("velocities called torques", MistakeKind.TORQUE_QUANTITY, speed)
    acceleration = np.gradient(speed, sound.time_s, axis=0)
    yield made("accelerations called torques", MistakeKind.TORQUE_QUANTITY, acceleration)
    without = made(
        "gravity removed", MistakeKind.GRAVITY_REMOVED, sound.torque_nm - sound.gravity_nm
    )
    yield replace(without, shown=True)


def _of_velocities(sound: UserFiles) -> Iterator[InjectedMistake]:
    """Yield wrong velocity columns; only the import checks velocities, against the positions."""
    right = np.gradient(sound.position, sound.time_s, axis=0)
    backwards, swapped = right.copy(), right.copy()
    backwards[:, 1] *= -1.0
    swapped[:, :2] = right[:, 1::-1]
    gears = np.array([abs(joint.gear_ratio) for joint in sound.robot.joints])
    for name, velocity in (
        ("in degrees per second", right / DEGREE),
        ("of axis 2 backwards", backwards),
        ("of axes 1 and 2 swapped", swapped),
        ("of the motors", right * gears),
    ):
        if not np.array_equal(velocity, right):
            stated = replace(sound, velocity=velocity)
            yield InjectedMistake(f"velocities {name}", (), (), stated, shown=True)


def _of_the_robot(sound: UserFiles) -> Iterator[InjectedMistake]:
    robot, n = sound.robot, len(sound.robot.joints)
    table, joints = robot.kinematics, robot.joints

    def of(**changes: object) -> UserFiles:
        return replace(sound, robot=robot.model_copy(update=changes))

    other = "standard_dh" if table.convention == "modified_dh" else "modified_dh"
    convention = table.model_copy(update={"convention": other})
    yield InjectedMistake(
        "the other convention", (MistakeKind.CONVENTION,), (), of(kinematics=convention)
    )
    matrix = np.eye(n)
    matrix[n - 1, n - 2] = 1.0
    coupled = tuple(tuple(row) for row in matrix.tolist())
    yield InjectedMistake(
        "a wrist coupling that the robot does not have",
        (MistakeKind.COUPLING,),
        (n - 2, n - 1),
        of(coupling=coupled),
    )
    long = max(range(n), key=lambda i: abs(table.rows[i].a_m))
    for name, key, value in (
        ("a link in mm", "a_m", 1000.0 * table.rows[long].a_m),
        ("a link a fifth too long", "a_m", 1.2 * table.rows[long].a_m),
        ("a twist in degrees", "alpha_rad", 90.0),
    ):
        rows = list(table.rows)
        rows[long] = rows[long].model_copy(update={key: value})
        yield InjectedMistake(
            name, (), (long,), of(kinematics=table.model_copy(update={"rows": tuple(rows)}))
        )
    yield InjectedMistake("gravity in cm", (), (), of(gravity_m_s2=(0.0, 0.0, -981.0)))
    down = tuple(-each for each in robot.gravity_m_s2)
    yield InjectedMistake("mounted upside down", (MistakeKind.MOUNTING,), (), of(gravity_m_s2=down))
    size, sign = float(np.linalg.norm(robot.gravity_m_s2)), math.copysign(1, robot.gravity_m_s2[2])
    for name, tilt_deg, azimuth_deg in (
        ("a tilted base, although it is level", 30.0, 90.0),
        ("a tilt of 15 degrees", 15.0, 200.0),
        ("mounted on a wall", 90.0, 0.0),
    ):
        tilt, turn = tilt_deg * DEGREE, azimuth_deg * DEGREE
        flat, along = size * math.sin(tilt), sign * size * math.cos(tilt)
        gravity = (flat * math.cos(turn), flat * math.sin(turn), along)
        yield InjectedMistake(name, (MistakeKind.MOUNTING,), (), of(gravity_m_s2=gravity))
    limits = [joint.limits for joint in joints]
    degrees = tuple(
        joint.model_copy(
            update={
                "limits": own.model_copy(
                    update={
                        "position_min": own.position_min / DEGREE,
                        "position_max": own.position_max / DEGREE,
                    }
                )
            }
        )
        for joint, own in zip(joints, limits, strict=True)
    )
    yield InjectedMistake("limits in degrees", (), (), of(joints=degrees))
    if robot.name in OTHERS:
        file = in_place_of(robot, load_robot(OTHERS[robot.name]))
        yield InjectedMistake("the robot file of another robot", (), (), replace(sound, robot=file))


def in_place_of(right: RobotDescription, other: RobotDescription) -> RobotDescription:
    """Return another robot's file, with the joint names and limits of the correct robot."""
    joints = (
        joint.model_copy(
            update={
                "name": own.name,
                "limits": own.limits,
                "torque_constant_nm_per_a": own.torque_constant_nm_per_a,
            }
        )
        for own, joint in zip(right.joints, other.joints, strict=True)
    )
    return other.model_copy(update={"joints": tuple(joints)})
