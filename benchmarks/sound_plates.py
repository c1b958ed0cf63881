"""Simulation of invented arms on force plates with Pinocchio: motion and measured wrench.

The simulation does not use the project's dynamics. The arms' axes differ slightly from the robot
file, and the plates' channels have a gain error and noise, so that no model explains the wrench
exactly.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

from acquisition.motion.samples import Phase
from acquisition.processing.periods import PeriodAverage, average_periods
from acquisition.recording.plate_geometry import PlateGeometry
from acquisition.recording.reaction import Reaction
from acquisition.recording.recording import Recording
from benchmarks.regressor import pinocchio_arm
from benchmarks.sound_robots import ROBOTS
from config.arrays import FloatArray
from config.cell.plate import CHANNEL_NAMES, CHANNELS, AmplifierConfig, PlateConfig
from config.load import load_robot
from config.robot.nominal_links import nominal_links
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain

STEP_S: Final = 0.01
HARMONICS: Final = 6
PERIODS: Final = 4
NOISE_N: Final = 0.5
GAIN_ERROR: Final = 0.01
LENGTH_ERROR_M: Final = 1e-3
ANGLE_ERROR_RAD: Final = 2e-3


@dataclass(frozen=True, eq=False)
class WeighedArm:
    """A periodic recording of an arm on a force plate, and the plate's correct description.

    Attributes:
        robot: Description of the robot in its file.
        recording: The recording, without delay of the plate.
        plate: The correct description.
    """

    robot: RobotDescription
    recording: Recording
    plate: PlateConfig

    @property
    def average(self) -> PeriodAverage:
        """The mean period."""
        return average_periods(self.recording)


def weighed_arms(count: int, first_seed: int = 0) -> Iterator[WeighedArm]:
    """Yield arms on plates, each with different bodies, motion and plate."""
    for seed in range(first_seed, first_seed + count):
        random = np.random.default_rng(seed)
        yield weighed_arm(load_robot(ROBOTS[seed % len(ROBOTS)]), random)


def weighed_arm(robot: RobotDescription, random: np.random.Generator) -> WeighedArm:
    """Return a recording of an arm with random bodies on a random plate."""
    plate = _plate(random)
    q, v, a = _motion(robot, random)
    wrench, torque_nm = _reaction(_arm(robot, random), q, v, a)
    gains = random.normal(1.0, GAIN_ERROR, CHANNELS)
    channels = PlateGeometry.from_config(plate).channels(wrench) * gains
    channels = np.tile(channels, (PERIODS, 1))
    channels += NOISE_N * random.standard_normal(channels.shape)
    rows = len(channels)
    torque_nm = np.tile(torque_nm, (PERIODS, 1))
    torque_nm += 0.01 * np.abs(torque_nm).max(axis=0) * random.standard_normal(torque_nm.shape)
    reaction = Reaction(
        channel_names=CHANNEL_NAMES,
        channels_n=channels,
        valid=np.ones(channels.shape, dtype=np.bool_),
        base_wrench_matrix=PlateGeometry.from_config(plate).base_wrench_matrix,
    )
    recording = Recording(
        joint_names=robot.joint_names,
        time_s=STEP_S * np.arange(rows, dtype=np.float64),
        position=np.tile(q, (PERIODS, 1)) + 1e-6 * random.standard_normal((rows, q.shape[1])),
        torque_nm=torque_nm,
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(rows),
        source="cell",
        sample_period_s=STEP_S,
        samples_per_period=rows // PERIODS,
        reaction=reaction,
    )
    return WeighedArm(robot, recording, plate)


def _plate(random: np.random.Generator) -> PlateConfig:
    """Return a plate of a usual size at a random position under the arm."""
    a_m, b_m = random.uniform(0.1, 0.35, 2).tolist()
    x, y, z = random.uniform(-0.08, 0.08, 3).tolist()
    return PlateConfig(
        a_m=a_m,
        b_m=b_m,
        az0_m=-float(random.uniform(0.02, 0.07)),
        position_m=(x, y, z),
        rotation_rad=(math.pi, 0.0, float(random.uniform(-math.pi, math.pi))),
        amplifier=AmplifierConfig(
            address="nowhere",
            baud_rate=460_800,
            rate_hz=1000.0,
            low_pass_hz=100.0,
            range_n=(5000.0,) * CHANNELS,
            sensitivity_pc_n=(-7.5,) * 4 + (-3.8,) * 4,
        ),
    )


def _motion(
    robot: RobotDescription, random: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return one period of a sum of harmonics whose speed is close to the joints' limits."""
    rows = round(random.uniform(4.0, 8.0) / STEP_S)
    omega = 2.0 * math.pi / (rows * STEP_S) * np.arange(1, HARMONICS + 1)
    angle = np.outer(STEP_S * np.arange(rows, dtype=np.float64), omega)
    s, c = np.sin(angle), np.cos(angle)
    columns = []
    for joint in robot.joints:
        limits = joint.limits
        sines, cosines = random.normal(0.0, 1.0, (2, HARMONICS)) / np.arange(1, HARMONICS + 1)
        wave = s @ sines + c @ cosines
        speed = c @ (omega * sines) - s @ (omega * cosines)
        hard = -s @ (omega**2 * sines) - c @ (omega**2 * cosines)
        reach = min(0.4 * (limits.position_max - limits.position_min), 1.5)
        most = (reach / np.ptp(wave) * 2.0, 0.9 * limits.velocity / np.abs(speed).max())
        scale = min(*most, 6.0 / np.abs(hard).max())
        middle = 0.5 * (limits.position_min + limits.position_max) - scale * wave.mean()
        columns.append((middle + scale * wave, scale * speed, scale * hard))
    q, v, a = (np.column_stack(each) for each in zip(*columns, strict=True))
    return q, v, a


def _arm(robot: RobotDescription, random: np.random.Generator) -> pin.Model:
    """Return the CAD bodies, or cylinders, with random densities, on slightly displaced axes."""
    chain = Chain.from_description(robot)
    n = len(robot.joints)
    rows = chain.rows + random.normal(0.0, 1.0, (n, 5)) * np.repeat(
        [ANGLE_ERROR_RAD, LENGTH_ERROR_M], [3, 2]
    )
    moved = Chain(rows, chain.prismatic, chain.gravity_m_s2, chain.tool_m)
    model = pinocchio_arm(moved)
    model.gravity.linear = np.array(robot.gravity_m_s2)
    drawn = robot.cad if robot.is_drawn else None
    for j, link in enumerate(drawn or nominal_links(chain.rows, chain.tool_m)):
        density = float(random.uniform(0.6, 1.6) if drawn else random.uniform(0.3, 2.0))
        centre = np.array(link.centre_m) + random.uniform(-0.05, 0.05, 3)
        xx, xy, xz, yy, yz, zz = link.inertia_kg_m2
        inertia = density * np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        model.inertias[j + 1] = pin.Inertia(density * link.mass_kg, centre, inertia)
    return model


def _reaction(
    model: pin.Model, q: FloatArray, v: FloatArray, a: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the wrench of the base on the arm about the base origin, and the torques."""
    data = model.createData()
    wrench, torque_nm = np.empty((len(q), 6)), np.empty_like(q)
    for k in range(len(q)):
        torque_nm[k] = pin.rnea(model, data, q[k], v[k], a[k])
        wrench[k] = data.liMi[1].act(data.f[1]).vector
    return wrench, torque_nm
