"""Simulation of arms with known parameters in closed loop, with three, six and seven axes.

Pinocchio computes masses and forces; the project's dynamics are not used. The integrator is a
leapfrog: position, velocity, acceleration and torque of a row belong to the same time, with an
error of second order in the step. Coulomb friction is exact: a joint at rest does not move if
friction can hold it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final, Literal

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numba import njit

from config.arrays import FloatArray
from config.formats.urdf_file import read_urdf
from config.robot.robot import RobotDescription
from config.robot.urdf_robot import robot_of_urdf

STEP_S: Final = 1e-3
LOOP_HZ: Final = 7.0
SWEEPS: Final = 40
STRIBECK_RAD_S: Final = 0.08

MotionKind = Literal["points", "sines"]
Vector = tuple[float, ...]


@dataclass(frozen=True)
class Friction:
    """Friction in addition to Coulomb and viscous friction, the same for every joint.

    Attributes:
        stribeck: Additional friction at standstill, as a fraction of the Coulomb friction.
        load: Additional friction as a fraction of the torque that the gear transmits.
    """

    stribeck: float = 0.0
    load: float = 0.0


@dataclass(frozen=True)
class _Link:
    axis: str
    origin: Vector
    tilt: Vector
    mass_kg: float
    centre: Vector
    size: Vector


@dataclass(frozen=True)
class Arm:
    """An arm with its true parameters.

    Attributes:
        links: Base to flange.
        rotor, coulomb, viscous: Rotor inertia and friction of each joint [kg m^2, N m, N m s/rad].
        reach_rad, speed_rad_s: Largest angle in both directions, and largest speed.
    """

    name: str
    links: tuple[_Link, ...]
    rotor: Vector
    coulomb: Vector
    viscous: Vector
    reach_rad: Vector
    speed_rad_s: Vector

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.links)

    def urdf(self) -> str:
        """Return the arm as a URDF."""
        parts = ['<robot name="known"><link name="base"/>']
        for i, link in enumerate(self.links):
            parent = f"link{i}" if i else "base"
            a, b, c = (edge**2 for edge in link.size)
            inertia = link.mass_kg / 12.0 * np.array([b + c, a + c, a + b])
            off = 0.08 * inertia.min()
            parts.append(
                f'<link name="link{i + 1}"><inertial><origin xyz="{_text(link.centre)}"/>'
                f'<mass value="{link.mass_kg}"/><inertia ixx="{inertia[0]}" iyy="{inertia[1]}"'
                f' izz="{inertia[2]}" ixy="{off}" ixz="{-0.5 * off}" iyz="{0.7 * off}"/></inertial>'
                f'</link><joint name="joint{i + 1}" type="revolute"><parent link="{parent}"/>'
                f'<child link="link{i + 1}"/><origin xyz="{_text(link.origin)}"'
                f' rpy="{_text(link.tilt)}"/><axis xyz="{_text(_AXES[link.axis])}"/>'
                f'<limit lower="{-self.reach_rad[i]}" upper="{self.reach_rad[i]}" effort="2000"'
                f' velocity="{self.speed_rad_s[i]}"/></joint>'
            )
        return "".join(parts) + "</robot>"

    def description(self) -> RobotDescription:
        """Return the robot file's content, with a motor inertia on each joint."""
        robot = robot_of_urdf(read_urdf(self.urdf().encode(), self.name)).robot
        joints = tuple(
            joint.model_copy(update={"armature": True, "friction": ("coulomb", "viscous")})
            for joint in robot.joints
        )
        return robot.model_copy(update={"joints": joints})


_AXES: Final[dict[str, Vector]] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
}


def _text(values: Vector) -> str:
    return " ".join(map(str, values))


def _link(axis: str, origin: Vector, mass_kg: float, centre: Vector, size: Vector) -> _Link:
    return _Link(axis, origin, (0.0, 0.0, 0.0), mass_kg, centre, size)


