"""Fixtures: the bundled arm with known parameters, and simulated measurements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy import signal
from scipy.interpolate import CubicSpline

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.recording.plate_geometry import PlateGeometry
from acquisition.recording.reaction import resample_reaction
from acquisition.recording.recording import Recording
from acquisition.signals.clocks import clock_from_arrivals
from benchmarks.closed_loop import closed_loop
from config.cell.plate import AmplifierConfig, PlateConfig
from config.cell.torque_filter import ButterworthFilter
from config.load import LoadedCell, load_cell, load_robot
from config.robot.bodies import Capsule
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, torque
from dynamics.model.true_parameters import true_parameters
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.model.base_parameters import base_parameters
from mock_hw.plant.rigid_bodies import build_rigid_bodies

CYCLE_S = 0.008
FINE = 16


@dataclass(frozen=True)
class KnownArm:
    """The bundled three-axis arm, an excitation for it, and its true parameters."""

    robot: RobotDescription
    model: RobotModel
    motion: FourierMotion
    standard: NDArray[np.float64]
    base: NDArray[np.float64]


@pytest.fixture(scope="session")
def cell() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture(scope="session")
def arm(cell: LoadedCell) -> KnownArm:
    assert cell.plant is not None
    model = RobotModel.from_description(cell.robot)
    standard = true_parameters(model, cell.robot, cell.plant)
    return KnownArm(
        robot=cell.robot,
        model=model,
        motion=design_two_harmonic(
            cell.robot, TwoHarmonicOptions(5.0, highest_harmonic=6, tries=50, periods=8), CYCLE_S
        ),
        standard=standard,
        base=base_parameters(model).from_standard(standard),
    )


Measure = Callable[..., Recording]


@pytest.fixture(scope="session")
def measure(arm: KnownArm) -> Measure:
    """Return a function that makes periods which obey the model exactly.

    Filter, noise and rounding of the encoders are added.
    """

    def of(
        seed: int = 0,
        *,
        noise_nm: float = 1.0,
        encoder_step_rad: float = 3e-6,
        torque_filter: ButterworthFilter | None = None,
        periods: int = 8,
        motion: FourierMotion | None = None,
        parameters: NDArray[np.float64] | None = None,
        model: RobotModel | None = None,
    ) -> Recording:
        trajectory = (motion or arm.motion).trajectory(arm.robot, CYCLE_S)
        samples = trajectory.samples_per_period
        random = np.random.default_rng(seed)
        times = np.arange(samples * FINE, dtype=np.float64) * (CYCLE_S / FINE)
        q, v, a = (
            f(times) for f in (trajectory.position, trajectory.velocity, trajectory.acceleration)
        )
        standard = arm.standard if parameters is None else parameters
        tau = torque(model or arm.model, q, v, a, standard)
        if torque_filter is not None:
            b, a_ = signal.butter(
                torque_filter.order, 2.0 * np.pi * torque_filter.cutoff_hz, analog=True
            )
            omega = 2.0 * np.pi * np.fft.rfftfreq(len(times), times[1])
            response = signal.freqs(b, a_, omega)[1]
            tau = np.fft.irfft(np.fft.rfft(tau, axis=0) * response[:, None], n=len(times), axis=0)
        tau = np.tile(tau[::FINE], (periods, 1))
        tau += noise_nm * random.standard_normal(tau.shape)
        position = np.tile(q[::FINE], (periods, 1))
        if encoder_step_rad:
            position = np.round(position / encoder_step_rad) * encoder_step_rad
        rows = periods * samples
        return Recording(
            joint_names=arm.robot.joint_names,
            time_s=np.arange(rows, dtype=np.float64) * CYCLE_S,
            position=position,
            torque_nm=tau,
            valid=np.ones(rows, dtype=np.bool_),
            phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
            sample_index=np.arange(rows),
            source="cell",
            sample_period_s=CYCLE_S,
            samples_per_period=samples,
            torque_filter=torque_filter,
        )

    return of


Run = Callable[[MotionSamples, int], Recording]


@pytest.fixture(scope="session")
def run(cell: LoadedCell) -> Run:
    """Return a function that runs the simulated robot along a motion.

    The simulation has servo loops, stiction and encoders, but no unmodelled effects.
    """

    def through(samples: MotionSamples, seed: int) -> Recording:
        assert cell.plant is not None
        return closed_loop(cell, cell.plant.without_unmodelled(), samples, seed)

    return through


@dataclass(frozen=True)
class PinocchioArm:
    """The bundled six-axis arm in Pinocchio: links from CAD, and their capsules."""

    model: pin.Model
    geometry: pin.GeometryModel

    def distances(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance [m] of each pair of bodies on links that are not neighbours."""
        data, places = self.model.createData(), self.geometry.createData()
        pin.computeDistances(self.model, data, self.geometry, places, q)
        return np.array([result.min_distance for result in places.distanceResults])


