"""Recordings of simulated arms (Pinocchio), with correct and with wrong time stamps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from scipy.signal import lfilter

from acquisition.clock.samples import Samples
from config.arrays import FloatArray, IntArray
from config.robot.robot import RobotDescription

FINE_S: Final = 0.001
PERIOD_S: Final = 0.008
ENCODER_RAD: Final = 2.0 * np.pi / 2**19
SOUND: Final = ("correct stamps", "correct, uneven stamps", "correct stamps, one joint moves")
WRONG: Final = (
    "stamps jitter by 2.5 ms",
    "stamps jitter, v x 1.03",
    "stamps of 5 ms",
    "every tenth row twice",
    "every tenth row twice, v delayed by 11 ms",
    "every tenth row twice, v noisy",
    "12 % of rows stale",
    "polled, jitter",
    "polled",
    "nine of ten rows repeated",
)
REFUSED: Final = ("stamps jitter, v differenced", "every tenth row twice, v differenced")


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm with known bodies and friction, and its description for `rid-daq`.

    Attributes:
        robot: Its geometry.
        model: The arm's geometry and bodies, for Pinocchio.
        coulomb, viscous, rotor: Shape (n,). Friction [N m, N m s/rad], and inertia of the rotors at
            the joints [kg m^2].
    """

    robot: RobotDescription
    model: pin.Model
    coulomb: FloatArray
    viscous: FloatArray
    rotor: FloatArray

    @classmethod
    def of(cls, joints: int, seed: int) -> Arm:
        """Return an arm with alternating directions of its axes, and with random bodies."""
        random = np.random.default_rng(seed)
        model, parent, place = pin.Model(), 0, pin.SE3.Identity()
        rows = []
        for i in range(joints):
            turn = 0.0 if i == 0 else (np.pi / 2.0) * (-1) ** i
            along = 0.3 if i in (1, 2) else 0.0
            beside = 0.2 if i % 2 == 0 else 0.0
            rows.append({"alpha_rad": turn, "a_m": along, "d_m": beside})
            own = pin.SE3(pin.utils.rotate("x", turn), np.array([along, 0.0, 0.0]))
            place = own * pin.SE3(np.eye(3), np.array([0.0, 0.0, beside]))
            parent = model.addJoint(parent, pin.JointModelRZ(), place, f"j{i + 1}")
            mass = 12.0 / (i + 1.0)
            inertia = np.diag(mass * random.uniform(0.005, 0.02, 3))
            body = pin.Inertia(mass, random.uniform(-0.1, 0.1, 3), inertia)
            model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        model.gravity.linear = np.array([0.0, 0.0, -9.81])
        scale = 1.0 / np.linspace(1.0, joints, joints)
        limits = {"position_min": -6.0, "position_max": 6.0, "velocity": 20.0}
        limits |= {"acceleration": 500.0, "torque": 2000.0}
        robot = RobotDescription.model_validate(
            {
                "name": f"arm{joints}",
                "kinematics": {"convention": "modified_dh", "rows": rows},
                "joints": [
                    {
                        "name": f"j{i + 1}",
                        "limits": limits,
                        "gear_ratio": 100.0,
                        "friction": ["coulomb", "viscous"],
                        "armature": True,
                    }
                    for i in range(joints)
                ],
            },
            strict=False,
        )
        coulomb, viscous, rotor = (np.asarray(size * scale) for size in (8.0, 10.0, 1.5))
        return cls(robot, model, coulomb, viscous, rotor)

    def torque(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return the actuators' torques, shape (samples, n)."""
        data = self.model.createData()
        rigid = np.array([pin.rnea(self.model, data, *row) for row in zip(q, v, a, strict=True)])
        return rigid + self.rotor * a + self.coulomb * np.sign(v) + self.viscous * v


@dataclass(frozen=True, eq=False)
class Logged:
    """A logger's recording and the true times of its rows.

    Attributes:
        case: Behaviour of the logging program: one of `SOUND`, `WRONG`, `REFUSED`.
        samples: Content of the recording.
        true_s: Shape (rows,). True time of each row [s].
    """

    case: str
    samples: Samples
    true_s: FloatArray


def motion(kind: str, joints: int, seconds: float, seed: int) -> tuple[FloatArray, ...]:
    """Return times, positions, velocities and accelerations of a motion without period, at 1 kHz.

    Args:
        kind: Sums of sines of frequencies without a common period, or quintic moves from rest to
            rest.
        joints: Number of joints.
        seconds: Duration [s].
        seed: Random seed of the motion.
    """
    random = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, FINE_S)
    q, v, a = np.zeros((3, len(t), joints))
    if kind == "sines":
        for j in range(joints):
            w = 2.0 * np.pi * random.uniform(0.06, 0.6, 6)
            c = random.uniform(0.4, 1.0, 6)
            c *= 1.5 / c.sum()
            angle = np.outer(t, w) + random.uniform(0.0, 2.0 * np.pi, 6)
            q[:, j] = np.sin(angle) @ c
            v[:, j] = np.cos(angle) @ (c * w)
            a[:, j] = -np.sin(angle) @ (c * w**2)
        return t, q, v, a
    now, at = 0.0, random.uniform(-1.0, 1.0, joints)
    while now < seconds:
        to, span = random.uniform(-1.5, 1.5, joints), random.uniform(0.9, 2.0)
        rows = (t >= now) & (t < now + span)
        x = (t[rows] - now) / span
        q[rows] = at + np.outer(10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5, to - at)
        v[rows] = np.outer(30.0 * x**2 - 60.0 * x**3 + 30.0 * x**4, to - at) / span
        a[rows] = np.outer(60.0 * x - 180.0 * x**2 + 120.0 * x**3, to - at) / span**2
        now += span
        q[(t >= now) & (t < now + 0.3)] = to
        now, at = now + 0.3, to
    return t, q, v, a