ARMS: Final[dict[str, Arm]] = {
    "three": Arm(
        "three",
        (
            _Link(
                "z", (0.0, 0.0, 0.4), (0.12, 0.1, 0.0), 18.0, (0.03, 0.02, 0.05), (0.3, 0.3, 0.3)
            ),
            _link("y", (0.1, 0.0, 0.12), 12.0, (0.2, 0.03, 0.02), (0.45, 0.15, 0.14)),
            _link("y", (0.45, 0.0, 0.0), 6.0, (0.16, 0.02, -0.03), (0.38, 0.12, 0.1)),
        ),
        rotor=(2.8, 3.1, 1.1),
        coulomb=(12.0, 14.0, 6.0),
        viscous=(10.0, 12.0, 5.0),
        reach_rad=(2.5, 1.2, 1.9),
        speed_rad_s=(2.3, 2.3, 2.6),
    ),
    "six": Arm(
        "six",
        (
            _link("z", (0.0, 0.0, 0.33), 28.0, (0.05, 0.02, 0.08), (0.32, 0.3, 0.3)),
            _link("y", (0.15, 0.0, 0.28), 21.0, (0.03, 0.04, 0.28), (0.17, 0.15, 0.7)),
            _link("y", (0.0, 0.0, 0.6), 14.0, (0.08, -0.03, 0.08), (0.3, 0.2, 0.2)),
            _link("x", (0.25, 0.0, 0.1), 7.0, (0.17, 0.01, 0.014), (0.4, 0.12, 0.12)),
            _link("y", (0.4, 0.0, 0.0), 3.4, (0.03, 0.008, 0.012), (0.13, 0.1, 0.11)),
            _link("x", (0.1, 0.0, 0.0), 1.6, (0.05, 0.014, 0.015), (0.1, 0.11, 0.1)),
        ),
        rotor=(5.8, 6.6, 3.1, 0.6, 0.34, 0.2),
        coulomb=(29.0, 33.0, 19.0, 7.0, 5.0, 3.4),
        viscous=(24.0, 27.0, 14.0, 4.0, 3.0, 2.0),
        reach_rad=(2.5, 1.3, 1.5, 2.5, 1.8, 2.5),
        speed_rad_s=(2.1, 2.1, 2.3, 2.7, 2.7, 3.1),
    ),
    "seven": Arm(
        "seven",
        tuple(
            _Link(
                "zyzyzyz"[i],
                (0.0, 0.0, 0.2 if i else 0.15),
                (0.0, 0.0, 0.0) if i else (0.3, 0.15, 0.0),
                mass_kg,
                (0.015 * (-1.0) ** i, 0.018, 0.1 - 0.01 * i),
                (0.12, 0.13, 0.21),
            )
            for i, mass_kg in enumerate((5.0, 4.8, 4.0, 3.3, 2.5, 1.8, 1.0))
        ),
        rotor=(1.2, 1.1, 0.8, 0.65, 0.4, 0.25, 0.15),
        coulomb=(8.0, 8.8, 6.0, 5.0, 3.0, 2.0, 1.5),
        viscous=(6.0, 6.6, 5.0, 4.0, 2.0, 1.5, 1.0),
        reach_rad=(2.2,) * 7,
        speed_rad_s=(2.1, 2.1, 2.3, 2.3, 2.7, 2.7, 2.9),
    ),
}


@dataclass(frozen=True, eq=False)
class Driven:
    """Motion of an arm, in steps of `STEP_S`.

    Attributes:
        time_s: Shape (samples,). Time [s].
        position, velocity, torque_nm: Shape (samples, n). Without noise; the torque is the motor's.
    """

    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    torque_nm: FloatArray


@cache
def drive(name: str, kind: MotionKind, seed: int, friction: Friction, duration_s: float) -> Driven:
    """Drive an arm along a random motion by feedforward and a PD controller."""
    arm = ARMS[name]
    reference = {"points": _points, "sines": _sines}[kind](arm, duration_s, seed)
    model = pin.buildModelFromXML(arm.urdf())
    data, n = model.createData(), arm.joints
    rotor, coulomb, viscous = (np.array(own) for own in (arm.rotor, arm.coulomb, arm.viscous))
    position, velocity, acceleration = reference
    q, half, a = position[0].copy(), velocity[0].copy(), acceleration[0].copy()
    stiffness = (2.0 * np.pi * LOOP_HZ) ** 2
    damping = 2.0 * 2.0 * np.pi * LOOP_HZ
    out = np.empty((3, len(position), n))
    force = np.zeros(n)
    for k in range(len(position)):
        guess = half + 0.5 * STEP_S * a
        mass = pin.crba(model, data, q)  # its upper triangle
        bias = pin.nonLinearEffects(model, data, q, guess)
        wanted = acceleration[k] + stiffness * (position[k] - q) + damping * (velocity[k] - guess)
        hold = viscous * velocity[k] + 0.8 * coulomb * np.tanh(velocity[k] / 0.05)
        command, a = _step(
            (mass, rotor, bias), (half, guess, a), (wanted, hold), force,
            (coulomb, viscous, friction.stribeck, friction.load),
        )  # fmt: skip
        out[:, k] = q, half + 0.5 * STEP_S * a, command
        half = half + STEP_S * a
        q = q + STEP_S * half
    time_s: FloatArray = STEP_S * np.arange(len(position), dtype=np.float64)
    return Driven(time_s, out[0], out[1], out[2])


