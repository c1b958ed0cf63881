"""Simulated cells with elastic gears: arms like ir361 that differ in bodies, gears and friction.

The plant of the mock hardware (Pinocchio) is driven in this process, with the timing of a bus: a
command is sent once per cycle, acts one cycle later, and is approached linearly within a cycle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from acquisition.motion.samples import MotionSamples
from acquisition.recording.reaction import Reaction
from acquisition.recording.recording import Recording
from acquisition.tracker.link_file import LinkPositions
from acquisition.tracker.tracker_file import TrackedPoint
from compensation.loops.velocity_loop import VelocityLoop
from config.arrays import FloatArray
from config.load import load_cell
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig, UnmodelledEffects
from config.simulation.tracker import SimulatedTracker
from mock_hw.plant.plant import Plant
from mock_hw.plant.tracker import Tracker

STIFFNESS: Final = np.array([5e4, 6e4, 2e4])
DAMPING_RATIO: Final = 0.05
INERTIA: Final = np.array([11.0, 12.0, 1.6])
BODY_ERROR: Final = 0.1
LARGEST_FACTOR: Final = 2.5
"""The stiffness of a cell's gears is 0.8 to 2.5 times `STIFFNESS`."""

PLATE_NOISE: Final = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3])
CHANNELS: Final = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
SLOW_S: Final = 3.0
ROW_ERROR: Final = 5e-4
"""Standard deviation of the errors of angles [rad] and lengths [m] of the kinematics."""
POINT_M: Final = np.array([0.765, 0.0, 0.0])
POINT_ERROR_M: Final = 1e-3
LINK_INCREMENTS: Final = 262144
LINK_RATE_HZ: Final = 400.0
LINK_CLOCK_S: Final = 31.7


@dataclass(frozen=True, eq=False)
class Driven:
    """A motion that was driven.

    Attributes:
        recording: What the drives measured.
        links: Shape (samples, n). True positions of the links.
        tracked: What the tracker measured; it is 0.05 mm noisy, and on its own clock and frame.
    """

    recording: Recording
    links: FloatArray
    tracked: TrackedPoint

    def link_positions(self) -> LinkPositions:
        """Return what encoders on the link side measure: quantised, on their own clock."""
        time_s = self.recording.time_s
        own = np.arange(time_s[0], time_s[-1], 1.0 / LINK_RATE_HZ)
        step = 2.0 * np.pi / LINK_INCREMENTS
        position = np.round(CubicSpline(time_s, self.links)(own) / step) * step
        return LinkPositions(own + LINK_CLOCK_S, tuple(range(self.links.shape[1])), position)


