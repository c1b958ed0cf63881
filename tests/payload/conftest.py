"""Fixtures: a six-axis arm with a coupled wrist that carries a payload, by Pinocchio."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.samples import Phase
from acquisition.processing.periods import PeriodAverage, average_periods
from acquisition.recording.recording import Recording
from config.arrays import FloatArray
from config.load import load_robot
from config.robot.robot import RobotDescription
from identification.design.two_harmonic import TwoHarmonicOptions, two_harmonic_draws
from identification.payload.body import PayloadBody
from identification.payload.periodic_runs import PeriodicRuns

CYCLE_S = 0.01
FINE = 5
PERIOD_S = 8.0
COULOMB = np.array([33.4, 32.6, 19.6, 8.3, 6.9, 4.6])
VISCOUS = np.array([9.1, 12.8, 5.8, 3.5, 2.4, 1.6])
# The wrist: motor 4 also moves axes 5 and 6, motor 5 also moves axis 6.
COUPLING = (
    (1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 1.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0, 1.0, 0.0, 0.0),
    (0.0, 0.0, 0.0, 0.02, 1.0, 0.0),
    (0.0, 0.0, 0.0, -0.015, 0.03, 1.0),
)
# Medium reference payload of the thesis (table 5.5): m, c, then Ixx Iyy Izz Ixy Ixz Iyz about c.
MEDIUM = PayloadBody.of_reported(
    np.array([9.579, 0.024, 0.090, -0.202, 0.612, 0.063, 0.637, -0.158, -0.002, -0.008])
)


@dataclass(frozen=True)
class PayloadPlant:
    """Model of the arm in Pinocchio: links by their CAD data, no rotors, friction at the motors.

    The payload is given in the flange frame.
    """

    robot: RobotDescription
    model: pin.Model

    @classmethod
    def of(cls, robot: RobotDescription, payload: PayloadBody | None) -> PayloadPlant:
        assert robot.cad is not None
        model = pin.Model()
        model.gravity.linear = np.array(robot.gravity_m_s2)
        parent = 0
        rows = robot.kinematics.modified_rows()
        for number, (row, cad) in enumerate(zip(rows, robot.cad, strict=True), start=1):
            x = pin.SE3(pin.utils.rotate("x", row.alpha_rad), np.array([row.a_m, 0.0, 0.0]))
            z = pin.SE3(pin.utils.rotate("z", row.theta_rad), np.array([0.0, 0.0, row.d_m]))
            parent = model.addJoint(parent, pin.JointModelRZ(), x * z, f"j{number}")
            xx, xy, xz, yy, yz, zz = cad.inertia_kg_m2
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            body = pin.Inertia(cad.mass_kg, np.array(cad.centre_m), inertia)
            model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        if payload is not None:
            rpy = pin.rpy.rpyToMatrix(*robot.tool_rpy_rad)
            tool = pin.SE3(rpy, np.array(robot.tool_offset_m))
            body = pin.Inertia(payload.mass_kg, payload.centre_m, payload.inertia_kg_m2)
            model.appendBodyToJoint(parent, body, tool)
        return cls(robot, model)

    def torque(self, q: FloatArray, v: FloatArray, a: FloatArray, friction: float) -> FloatArray:
        """Return the motor torques on the link side [N m], (samples, 6).

        `friction` is a factor of the friction torques.
        """
        data = self.model.createData()
        joint = np.array([pin.rnea(self.model, data, *row) for row in zip(q, v, a, strict=True)])
        coupling = np.eye(6) if self.robot.coupling is None else np.array(self.robot.coupling)
        speed = v @ np.linalg.inv(coupling).T
        friction_nm = COULOMB * np.sign(speed) + VISCOUS * speed
        return np.asarray(joint @ coupling + friction * friction_nm)


def six_axes(**update: object) -> RobotDescription:
    """Return the UR10e with a coupled wrist and a shifted, tilted flange."""
    robot = load_robot("ur10e")
    joints = tuple(
        joint.model_copy(update={"friction": ("coulomb", "viscous"), "rotor": None})
        for joint in robot.joints
    )
    return robot.model_copy(
        update={
            "joints": joints,
            "coupling": COUPLING,
            "tool_offset_m": (0.01, -0.02, 0.05),
            "tool_rpy_rad": (0.1, -0.2, 0.3),
        }
        | update
    )


def motion_of(
    robot: RobotDescription, seed: int = 1, axes: tuple[int, ...] | None = None
) -> FourierMotion:
    """Return a motion of two harmonics per axis; only the axes in `axes` move (None: all)."""
    draws = two_harmonic_draws(
        robot,
        TwoHarmonicOptions(PERIOD_S, highest_harmonic=10, limit_fraction=0.5, seed=seed, periods=4),
    )
    motion = next(draws)
    if axes is None:
        return motion
    joints = tuple(
        joint
        if j in axes
        else joint.model_copy(
            update={
                "sine": tuple(0.0 for _ in joint.sine),
                "cosine": tuple(0.0 for _ in joint.cosine),
            }
        )
        for j, joint in enumerate(motion.joints)
    )
    return motion.model_copy(update={"joints": joints})


def measured(
    robot: RobotDescription,
    motion: FourierMotion,
    payload: PayloadBody | None,
    *,
    seed: int,
    friction: float = 1.0,
    noise_nm: float = 1.0,
    periods: int = 4,
    gain: FloatArray | None = None,
) -> Recording:
    """Return periods as drives measure them: band-limited torque, noise, rounded positions."""
    trajectory = motion.trajectory(robot, CYCLE_S)
    samples = trajectory.samples_per_period
    random = np.random.default_rng(seed)
    times = np.arange(samples * FINE, dtype=np.float64) * (CYCLE_S / FINE)
    q, v, a = (
        f(times) for f in (trajectory.position, trajectory.velocity, trajectory.acceleration)
    )
    tau = PayloadPlant.of(robot, payload).torque(q, v, a, friction)
    spectrum = np.fft.rfft(tau, axis=0)
    spectrum[samples // 2 :] = 0.0
    tau = np.tile(np.fft.irfft(spectrum, n=len(times), axis=0)[::FINE], (periods, 1))
    if gain is not None:
        tau = tau * gain
    tau = tau + noise_nm * random.standard_normal(tau.shape)
    position = np.round(np.tile(q[::FINE], (periods, 1)) / 3e-6) * 3e-6
    rows = periods * samples
    return Recording(
        joint_names=robot.joint_names,
        time_s=np.arange(rows, dtype=np.float64) * CYCLE_S,
        position=position,
        torque_nm=tau,
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(rows),
        source="cell",
        sample_period_s=CYCLE_S,
        samples_per_period=samples,
    )


def averaged(*arguments: object, **options: object) -> PeriodAverage:
    """Return the period average of a recording by `measured`."""
    return average_periods(measured(*arguments, **options))  # type: ignore[arg-type]


@pytest.fixture(scope="session")
def lab() -> SimpleNamespace:
    """Functions and constants for the tests of this folder."""
    return SimpleNamespace(
        six_axes=six_axes,
        motion_of=motion_of,
        measured=measured,
        averaged=averaged,
        medium=MEDIUM,
        coulomb_nm=COULOMB,
    )


@pytest.fixture(scope="session")
def robot() -> RobotDescription:
    return six_axes()


@pytest.fixture(scope="session")
def motion(robot: RobotDescription) -> FourierMotion:
    return motion_of(robot)


@pytest.fixture(scope="session")
def unloaded(robot: RobotDescription, motion: FourierMotion) -> PeriodAverage:
    """Run without payload, with 10 % more friction than the loaded run, as its own unknown."""
    return averaged(robot, motion, None, seed=1, friction=1.1)


@pytest.fixture(scope="session")
def loaded(robot: RobotDescription, motion: FourierMotion) -> PeriodAverage:
    return averaged(robot, motion, MEDIUM, seed=2)


@pytest.fixture(scope="session")
def both(unloaded: PeriodAverage, loaded: PeriodAverage) -> PeriodicRuns:
    return PeriodicRuns((unloaded, loaded), (False, True), 10.0, 0.02)
