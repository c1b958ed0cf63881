"""A load that changes during a motion: torque and feedforward before, in and after the change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from acquisition.motion.samples import MotionSamples
from benchmarks.closed_loop import true_loops
from compensation.compensated_motion import compensated_motion
from compensation.feedforward.inverse import feedforward
from compensation.feedforward.motor_reference import motor_reference
from compensation.online.online import OnlineFeedforward
from compensation.ramped_load import RampedLoad, evaluate_over, row_times
from config.arrays import FloatArray
from config.load import load_cell
from dynamics.geometry.kinematics import flange_pose
from identification.elasticity.transmitted_torque import transmitted_torque
from identification.estimation.estimate import predict
from identification.payload.carried import carry
from mock_hw.plant.rigid_bodies import build_rigid_bodies
from tests.builders.certified import MEDIUM, estimate_of
from tests.builders.known_model import estimate_with_terms, known_estimate
from tests.builders.point_streams import CELL, T, arrays, drive, loops_of, planned, source_of

UP_S, DOWN_S, RAMP_S = 0.6, 1.6, 0.12


def load_on(cell_friction: tuple[float, float] | None = None) -> RampedLoad:
    """Return the arm, which takes up the payload at `UP_S` and puts it down at `DOWN_S`."""
    alone = known_estimate(CELL, {})
    if cell_friction is not None:
        alone = estimate_with_terms(CELL, ("coulomb", "viscous", "load"), *cell_friction)
    loaded = carry(alone, estimate_of(CELL, ("run",)))
    return RampedLoad((alone, loaded, alone), np.array([UP_S, DOWN_S]), np.full(2, RAMP_S))


def carried_share(time_s: FloatArray) -> FloatArray:
    """Return the fraction of the payload that the arm carries at the times `time_s`."""
    times = (0.0, UP_S, UP_S + RAMP_S, DOWN_S, DOWN_S + RAMP_S, 1e3)
    return np.interp(time_s, times, (0.0, 0.0, 1.0, 1.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def samples() -> MotionSamples:
    return planned()


def pinocchio_torque(samples: MotionSamples, share: FloatArray) -> FloatArray:
    """Return the torques (N m) of links, rotors and a fraction of the payload, by Pinocchio."""
    assert CELL.plant is not None
    bodies = build_rigid_bodies(CELL.robot, CELL.plant.without_unmodelled())
    model, gearing = bodies.model, bodies.gearing
    joint = model.getJointId(CELL.robot.joint_names[-1])
    alone = model.inertias[joint].copy()
    pose = flange_pose(CELL.robot)
    placement = pin.SE3(pose[:3, :3], pose[:3, 3])
    mass, *first, xx, xy, xz, yy, yz, zz = MEDIUM.parameters
    body = np.array([mass, *first, xx, xy, yy, xz, yz, zz])
    torque = np.empty(samples.position.shape)
    rows = zip(samples.position, samples.velocity, samples.acceleration, strict=True)
    for row, motion in enumerate(rows):
        model.inertias[joint] = alone
        if share[row] > 0.0:
            part = pin.Inertia.FromDynamicParameters(share[row] * body)
            model.inertias[joint] = alone + placement.act(part)
        full = [gearing @ values for values in motion]
        torque[row] = gearing.T @ pin.rnea(model, model.createData(), *full)
    return torque


def test_the_torque_is_that_of_the_load_carried_at_each_time(samples: MotionSamples) -> None:
    time_s, load = row_times(samples), load_on()
    motion = (samples.position, samples.velocity, samples.acceleration)
    found = evaluate_over(load, time_s, lambda model: predict(model, *motion))
    share = carried_share(time_s)
    expected = pinocchio_torque(samples, share)
    # friction and spring, which Pinocchio does not model, are those of the arm alone
    others = predict(load.estimates[0], *motion) - pinocchio_torque(samples, np.zeros(len(share)))
    np.testing.assert_allclose(found, expected + others, atol=1e-8)
    assert {0.0, 1.0} < set(share)
    assert np.abs(found - predict(load.estimates[0], *motion))[share > 0.9].max() > 20.0


def test_the_weights_of_the_loads_follow_their_ramps() -> None:
    weights = load_on().weights(np.array([0.0, UP_S + 0.25 * RAMP_S, 1.0, DOWN_S + RAMP_S]))
    expected = np.array([[1, 0, 0], [0.75, 0.25, 0], [0, 1, 0], [0, 0, 1]])
    np.testing.assert_allclose(weights, expected, atol=1e-12)


def test_lossy_gears_follow_the_power_that_they_transmit_in_the_ramp(
    samples: MotionSamples,
) -> None:
    """The torque of a lossy gear is not the blend of the torques with both loads."""
    load, time_s = load_on((10.0, 0.1)), row_times(samples)
    motion = (samples.position, samples.velocity, samples.acceleration)
    found = evaluate_over(load, time_s, lambda model: predict(model, *motion))
    row = round((UP_S + 0.5 * RAMP_S) / T)
    q, v, a = (values[row : row + 1] for values in motion)
    share = float(carried_share(time_s[row : row + 1])[0])
    exact = load.blended(np.array([1.0 - share, share, 0.0]))
    np.testing.assert_allclose(found[row : row + 1], predict(exact, q, v, a), rtol=1e-9)


def test_the_stream_computes_the_same_feedforward_with_one_inverse(
    samples: MotionSamples,
) -> None:
    """A load change does not reset the inverse of the velocity controller."""
    load, time_s = load_on(), row_times(samples)
    motion = (samples.position, samples.velocity, samples.acceleration)
    streamed, offline = [], []
    for model in (load, load.estimates[0]):
        forward = OnlineFeedforward.from_model(CELL.config, CELL.robot, model, loops_of(CELL))
        _, _, ahead = arrays(drive(source_of(forward, np.array(samples.position))))
        streamed.append(ahead[1 : len(samples) + 1])
        torque = evaluate_over(model, time_s, lambda one: predict(one, *motion))
        offline.append(feedforward(loops_of(CELL), samples.velocity, torque, T))
    found, expected = streamed[0] - streamed[1], offline[0] - offline[1]
    whole = slice(20, len(samples) - 10)
    assert np.abs(found - expected)[whole].max() < 0.01 * np.abs(expected).max()
    assert np.abs(expected)[time_s < UP_S - 0.1].max() < 1e-9


def test_a_motion_is_compensated_for_the_load_at_each_time(samples: MotionSamples) -> None:
    load, loops = load_on(), true_loops(CELL)
    ahead, empty, loaded = (
        compensated_motion(samples, model, loops).feedforward
        for model in (load, load.estimates[0], load.estimates[1])
    )
    assert ahead is not None
    assert empty is not None
    assert loaded is not None
    time_s, most = row_times(samples), np.abs(loaded - empty).max()
    before = (time_s > 0.1) & (time_s < UP_S - 0.2)
    assert np.abs(ahead - empty)[before].max() < 0.02 * most
    rising = (time_s > UP_S) & (time_s < UP_S + RAMP_S)
    assert np.abs(ahead - empty)[rising].max() > 0.2 * most


def test_elastic_gears_are_ahead_by_the_deflection_of_the_load(samples: MotionSamples) -> None:
    stiff = tuple(
        joint.model_copy(update={"stiffness_nm_rad": k})
        for joint, k in zip(CELL.robot.joints, (5e4, 6e4, 2e4), strict=True)
    )
    robot, load = CELL.robot.model_copy(update={"joints": stiff}), load_on()
    bent = motor_reference(samples, load, robot).deflection
    motion = (samples.position, samples.velocity, samples.acceleration)
    time_s = row_times(samples)
    torque = evaluate_over(load, time_s, lambda model: transmitted_torque(model, robot, *motion))
    away = np.minimum(np.abs(time_s - UP_S - 0.06), np.abs(time_s - DOWN_S - 0.06)) > 0.2
    expected = torque / np.array([5e4, 6e4, 2e4])
    assert np.abs(bent - expected)[away].max() < 0.05 * np.abs(expected).max()


def test_models_of_other_loads_have_the_same_base_parameters() -> None:
    kr15 = known_estimate(load_cell("kr15"), {})
    with pytest.raises(AssertionError):
        replace(load_on(), estimates=(kr15, *load_on().estimates[1:]))
