"""Correct recordings of invented robots, with effects that no model of rid-daq contains."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.load import load_robot
from config.robot.nominal_links import nominal_links
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from dynamics.geometry.kinematics import Chain
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import RobotModel, regressor

STEP_S: Final = 0.01
HARMONICS: Final = 5
ROBOTS: Final = ("ir361", "kr15", "ur10e")
GEARS_PER_TURN: Final = 101.0
MOST_OF_LIMIT: Final = 0.9


@dataclass(frozen=True, eq=False)
class SoundRecording:
    """A robot's recording without any mistake.

    Attributes:
        robot: Content of the robot file.
        time_s: Shape (samples,). Time [s].
        position, velocity, acceleration, torque_nm: Shape (samples, n). Low-passed values at the
            joints.
        gravity_nm: Shape (samples, n). Gravity torques contained in `torque_nm`.
    """

    robot: RobotDescription
    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    torque_nm: FloatArray
    gravity_nm: FloatArray


def sound_runs(count: int, first_seed: int = 0) -> Iterator[SoundRecording]:
    """Yield recordings of invented robots, each with different bodies and friction.

    Friction has a Stribeck part, grows with the cube root of the speed, and depends on the
    direction. Gears have torque ripple; torque sensors have an offset, a gain error of 1 %, and
    noise.
    """
    for seed in range(first_seed, first_seed + count):
        random = np.random.default_rng(seed)
        yield sound_run(load_robot(ROBOTS[seed % len(ROBOTS)]), random)


def sound_run(robot: RobotDescription, random: np.random.Generator) -> SoundRecording:
    """Return a recording of 30 to 60 s of a robot with invented bodies and friction."""
    duration_s = float(random.uniform(30.0, 60.0))
    q, v, a = _motion(robot, duration_s, random)
    rigid = RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
    values = _bodies(robot, rigid, random)
    rigid_nm = regressor(rigid, q, v, a) @ values
    gravity_nm = regressor(rigid, q, np.zeros_like(q), np.zeros_like(q)) @ values
    n = len(robot.joints)
    size = np.sqrt(np.mean(rigid_nm**2, axis=0)) + 0.05 * np.sqrt(np.mean(rigid_nm**2))
    joints, coupling = (q, v, a), WristCoupling.of_robot(robot)
    if coupling is not None:
        q, v, a = (coupling.to_motors(each) for each in joints)
    speed = np.sqrt(np.mean(v**2, axis=0))
    rotor_nm = random.uniform(0.05, 0.4, n) * size / np.sqrt(np.mean(a**2, axis=0)) * a
    coulomb, viscous = random.uniform(0.1, 0.5, n), random.uniform(0.05, 0.4, n)
    stribeck, root = random.uniform(0.0, 0.1, n), random.uniform(0.0, 0.1, n)
    braked = coulomb * (1.0 + random.uniform(-0.1, 0.1, n) * np.sign(v)) * np.sign(v)
    braked = braked + viscous * v / speed + root * np.cbrt(v / speed)
    braked = braked + stribeck * np.sign(v) * np.exp(-np.abs(v) / (0.1 * speed))
    ripple = random.uniform(0.0, 0.03, n) * np.sin(GEARS_PER_TURN * q)
    torque_nm = rigid_nm + rotor_nm + size * (braked + ripple + random.uniform(-0.1, 0.1, n))
    torque_nm = torque_nm * random.normal(1.0, 0.01, n)
    torque_nm += 0.02 * size * random.standard_normal(q.shape)
    share = _share_of_limits(robot, torque_nm)
    time_s = STEP_S * np.arange(len(q), dtype=np.float64)
    return SoundRecording(robot, time_s, *joints, share * torque_nm, share * gravity_nm)


def _share_of_limits(robot: RobotDescription, torque_nm: FloatArray) -> float:
    """Return a factor for masses and friction of an arm, so that its motors can carry it."""
    limits = np.array([joint.limits.torque for joint in robot.joints])
    return min(1.0, float(np.min(MOST_OF_LIMIT * limits / np.abs(torque_nm).max(axis=0))))


def _motion(
    robot: RobotDescription, duration_s: float, random: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a random sum of harmonics of 10 s within a part of the joints' ranges."""
    t = STEP_S * np.arange(round(duration_s / STEP_S), dtype=np.float64)
    omega = 2.0 * math.pi / 10.0 * np.arange(1, HARMONICS + 1)
    angle = np.outer(t, omega)
    columns = []
    for joint in robot.joints:
        limits = joint.limits
        amplitudes = random.normal(0.0, 1.0, (2, HARMONICS)) / np.arange(1, HARMONICS + 1)
        reach = min(0.35 * (limits.position_max - limits.position_min), 1.2)
        wave = np.sin(angle) @ amplitudes[0] + np.cos(angle) @ amplitudes[1]
        amplitudes *= reach / np.abs(wave).max()
        fast = np.cos(angle) @ (omega * amplitudes[0]) - np.sin(angle) @ (omega * amplitudes[1])
        amplitudes *= min(1.0, 0.9 * limits.velocity / np.abs(fast).max())
        middle = 0.5 * (limits.position_min + limits.position_max)
        s, c = np.sin(angle), np.cos(angle)
        columns.append(
            (
                middle + s @ amplitudes[0] + c @ amplitudes[1],
                c @ (omega * amplitudes[0]) - s @ (omega * amplitudes[1]),
                -s @ (omega**2 * amplitudes[0]) - c @ (omega**2 * amplitudes[1]),
            )
        )
    q, v, a = (np.column_stack(each) for each in zip(*columns, strict=True))
    return q, v, a


def _bodies(robot: RobotDescription, model: RobotModel, random: np.random.Generator) -> FloatArray:
    """Return parameters of cylindrical links with random densities and centres."""
    chain = Chain.from_description(robot)
    links = tuple(
        link.model_copy(
            update={
                "mass_kg": link.mass_kg * scale,
                "centre_m": tuple(c + shift for c, shift in zip(link.centre_m, moved, strict=True)),
                "inertia_kg_m2": tuple(scale * each for each in link.inertia_kg_m2),
            }
        )
        for link, scale, moved in zip(
            nominal_links(chain.rows, chain.tool_m),
            random.uniform(0.3, 2.0, len(robot.joints)).tolist(),
            random.uniform(-0.05, 0.05, (len(robot.joints), 3)).tolist(),
            strict=True,
        )
    )
    values, _ = cad_parameters(model, robot.model_copy(update={"cad": links}))
    return values