@pytest.fixture(scope="session")
def pinocchio_arm() -> PinocchioArm:
    robot = load_robot("ur10e")
    assert robot.cad is not None
    model, geometry = pin.Model(), pin.GeometryModel()
    parent, frames = 0, [0]
    for number, (row, cad) in enumerate(
        zip(robot.kinematics.modified_rows(), robot.cad, strict=True), start=1
    ):
        x = pin.SE3(pin.utils.rotate("x", row.alpha_rad), np.array([row.a_m, 0.0, 0.0]))
        z = pin.SE3(pin.utils.rotate("z", row.theta_rad), np.array([0.0, 0.0, row.d_m]))
        parent = model.addJoint(parent, pin.JointModelRZ(), x * z, f"j{number}")
        frames.append(parent)
        xx, xy, xz, yy, yz, zz = cad.inertia_kg_m2
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        body = pin.Inertia(cad.mass_kg, np.array(cad.centre_m), inertia)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    for number, capsule in enumerate(robot.bodies):
        assert isinstance(capsule, Capsule)
        start, end = np.array(capsule.start_m), np.array(capsule.end_m)
        up = np.array([0.0, 0.0, 1.0])
        rotation = pin.Quaternion.FromTwoVectors(up, end - start).matrix()
        shape = coal.Capsule(capsule.radius_m, float(np.linalg.norm(end - start)))
        place = pin.SE3(rotation, (start + end) / 2.0)
        geometry.addGeometryObject(
            pin.GeometryObject(f"b{number}", frames[capsule.link], place, shape)
        )
    links = [body.link for body in robot.bodies]
    for i, first in enumerate(links):
        for k in range(i + 1, len(links)):
            if abs(first - links[k]) > 1:
                geometry.addCollisionPair(pin.CollisionPair(i, k))
    return PinocchioArm(model, geometry)


STEP_S = 0.0005

PLATE = PlateConfig(
    a_m=0.120,
    b_m=0.200,
    az0_m=-0.054,
    position_m=(0.02, -0.01, 0.03),
    rotation_rad=(0.0, 0.0, 0.4),
    amplifier=AmplifierConfig(
        address="nowhere",
        baud_rate=460_800,
        rate_hz=960.0,
        low_pass_hz=100.0,
        range_n=(1250.0,) * 4 + (5000.0,) * 4,
        sensitivity_pc_n=(-7.5,) * 4 + (-3.8,) * 4,
    ),
)


