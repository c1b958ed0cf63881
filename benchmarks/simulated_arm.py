"""Simulation of arms in closed loop by Pinocchio, with exact Coulomb friction.

The simulated robot and the kernels of the project are not used. A time step goes from the middle of
one row to the middle of the next (leapfrog). Therefore position, velocity and torque of a row
belong to the same time. A joint slides at its Coulomb friction, or sticks with less friction. The
solver finds the combination that satisfies the equations of all joints (projected Gauss-Seidel).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from benchmarks.regressor import pinocchio_arm
from config.arrays import FloatArray
from config.load import load_robot
from config.robot.kinematic_table import KinematicRow
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from dynamics.kernels.simd import kernel
from identification.model.base_parameters import BaseParameters

STEP_S: Final = 5e-4
ROW_S: Final = 1e-3
MIDDLE: Final = 0.55
"""Fraction of a step at which Coulomb friction acts; slightly late, so that a sticking joint rests.
"""
GAIN_RAD_S: Final = 50.0
LAG_S: Final = 5e-4
SWEEPS: Final = 60
ARMS: Final = ("three", "six", "seven")
MOTIONS: Final = ("rest to rest", "quick reversals")

Motion = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
Kind = Literal["rest to rest", "quick reversals"]


@dataclass(frozen=True, eq=False)
class SimulatedArm:
    """An arm with its true parameters.

    Attributes:
        robot: Description of the arm for the estimator: frames and terms, no inertia.
        model: Rigid bodies of the arm.
        rotor, coulomb, viscous: Shape (n,). Rotor inertia at the joint [kg m^2], Coulomb [N m] and
            viscous friction [N m s/rad].
        reach, speed: Shape (n,). Largest angle to either side [rad], and largest speed [rad/s].
    """

    robot: RobotDescription
    model: Any
    rotor: FloatArray
    coulomb: FloatArray
    viscous: FloatArray
    reach: FloatArray
    speed: FloatArray

    @classmethod
    def of(cls, name: str) -> SimulatedArm:
        """Return one of `ARMS`."""
        ur = load_robot("ur10e")
        n = {"three": 3, "six": 6, "seven": 7}[name]
        rows = list(ur.kinematics.rows[:n])
        if n == 7:
            turns = (-1, 1, 1, -1, -1, 1, 0)
            rows = [
                KinematicRow(alpha_rad=turn * np.pi / 2.0, a_m=0.0, d_m=along)
                for turn, along in zip(turns, (0.34, 0.0, 0.4, 0.0, 0.39, 0.0, 0.1), strict=True)
            ]
        size = np.geomspace(1.0, 0.05, 7)[:n]
        joints = tuple(
            ur.joints[min(j, 5)].model_copy(
                update={
                    "name": f"joint{j + 1}",
                    "gear_ratio": 1.0,
                    "rotor": None,
                    "armature": True,
                    "friction": ("coulomb", "viscous"),
                }
            )
            for j in range(n)
        )
        robot = ur.model_copy(
            update={
                "name": name,
                "kinematics": ur.kinematics.model_copy(update={"rows": tuple(rows)}),
                "joints": joints,
                "bodies": (),
                "gravity_m_s2": (0.8, 1.1, -9.7),
            }
        )
        chain = Chain.from_description(robot)
        model = pinocchio_arm(chain)
        model.gravity.linear = np.array(robot.gravity_m_s2)
        random = np.random.default_rng(n)
        for j in range(n):
            model.inertias[j + 1] = _body(20.0 * size[j] ** 0.7, random)
        return cls(
            robot=robot,
            model=model,
            rotor=6.0 * size * random.uniform(0.5, 1.0, n),
            coulomb=30.0 * size * random.uniform(0.7, 1.3, n),
            viscous=26.0 * size * random.uniform(0.7, 1.3, n),
            reach=np.full(n, 1.8),
            speed=np.linspace(2.0, 3.0, n),
        )

    def truth(self, base: BaseParameters) -> FloatArray:
        """Return the true base parameters, (b,)."""
        values: dict[str, float] = {}
        for j in range(self.model.nv):
            mass, x, y, z, xx, xy, yy, xz, yz, zz = self.model.inertias[j + 1].toDynamicParameters()
            own = {"m": mass, "sx": x, "sy": y, "sz": z, "Ixx": xx, "Ixy": xy, "Ixz": xz}
            own |= {"Iyy": yy, "Iyz": yz, "Izz": zz, "Ia": self.rotor[j]}
            values |= {f"{symbol}{j + 1}": value for symbol, value in own.items()}
            values[f"fc_joint{j + 1}"] = self.coulomb[j]
            values[f"fv_joint{j + 1}"] = self.viscous[j]
        return base.from_standard(np.array([values[name] for name in base.standard_names]))


def _body(mass_kg: float, random: np.random.Generator) -> Any:
    """Return the inertia of a uniform cuboid with random edges, orientation and centre of mass."""
    size = random.uniform(0.1, 0.35, 3)
    turn = pin.exp3(random.normal(size=3))
    around = np.diag(mass_kg / 12.0 * (np.sum(size**2) - size**2))
    return pin.Inertia(mass_kg, random.uniform(-0.12, 0.12, 3), turn @ around @ turn.T)


def rest_to_rest(arm: SimulatedArm, duration_s: float, random: np.random.Generator) -> Motion:
    """Return quintic moves of all joints from pose to pose, with rests."""
    n = len(arm.reach)
    poses, starts, ways = [np.zeros(n)], [0.5], []
    while starts[-1] < duration_s:
        poses.append(random.uniform(-arm.reach, arm.reach))
        way = np.abs(poses[-1] - poses[-2])
        fast = 1.875 * float(np.max(way / arm.speed))
        hard = float(np.sqrt(5.8 * np.max(way / (5.0 * arm.speed))))
        ways.append(max(fast, hard) / random.uniform(0.55, 1.0))
        starts.append(starts[-1] + ways[-1] + random.choice([0.0, 0.2, 0.4]))
    began, lasts, at = np.array(starts), np.array(ways), np.array(poses)

    def motion(time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        k = np.clip(np.searchsorted(began, time_s, side="right") - 1, 0, len(lasts) - 1)
        span = lasts[k][:, np.newaxis]
        x = np.clip((time_s - began[k])[:, np.newaxis] / span, 0.0, 1.0)
        way = at[k + 1] - at[k]
        return (
            at[k] + way * (10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5),
            way * 30.0 * (x - x * x) ** 2 / span,
            way * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / span**2,
        )

    return motion


def quick_reversals(arm: SimulatedArm, duration_s: float, random: np.random.Generator) -> Motion:
    """Return sums of sines of 0.05 to 0.8 Hz without a common period."""
    n = len(arm.reach)
    omega = 2.0 * np.pi * random.uniform(0.05, 0.8, (8, n))
    size, phase = random.normal(size=(8, n)), random.uniform(0.0, 2.0 * np.pi, (8, n))

    def unit(time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        angle = omega * time_s[:, np.newaxis, np.newaxis] + phase
        wave, turned = size * np.sin(angle), size * omega * np.cos(angle)
        return wave.sum(axis=1), turned.sum(axis=1), -(omega**2 * wave).sum(axis=1)

    q, v, a = (np.abs(each).max(axis=0) for each in unit(np.linspace(0.0, duration_s, 4000)))
    scale = np.minimum(arm.reach / q, np.minimum(arm.speed / v, 5.0 * arm.speed / a))

    def motion(time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        position, velocity, acceleration = unit(time_s)
        return scale * position, scale * velocity, scale * acceleration

    return motion


def simulate(arm: SimulatedArm, kind: Kind, seed: int, duration_s: float) -> Recording:
    """Return the recording of an arm under feedforward and position control, without noise."""
    random = np.random.default_rng(seed)
    make = rest_to_rest if kind == "rest to rest" else quick_reversals
    steps = round(duration_s / STEP_S)
    time_s = STEP_S * np.arange(steps, dtype=np.float64)
    wanted, fast, hard = make(arm, duration_s, random)(time_s)
    model, data = arm.model, arm.model.createData()
    q, v, acceleration = wanted[0].copy(), fast[0].copy(), np.zeros(model.nv)
    own = np.diagonal(pin.crba(model, data, q)) + arm.rotor
    stiffness, damping = own * GAIN_RAD_S**2, 2.0 * own * GAIN_RAD_S
    torque = pin.nonLinearEffects(model, data, q, v)
    position, driven = np.empty((2, steps, model.nv))
    for k in range(steps):
        now = v + 0.5 * STEP_S * acceleration
        bias = pin.nonLinearEffects(model, data, q, now)
        inertia = np.asarray(pin.crba(model, data, q)) + np.diag(arm.rotor)
        command = own * hard[k] + bias + stiffness * (wanted[k] - q) + damping * (fast[k] - now)
        torque = torque + (1.0 - np.exp(-STEP_S / LAG_S)) * (command - torque)
        position[k], driven[k] = q, torque
        free: FloatArray = np.asarray(torque - bias, dtype=np.float64)
        acceleration = step(inertia, free, v, arm.viscous, arm.coulomb)
        v = v + STEP_S * acceleration
        q = q + STEP_S * v
    every = round(ROW_S / STEP_S)
    rows = len(position[::every])
    return Recording(
        joint_names=arm.robot.joint_names,
        time_s=ROW_S * np.arange(rows, dtype=np.float64),
        position=position[::every],
        torque_nm=driven[::every],
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(rows),
        source="import",
    )


@kernel
def step(
    inertia: FloatArray, free: FloatArray, v: FloatArray, viscous: FloatArray, coulomb: FloatArray
) -> FloatArray:
    """Return the accelerations of a step, with Coulomb friction that slides or holds.

    Args:
        inertia: Shape (n, n). Inertia of links and rotors.
        free: Shape (n,). Torque less gravity, Coriolis and centrifugal torques.
        v: Shape (n,). Velocities before the step.
        viscous, coulomb: Shape (n,). Friction.
    """
    n, late = len(v), MIDDLE * STEP_S
    damped = inertia.copy()
    for i in range(n):
        damped[i, i] += 0.5 * STEP_S * viscous[i]
    inverse = np.linalg.inv(damped)
    push = free - viscous * v
    friction = coulomb * np.sign(v)
    for _ in range(SWEEPS):
        largest = 0.0
        for i in range(n):
            speed = v[i]
            for j in range(n):
                speed += late * inverse[i, j] * (push[j] - friction[j])
            better = friction[i] + speed / (late * inverse[i, i])
            better = min(max(better, -coulomb[i]), coulomb[i])
            largest = max(largest, abs(better - friction[i]) / coulomb[i])
            friction[i] = better
        if largest < 1e-10:
            break
    return inverse @ (push - friction)