@njit(cache=True)
def _step(inertia, motion, loop, force, friction):  # type: ignore[no-untyped-def] # pragma: no cover
    """Return the motor torques and accelerations of a step; write the friction into `force`."""
    mass, rotor, bias = inertia
    half, guess, before = motion
    wanted, hold = loop
    coulomb, viscous, stribeck, load_share = friction
    n = len(rotor)
    full, load = np.empty((n, n)), np.empty(n)
    for i in range(n):
        for j in range(n):
            full[i, j] = mass[i, j] if j >= i else mass[j, i]
    for i in range(n):
        load[i] = bias[i]
        for j in range(n):
            load[i] += full[i, j] * before[j]
        full[i, i] += rotor[i]
    command = full @ wanted + bias + hold
    inverse = np.linalg.inv(full)
    drive = inverse @ (command - bias)
    free, gain = half + 0.5 * STEP_S * drive, 0.5 * STEP_S * inverse
    limit = coulomb * (1.0 + stribeck * np.exp(-np.abs(guess) / STRIBECK_RAD_S))
    limit += load_share * np.abs(load)
    # Velocity at the middle of the step: v = free - gain @ F, with the friction F. A sliding joint
    # has F = limit * sign(v) + viscous * v; a joint at rest has |F| <= limit.
    for _ in range(SWEEPS):
        change = 0.0
        for i in range(n):
            rest = free[i] + gain[i, i] * force[i]
            for j in range(n):
                rest -= gain[i, j] * force[j]
            own = gain[i, i]
            if abs(rest) <= own * limit[i]:
                new = rest / own
            else:
                direction = 1.0 if rest > 0.0 else -1.0
                speed = (rest - own * limit[i] * direction) / (1.0 + own * viscous[i])
                new = limit[i] * direction + viscous[i] * speed
            change = max(change, abs(new - force[i]) / (limit[i] + 1e-9))
            force[i] = new
        if change < 1e-10:
            break
    return command, drive - inverse @ force


def _points(arm: Arm, duration_s: float, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return moves between random poses, from rest to rest; a third of the moves have a pause."""
    random = np.random.default_rng([seed, 1])
    reach, speed = np.array(arm.reach_rad), np.array(arm.speed_rad_s)
    t = STEP_S * np.arange(round(duration_s / STEP_S))
    q, v, a = (np.zeros((len(t), arm.joints)) for _ in range(3))
    start, at_s = np.zeros(arm.joints), 0.0
    while at_s < duration_s:
        target = 0.85 * reach * random.uniform(-1.0, 1.0, arm.joints)
        way = target - start
        span_s = max(0.5, 1.875 * float(np.max(np.abs(way) / speed)) / random.uniform(0.5, 0.95))
        rows = (t >= at_s) & (t < at_s + span_s)
        x = ((t[rows] - at_s) / span_s)[:, np.newaxis]
        q[rows] = start + way * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        v[rows] = way * 30.0 * x**2 * (1.0 - x) ** 2 / span_s
        a[rows] = way * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / span_s**2
        at_s += span_s
        pause_s = float(random.choice([0.0, 0.0, 0.4]))
        q[(t >= at_s) & (t < at_s + pause_s)] = target
        at_s += pause_s
        start = target
    return q, v, a


def _sines(arm: Arm, duration_s: float, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return sums of sines of 0.05 to 0.7 Hz that have no period in common."""
    random = np.random.default_rng([seed, 2])
    t = STEP_S * np.arange(round(duration_s / STEP_S))
    columns = []
    for reach, speed in zip(arm.reach_rad, arm.speed_rad_s, strict=True):
        omega = 2.0 * np.pi * random.uniform(0.05, 0.7, 7)
        angle = np.outer(t, omega) + random.uniform(0.0, 2.0 * np.pi, 7)
        size = random.normal(size=7)
        q = np.sin(angle) @ size
        v = np.cos(angle) @ (size * omega)
        a = -np.sin(angle) @ (size * omega**2)
        scale = min(
            0.85 * reach / np.abs(q).max(),
            0.95 * speed / np.abs(v).max(),
            5.0 * speed / np.abs(a).max(),
        )
        columns.append((scale * q, scale * v, scale * a))
    q, v, a = (np.column_stack(own) for own in zip(*columns, strict=True))
    return q, v, a