def base_wrench(
    cell: LoadedCell, q: NDArray[np.float64], v: NDArray[np.float64], a: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the wrench of the base on links and rotors about the base's origin, (rows, 6)."""
    assert cell.plant is not None
    bodies = build_rigid_bodies(cell.robot, cell.plant.without_unmodelled())
    model, data = bodies.model, bodies.model.createData()
    gear = bodies.gearing.T
    wrench = np.zeros((len(q), 6))
    on_base = [i for i in range(1, model.njoints) if model.parents[i] == 0]
    for row, (qf, vf, af) in enumerate(zip(q @ gear, v @ gear, a @ gear, strict=True)):
        pin.rnea(model, data, qf, vf, af)
        for i in on_base:
            wrench[row] += data.liMi[i].act(data.f[i]).vector
    return wrench


@dataclass(frozen=True)
class SimulatedPlate:
    """Simulation of a plate and its amplifier, with independent noise on every reading.

    It is independent of the estimators: Pinocchio computes the wrench, and the amplifier has a
    separate clock.
    """

    config: PlateConfig = PLATE
    noise_n: float = 0.5
    offset_n: float = 0.0
    drift_n_s: float = 0.0
    clock_ppm: float = 100.0
    clock_offset_s: float = 0.003
    jitter_s: float = 0.005
    delay_s: float = 0.0
    overloaded: tuple[int, ...] = ()

    def weigh(
        self, cell: LoadedCell, motion: FourierMotion, recording: Recording, seed: int = 0
    ) -> Recording:
        """Return a recording of whole periods with measurements of the plate."""
        assert recording.sample_period_s is not None
        trajectory = motion.trajectory(cell.robot, recording.sample_period_s)
        at = np.arange(0.0, motion.period_s - STEP_S / 2.0, STEP_S)
        wrench = base_wrench(
            cell,
            trajectory.position(at),
            trajectory.velocity(at),
            trajectory.acceleration(at),
        )
        channels = PlateGeometry.from_config(self.config).channels(wrench)
        amplifier = self.config.amplifier
        b, a = signal.butter(
            amplifier.low_pass_order, 2.0 * np.pi * amplifier.low_pass_hz, analog=True
        )
        omega = 2.0 * np.pi * np.fft.rfftfreq(len(at), STEP_S)
        response = signal.freqs(b, a, omega)[1] * np.exp(-1j * omega * self.delay_s)
        passed = np.fft.irfft(np.fft.rfft(channels, axis=0) * response[:, None], len(at), axis=0)
        curve = CubicSpline(
            np.append(at, motion.period_s), np.vstack([passed, passed[:1]]), bc_type="periodic"
        )
        random = np.random.default_rng(1000 + seed)
        duration_s = recording.time_s[-1] - recording.time_s[0]
        rows = int((duration_s + 1.0) * amplifier.rate_hz)
        device = np.arange(rows) / amplifier.rate_hz
        true = -0.5 + device * (1.0 + 1e-6 * self.clock_ppm) + self.clock_offset_s
        readings = curve(np.mod(true, motion.period_s))
        readings += self.noise_n * random.standard_normal(readings.shape)
        readings += self.offset_n * random.uniform(-1.0, 1.0, 8)
        readings += self.drift_n_s * random.uniform(-1.0, 1.0, 8) * true[:, None]
        valid = np.ones(readings.shape, dtype=np.bool_)
        valid[:, list(self.overloaded)] = False
        readings[:, list(self.overloaded)] = 1250.0
        arrival = np.maximum.accumulate(true + self.jitter_s * random.uniform(size=rows))
        clock = clock_from_arrivals(device, recording.time_s[0] + arrival)
        reaction = resample_reaction(self.config, clock, device, readings, valid, recording.time_s)
        return replace(recording, reaction=reaction)


Weigh = Callable[..., Recording]


@pytest.fixture(scope="session")
def weigh(arm: KnownArm, cell: LoadedCell, measure: Measure) -> Weigh:
    """Return a function that makes periods like `measure`, on a force plate loaded by Pinocchio.

    `plate` has fields of `SimulatedPlate`.
    """

    def of(seed: int = 0, *, plate: dict[str, Any] | None = None, **measured: Any) -> Recording:
        motion = measured.get("motion") or arm.motion
        plain = measure(seed, **({"periods": 16} | measured))
        return SimulatedPlate(**(plate or {})).weigh(cell, motion, plain, seed)

    return of