def log_motion(
    arm: Arm, kind: str, seconds: float, seed: int, cases: tuple[str, ...]
) -> Iterator[Logged]:
    """Yield the recordings of one motion by all loggers, at 125 Hz unless the case states a rate.

    Encoders have 19 bits, torques have noise of 0.5 % of each joint's RMS torque, and velocities
    have noise of 0.2 mrad/s and steps of 0.1 mrad/s.
    """
    t, q, v, a = motion(kind, len(arm.coulomb), seconds, seed)
    for case in cases:
        random = np.random.default_rng(seed)
        own = (q, v, a)
        if case.endswith("one joint moves"):
            moves = np.arange(len(arm.coulomb)) == 1
            own = (np.where(moves, q, q[0]), v * moves, a * moves)
        torque = arm.torque(*own)
        size = np.sqrt(np.mean(torque**2, axis=0))
        torque += 0.005 * size * random.normal(size=torque.shape)
        speed = own[1]
        if "late" in case:
            pole = np.exp(-FINE_S / 0.011)
            speed = lfilter([1.0 - pole], [1.0, -pole], speed, axis=0)
        speed = speed + (0.01 if "noisy" in case else 2e-4) * random.normal(size=speed.shape)
        speed = np.round((1.03 if "1.03" in case else 1.0) * speed / 1e-4) * 1e-4
        stamps, rows = _rows(case, len(t), random)
        position = np.round(own[0][rows] / ENCODER_RAD) * ENCODER_RAD
        samples = Samples(stamps, position, speed[rows], torque[rows])
        if "differenced" in case:
            samples = replace(samples, velocity=np.gradient(position, stamps, axis=0))
        yield Logged(case, samples, t[rows])


def _rows(case: str, fine: int, random: np.random.Generator) -> tuple[FloatArray, IntArray]:
    """Return the time stamps of a logger's rows, and the indices of their samples at 1 kHz."""
    n = int(fine * FINE_S / PERIOD_S) - 2
    true_s = stamps = np.arange(n) * PERIOD_S
    if case == "correct, uneven stamps":
        true_s = stamps = np.round(true_s + random.uniform(0.0, 0.004, n), 3)
    elif case.startswith("stamps jitter"):
        true_s = np.round(true_s + random.uniform(0.0, 0.001, n), 3)
        stamps = true_s + random.uniform(-0.0025, 0.0025, n)
    elif case == "stamps of 5 ms":
        stamps = np.floor(true_s / 0.005 + 1e-9) * 0.005
    elif case.startswith("every tenth"):
        true_s = np.repeat(true_s, np.where(np.arange(n) % 10 == 9, 2, 1))[:n]
    elif case.startswith("12 %"):
        stale = (random.random(n) < 0.12) & (np.arange(n) > 0)
        true_s = true_s - PERIOD_S * stale
    elif case.startswith("polled"):
        spread, late = (0.3, 0.4) if "jitter" in case else (0.02, 0.62)
        source = np.sort(true_s + np.abs(random.normal(size=n)) * spread * PERIOD_S)
        read = true_s + (0.4 + np.abs(random.normal(size=n)) * late) * PERIOD_S
        true_s = source[np.maximum(np.searchsorted(source, np.sort(read), side="right") - 1, 0)]
    elif case.startswith("nine of ten"):
        source = np.arange(0.0, fine * FINE_S - 0.1, 0.02)
        seen = source + random.uniform(0.0, 0.012, len(source))
        seen[0] = -1.0
        stamps = np.arange(0.0, fine * FINE_S - 0.2, 0.002)
        true_s = source[np.searchsorted(seen, stamps, side="right") - 1]
    rows = np.clip(np.round(true_s / FINE_S).astype(np.int64), 0, fine - 1)
    return np.asarray(stamps, dtype=np.float64), np.asarray(rows)