@dataclass(frozen=True, eq=False)
class ElasticCell:
    """A simulated cell with elastic gears.

    Attributes:
        robot: Description of the robot, without the gears' stiffness.
        plant: The true arm.
        stiffness: Shape (n,). True stiffness of the gears [N m/rad].
    """

    robot: RobotDescription
    plant: PlantConfig
    stiffness: FloatArray

    @classmethod
    def of(cls, seed: int, stiffness: FloatArray | None = None) -> ElasticCell:
        """Return a cell whose bodies and friction depend on the seed.

        Without a given stiffness, the stiffness and the true kinematics depend on the seed too.
        """
        random = np.random.default_rng(seed)
        bundled = load_cell("ir361")
        plant = bundled.plant
        assert plant is not None
        kinematics = None
        if stiffness is None:
            kinematics = _off_nominal(bundled.robot, np.random.default_rng([seed, 1]))
            stiffness = STIFFNESS * random.uniform(0.8, LARGEST_FACTOR, 3)
        damping = 2.0 * DAMPING_RATIO * np.sqrt(stiffness * INERTIA)

        def varied(values: tuple[float, ...]) -> tuple[float, ...]:
            factors = 1.0 + BODY_ERROR * random.uniform(-1.0, 1.0, len(values))
            return tuple((np.array(values) * factors).tolist())

        links = tuple(
            link.model_copy(
                update={
                    "mass_kg": varied((link.mass_kg,))[0],
                    "centre_m": varied(link.centre_m),
                    "inertia_kg_m2": varied(link.inertia_kg_m2),
                }
            )
            for link in plant.links
        )
        axes = tuple(
            extra.model_copy(
                update={
                    "joint_stiffness_nm_rad": k,
                    "joint_damping_nm_s": d,
                    "presliding_rad": float(random.uniform(1e-4, 4e-4)),
                }
            )
            for extra, k, d in zip(plant.extras, stiffness.tolist(), damping.tolist(), strict=True)
        )
        point = POINT_M + POINT_ERROR_M * np.random.default_rng([seed, 2]).normal(size=3)
        tracker = SimulatedTracker(
            point_m=tuple(point.tolist()),
            position_m=(2.5, 0.8, 0.3),
            rotation_rad=(0.1, -0.2, 2.4),
            clock_offset_s=4711.0,
            clock_ppm=30.0,
        )
        effects = UnmodelledEffects(axes=axes, kinematics=kinematics)
        changed = {"links": links, "unmodelled": effects, "tracker": tracker}
        return cls(bundled.robot, plant.model_copy(update=changed), stiffness)

    @property
    def loops(self) -> tuple[VelocityLoop, ...]:
        """The velocity loops of the simulated drives, as `loop` measures them within 0.5 %."""
        return tuple(
            VelocityLoop(
                joint_name=joint.name,
                gain=axis.velocity_gain_nm_s,
                integral_time_s=axis.velocity_integral_time_s,
                delay_s=0.0,
                lag_s=1.0 / (2.0 * np.pi * axis.current_loop_bandwidth_hz),
                names=(),
                covariance=np.zeros((0, 0)),
                p_value=1.0,
                trials=(),
            )
            for joint, axis in zip(self.robot.joints, self.plant.axes, strict=True)
        )

    def drive(
        self, samples: MotionSamples, seed: int, *, plate: bool = False, mounted: str | None = None
    ) -> Driven:
        """Drive a motion.

        Args:
            seed: Random seed of the noise.
            plate: True to record the base wrench.
            mounted: Payload of the plant that the arm carries; None for an empty flange.
        """
        config = load_cell("ir361").config
        samples, step_s = samples.whole(), config.cycle_time_s
        plant = Plant(self.robot, self.plant, config.torque_filter, seed)
        plant.attach(mounted)
        ratio = np.array([abs(joint.gear_ratio) for joint in self.robot.joints])
        counts = np.array([axis.encoder_increments_per_motor_rev for axis in self.plant.axes])
        per_count = 2.0 * np.pi / (counts * ratio)
        rated = np.array([axis.rated_motor_torque_nm for axis in self.plant.axes])
        on, off = [True] * len(ratio), [False] * len(ratio)
        approach = round(SLOW_S / step_s)
        start = plant.position_counts() * per_count
        first = samples.position[0]
        before = now = np.zeros(len(ratio))
        tracker = Tracker(self.robot, self.plant, seed)
        tracker.begin(plant.time_s, plant.position, plant.velocity)
        tracked: list[FloatArray] = []
        rows = len(samples.position)
        position, torque, links, wrench = (
            np.empty((rows, width)) for width in (len(ratio), len(ratio), len(ratio), 6)
        )
        ahead = samples.velocity if samples.feedforward is None else samples.feedforward
        for row in range(-approach - round(1.0 / step_s), rows):
            at = (plant.position_counts() + 0.5) * per_count
            if row < 0:
                share = min(1.0, 1.0 + (row + 1.0 / step_s) / approach)
                command = config.position_gain_per_s * (start + share * (first - start) - at)
            else:
                position[row], links[row] = at, plant.position
                torque[row] = plant.torque_permille() * (0.001 * rated * ratio)
                if plate:
                    wrench[row] = plant.base_wrench
                command = config.position_gain_per_s * (samples.position[row] - at) + ahead[row]
            plant.advance(step_s, before, now, on, off)
            tracked += tracker.observe(plant.time_s, plant.position, plant.velocity)
            before, now = now, command
        reaction = None
        if plate:
            noise = PLATE_NOISE * np.random.default_rng(seed).normal(size=wrench.shape)
            valid = np.ones(wrench.shape, dtype=np.bool_)
            reaction = Reaction(CHANNELS, wrench + noise, valid, np.eye(6))
        measured = np.array(tracked)
        return Driven(
            Recording(
                joint_names=self.robot.joint_names,
                time_s=step_s * np.arange(rows, dtype=np.float64),
                position=position,
                torque_nm=torque,
                valid=np.ones(rows, dtype=np.bool_),
                phase=samples.phase,
                sample_index=np.arange(rows),
                source="cell",
                target_position=samples.position,
                sample_period_s=step_s,
                samples_per_period=samples.samples_per_period,
                torque_filter=config.torque_filter,
                reaction=reaction,
            ),
            links,
            TrackedPoint(measured[:, 0], measured[:, 1:]),
        )


def _off_nominal(robot: RobotDescription, random: np.random.Generator) -> Kinematics:
    """Return kinematics that differ from the nominal ones."""
    offsets = ROW_ERROR * random.normal(size=(len(robot.joints), 5))
    rows = tuple(
        KinematicRow(alpha_rad=alpha, beta_rad=beta, theta_rad=theta, a_m=a, d_m=d)
        for alpha, beta, theta, a, d in offsets.tolist()
    )
    return robot.kinematics.model_copy(update={"calibration": rows})
