"""Friction estimated from simulated recordings whose friction law is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from acquisition.motion.kinds.constant_velocity import ConstantVelocityMotion, SpeedRuns
from acquisition.motion.kinds.fourier import FourierJoint
from acquisition.motion.kinds.reversed import ReversedMotion
from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from config.cell.torque_filter import ButterworthFilter
from config.errors import DataQualityError, EstimationError
from config.load import load_robot
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, torque
from identification.friction.curve import FrictionCurve, friction_columns, join_curves
from identification.friction.experiments import constant_velocity_curves, reversed_curves
from identification.friction.fits import MODELS, fit_friction
from identification.model.options import ModelOptions
from rid_daq.report.sections.friction import FrictionSection
from tests.builders.raised_codes import raises_code

CYCLE_S = 0.008
IR361 = load_robot("ir361")
NOISE_NM = 0.5


def stribeck(v: np.ndarray) -> np.ndarray:
    """Return Stribeck friction (equation 2.10 of the thesis) plus an offset of 1.5 N m."""
    size = 20.0 + 6.0 * np.exp(-np.abs(v) / 0.08) + 15.0 * np.abs(v)
    return np.sign(v) * size + 1.5


def without_friction(robot: RobotDescription) -> tuple[RobotModel, np.ndarray]:
    model = ModelOptions(friction=False).build(robot)
    values = np.random.default_rng(3).uniform(0.5, 2.0, len(model.parameter_names))
    values[30:33] = 3e-4  # rotors
    values[33:] = (7000.0, 1800.0)  # spring
    return model, values


def recording_of(
    motion: AnyMotion,
    friction: Callable[[np.ndarray], np.ndarray] = stribeck,
    *,
    noise_nm: float = NOISE_NM,
    robot: RobotDescription = IR361,
    wobble: float = 0.0,
) -> Recording:
    """Return the recording of an ideal drive; `wobble` disturbs the return path [rad]."""
    samples = motion.plan(robot, CYCLE_S)
    q, v, a = (np.array(x) for x in (samples.position, samples.velocity, samples.acceleration))
    back = np.flatnonzero(samples.phase == Phase.HOLD)
    if wobble:
        rows = slice(back[-1] + 1, None)
        omega = 2.0 * np.pi * 3.0
        angle = omega * CYCLE_S * np.arange(len(q))[rows, np.newaxis]
        q[rows] += wobble * np.sin(angle)
        v[rows] += wobble * omega * np.cos(angle)
        a[rows] -= wobble * omega**2 * np.sin(angle)
    model, values = without_friction(robot)
    tau = torque(model, q, v, a, values)
    motors = v if robot.coupling is None else v @ np.linalg.inv(np.array(robot.coupling)).T
    moving = np.abs(motors) > 1e-9
    tau += np.where(moving, friction(motors), 0.0)
    tau += noise_nm * np.random.default_rng(0).standard_normal(tau.shape)
    return Recording(
        joint_names=robot.joint_names,
        time_s=np.arange(len(samples), dtype=np.float64) * CYCLE_S,
        position=q,
        torque_nm=tau,
        valid=np.ones(len(samples), dtype=np.bool_),
        phase=samples.phase,
        sample_index=np.arange(len(samples)),
        source="cell",
        sample_period_s=CYCLE_S,
    )


STEADY = ConstantVelocityMotion(
    kind="constant_velocity",
    robot="ir361",
    pose=(0.0, -0.2, 0.3),
    joints=(
        SpeedRuns(joint="axis1", low=-1.5, high=1.5, speeds=(0.05, 0.1, 0.2, 0.5, 1.0)),
        SpeedRuns(joint="axis2", low=-1.3, high=0.9, speeds=(0.05, 0.1, 0.2, 0.5, 1.0)),
    ),
    longest_run_s=4.0,
)
THERE_AND_BACK = ReversedMotion(
    kind="reversed",
    robot="ir361",
    period_s=6.0,
    periods=4,
    ramp_s=2.0,
    joints=tuple(
        FourierJoint(joint=name, offset=o, sine=(0.5, 0.0, 0.1, 0.02), cosine=(0.1, 0.2, 0.0, 0.0))
        for name, o in zip(IR361.joint_names, (0.0, -0.2, 0.5), strict=True)
    ),
)


def test_constant_speeds_give_friction_for_any_gravity() -> None:
    for curve in constant_velocity_curves(recording_of(STEADY), STEADY, IR361):
        truth = stribeck(curve.speed) - 1.5
        assert np.abs(curve.odd - truth).max() < 0.15
        assert (np.abs(curve.odd - truth) < 4.0 * curve.odd_sigma).all()


def test_a_vertical_axis_gives_friction_of_each_direction() -> None:
    curve = constant_velocity_curves(recording_of(STEADY), STEADY, IR361)[0]
    assert curve.joint == "axis1"
    assert curve.forward is not None
    assert curve.backward is not None
    assert curve.direction_sigma is not None
    np.testing.assert_allclose(curve.forward, stribeck(curve.speed), atol=0.2)
    np.testing.assert_allclose(curve.backward, stribeck(-curve.speed), atol=0.2)
    assert curve.direction_sigma.max() < 0.1


def test_the_interval_includes_the_uncertainty_of_gravity() -> None:
    curve = constant_velocity_curves(recording_of(STEADY), STEADY, IR361)[1]
    assert curve.even is not None
    assert curve.even_covariance is not None
    assert curve.direction_sigma is not None
    assert curve.direction_sigma.min() > 2.0 * curve.odd_sigma.max()
    assert (np.abs(curve.even - 1.5) < 3.0 * curve.direction_sigma).all()
    # Differences between speeds are known more precisely: they have the same gravity error.
    steps = np.diff(curve.even)
    sigma = np.sqrt(np.diagonal(np.diff(np.diff(curve.even_covariance, axis=0), axis=1)))
    assert sigma.max() < 0.5 * curve.direction_sigma.min()
    assert (np.abs(steps) < 4.0 * sigma).all()


def test_the_same_path_in_both_directions_gives_friction() -> None:
    for curve in reversed_curves(recording_of(THERE_AND_BACK), THERE_AND_BACK, IR361):
        truth = stribeck(curve.speed) - 1.5
        assert np.abs(curve.odd - truth)[1:].max() < 0.3
        assert curve.even is None
        assert len(curve.speed) >= 10


def test_small_differences_between_the_two_paths_are_corrected() -> None:
    # 0.2 mrad at 3 Hz are 0.07 rad/s^2; that times 16 kg m^2 is 1.1 N m.
    recording = recording_of(THERE_AND_BACK, wobble=2e-4)
    for curve in reversed_curves(recording, THERE_AND_BACK, IR361):
        truth = stribeck(curve.speed) - 1.5
        assert np.abs(curve.odd - truth)[1:].max() < 0.4


def test_the_anti_alias_filter_is_compensated() -> None:
    smooth = np.tanh  # continuous friction, so that its spectrum is below 20 Hz
    recording = recording_of(THERE_AND_BACK, lambda v: 20.0 * smooth(v / 0.1), noise_nm=0.0)
    analog = ButterworthFilter(order=8, cutoff_hz=20.0)
    digital = signal.butter(analog.order, 2.0 * np.pi * analog.cutoff_hz, analog=True)
    fine = np.linspace(0.0, recording.time_s[-1], 8 * len(recording))
    inputs = np.stack([np.interp(fine, recording.time_s, x) for x in recording.torque_nm.T])
    outputs = [signal.lsim(digital, x - x[0], fine)[1] + x[0] for x in inputs]
    lagged = np.stack([np.interp(recording.time_s, fine, y) for y in outputs], axis=1)
    filtered = replace(recording, torque_nm=lagged, torque_filter=analog)
    for curve in reversed_curves(filtered, THERE_AND_BACK, IR361):
        np.testing.assert_allclose(curve.odd, 20.0 * smooth(curve.speed / 0.1), atol=0.8)


def test_an_incomplete_recording_is_refused() -> None:
    recording = recording_of(STEADY)
    _, runs = STEADY.runs(IR361, CYCLE_S)
    cut = recording.sample_index < runs[-1].first + 10
    parts = {
        name: getattr(recording, name)[cut]
        for name in ("time_s", "position", "torque_nm", "valid", "phase", "sample_index")
    }
    with raises_code(DataQualityError, "RID-RECORDING-ROWS-LOST", "axis2", "-1", "second"):
        constant_velocity_curves(replace(recording, **parts), STEADY, IR361)
    half = recording_of(THERE_AND_BACK)
    first = half.sample_index < 2000
    parts = {name: getattr(half, name)[first] for name in parts}
    with raises_code(DataQualityError, "RID-RECORDING-ROWS-LOST"):
        reversed_curves(replace(half, **parts), THERE_AND_BACK, IR361)


def coupled_arm(turn: float = 0.8) -> RobotDescription:
    """Return the arm in which motor 2 also moves joint 3; `turn` is the gear ratio of motor 2."""
    coupling = ((1.0, 0.0, 0.0), (0.0, 1.0 / turn, 0.0), (0.0, 0.5, 1.0))
    return IR361.model_copy(update={"coupling": coupling})


def test_a_coupled_wrist_gives_each_motors_friction_over_its_own_speed() -> None:
    robot = coupled_arm()
    curves = constant_velocity_curves(recording_of(STEADY, robot=robot), STEADY, robot)
    np.testing.assert_allclose(curves[0].speed, STEADY.joints[0].speeds)
    np.testing.assert_allclose(curves[1].speed, 0.8 * np.array(STEADY.joints[1].speeds))
    for curve in curves:
        truth = stribeck(curve.speed) - 1.5
        assert np.abs(curve.odd - truth).max() < 0.15
    both = reversed_curves(recording_of(THERE_AND_BACK, robot=robot), THERE_AND_BACK, robot)
    for curve in both:
        fast = curve.speed > 0.1
        assert np.abs(curve.odd - (stribeck(curve.speed) - 1.5))[fast].max() < 0.6


def test_a_reversed_motor_has_friction_of_the_same_sign() -> None:
    robot = coupled_arm(-0.8)
    curve = constant_velocity_curves(recording_of(STEADY, robot=robot), STEADY, robot)[1]
    assert (curve.odd > 15.0).all()
    assert np.abs(curve.odd - (stribeck(curve.speed) - 1.5)).max() < 0.15


def test_a_motor_at_rest_while_its_joint_moves_is_refused() -> None:
    robot = coupled_arm(0.1)
    with raises_code(EstimationError, "RID-FRICTION-RUNS", "axis2", "0.1"):
        constant_velocity_curves(recording_of(STEADY, robot=robot), STEADY, robot)


SPEED = np.geomspace(0.02, 1.5, 12)
FRICTION = {
    "classical": ((8.0, 5.0), lambda v: 8.0 * np.sign(v) + 5.0 * v),
    "asymmetric": ((9.0, 7.0, 5.0), lambda v: np.where(v > 0, 9.0, -7.0) + 5.0 * v),
    "cubic": ((8.0, 5.0, -0.9), lambda v: 8.0 * np.sign(v) + 5.0 * v - 0.9 * v**3),
    "cube root": ((2.0, 12.0), lambda v: 2.0 * v + 12.0 * np.cbrt(v)),
    "Stribeck": (
        (8.0, 5.0, 3.0, 0.06),
        lambda v: np.sign(v) * (8.0 + 3.0 * np.exp(-np.abs(v) / 0.06)) + 5.0 * v,
    ),
}


def curve_of(
    friction: Callable[[np.ndarray], np.ndarray], sigma: float, seed: int = 0
) -> FrictionCurve:
    forward, backward = friction(SPEED), friction(-SPEED)
    noise = sigma * np.random.default_rng(seed).standard_normal((2, len(SPEED)))
    return FrictionCurve(
        "axis3",
        SPEED,
        0.5 * (forward - backward) + noise[0],
        np.full(len(SPEED), sigma),
        0.5 * (forward + backward) + noise[1],
        sigma**2 * np.eye(len(SPEED)),
    )


@pytest.mark.parametrize("name", MODELS)
def test_the_true_friction_model_has_the_best_criterion_and_is_recovered(name: str) -> None:
    truth, friction = FRICTION[name]
    wins, v = 0, np.array([-0.7, -0.1, 0.1, 0.7])
    for seed in range(10):
        fits = fit_friction(curve_of(friction, 0.05, seed), IR361)
        wins += fits[0].name == name
        own = next(fit for fit in fits if fit.name == name)
        assert (np.abs(own.values - truth) < 4.5 * own.sigmas).all()
        assert 0.2 < own.misfit < 3.0
        np.testing.assert_allclose(own.torque(v), friction(v), atol=0.2)
    assert wins >= 7  # because of noise a richer model is sometimes better


def test_a_stribeck_speed_at_its_bound_is_not_recommended() -> None:
    # Friction falls up to 1.2 rad/s: beyond the speeds that the Stribeck term covers.
    slow = curve_of(lambda v: np.sign(v) * (8.0 + 6.0 * np.exp(-np.abs(v) / 1.2)) + v, 0.01)
    fits = fit_friction(slow, IR361)
    assert [fit.name for fit in fits if fit.at_bound] == ["Stribeck"] == [fits[-1].name]
    assert fits[-1].criterion < fits[0].criterion
    sentence = FrictionSection.of([slow], [fits], IR361).joints[0].sentence
    assert "Stribeck" not in sentence
    assert "stribeck" not in sentence


def test_asymmetry_is_not_fitted_without_both_directions() -> None:
    curve = curve_of(FRICTION["classical"][1], 0.05)
    curve = replace(curve, even=None, even_covariance=None)
    names = [fit.name for fit in fit_friction(curve, IR361)]
    assert "asymmetric" not in names
    assert names[0] == "classical"


def test_two_speeds_are_too_few_for_any_model() -> None:
    curve = curve_of(FRICTION["classical"][1], 0.05)
    few = FrictionCurve("axis3", curve.speed[:2], curve.odd[:2], curve.odd_sigma[:2])
    assert fit_friction(few, IR361) == ()


def test_curves_of_several_runs_are_combined() -> None:
    curve = curve_of(FRICTION["Stribeck"][1], 0.05)
    assert curve.even is not None
    assert curve.even_covariance is not None
    parts = [
        FrictionCurve(
            curve.joint,
            curve.speed[rows],
            curve.odd[rows],
            curve.odd_sigma[rows],
            curve.even[rows],
            curve.even_covariance[rows, rows],
        )
        for rows in (slice(6, None), slice(0, 6))
    ]
    whole = join_curves(parts)
    for name in ("speed", "odd", "odd_sigma", "even", "even_covariance"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(curve, name))
    assert join_curves([parts[0], replace(parts[1], even=None, even_covariance=None)]).even is None


def test_friction_columns_are_those_of_one_joint() -> None:
    model = ModelOptions(friction_terms=("coulomb", "viscous", "cubic")).build(IR361)
    v = np.array([-0.5, 0.25])
    columns = friction_columns(model, 1, v)
    np.testing.assert_allclose(columns[:, 3:6], np.column_stack([np.sign(v), v, v**3]))
    assert not columns[:, :3].any()
    with raises_code(EstimationError, "RID-MODEL-NO-FRICTION"):
        friction_columns(ModelOptions(friction=False).build(IR361), 1, v)
