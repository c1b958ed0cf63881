"""Coupled wrist: velocity loops and torques belong to the motors, the feedforward belongs to the
joints.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.kinds.multipoint import MultipointMotion
from acquisition.motion.samples import MotionSamples
from acquisition.supervision.stop_reason import StopCode
from benchmarks.closed_loop import closed_loop, plant_at, true_loops
from compensation.compensated_motion import with_feedforward
from compensation.feedforward.inverse import feedforward
from compensation.feedforward.periodic_rows import with_period
from compensation.feedforward.refinement import refinement
from compensation.feedforward.repeated_error import repeated_error
from compensation.feedforward.tuning import tune
from compensation.loops.velocity_loop import VelocityLoop
from compensation.online.online import REST_RAD_S, OnlineFeedforward
from config.load import LoadedCell, load_cell
from config.robot.wrist_coupling import WristCoupling, convert_to_joints, convert_to_motors
from dynamics.model.one_sample import SampleTorque
from dynamics.model.robot_model import RobotModel, torque
from dynamics.model.true_parameters import true_parameters
from tests.builders.known_model import known_estimate
from tests.builders.point_streams import drive, source_of

SETTLE_ROWS = 100


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    """The six-axis cell with thirty times its wrist coupling, so that the effect of the coupling is
    large.
    """
    bundled = load_cell("kr15")
    assert bundled.robot.coupling is not None
    weak = np.array(bundled.robot.coupling)
    strong = np.eye(6) + 30.0 * (weak - np.eye(6))
    robot = bundled.robot.model_copy(update={"coupling": tuple(map(tuple, strong.tolist()))})
    return replace(bundled, robot=robot)


@pytest.fixture(scope="module")
def loops(cell: LoadedCell) -> list[VelocityLoop]:
    return true_loops(cell)


def error_of(cell: LoadedCell, samples: MotionSamples) -> NDArray[np.float64]:
    """Return the joints' RMS errors (rad) of a motion through position loop and plant."""
    assert cell.plant is not None
    coupling = WristCoupling.of_robot(cell.robot)
    assert coupling is not None
    plant = plant_at(cell, cell.plant.without_unmodelled(), samples.position[0])
    n = len(cell.robot.joints)
    powered, free = np.ones(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    ahead = samples.velocity if samples.feedforward is None else samples.feedforward
    missed = np.zeros((len(samples), n))
    before = now = sent = np.zeros(n)
    for row in range(-SETTLE_ROWS, len(samples)):
        missed[max(row, 0)] = samples.position[max(row, 0)] - plant.position
        speed = cell.config.position_gain_per_s * missed[max(row, 0)]
        if row >= 0:
            speed = speed + ahead[row]
        before, now, sent = now, sent, coupling.to_motors(speed)
        plant.advance(samples.sample_period_s, before, now, powered, free)
    return np.sqrt(np.mean(missed**2, axis=0))


def test_every_joint_of_a_coupled_wrist_has_a_smaller_error(
    cell: LoadedCell, loops: list[VelocityLoop]
) -> None:
    assert cell.plant is not None
    motion = MultipointMotion(kind="multipoint", robot="kr15", points=2, seed=3)
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    model = RobotModel.from_description(cell.robot)
    values = true_parameters(model, cell.robot, cell.plant)
    torque_nm = torque(model, samples.position, samples.velocity, samples.acceleration, values)
    before = error_of(cell, samples)
    after = error_of(cell, with_feedforward(samples, cell.robot, loops, torque_nm))
    assert (after < before / 5.0).all()


@pytest.fixture(scope="module")
def excited(cell: LoadedCell) -> MotionSamples:
    """A periodic motion of all joints with four harmonics; the wrist moves faster."""
    random = np.random.default_rng(5)
    sizes = np.outer([1.0, 1.0, 1.0, 4.0, 4.0, 8.0], [0.12, 0.06, 0.04, 0.03])
    joints = tuple(
        FourierJoint(
            joint=joint.name,
            offset=0.5 * (joint.limits.position_min + joint.limits.position_max),
            sine=tuple((size * random.uniform(0.6, 1.0, 4)).tolist()),
            cosine=tuple((size * random.uniform(-1.0, 1.0, 4)).tolist()),
        )
        for joint, size in zip(cell.robot.joints, sizes, strict=True)
    )
    motion = FourierMotion(kind="fourier", robot="kr15", period_s=4.8, periods=3, joints=joints)
    return motion.plan(cell.robot, cell.config.cycle_time_s).whole()


def test_a_reference_run_tunes_each_motor(
    cell: LoadedCell, loops: list[VelocityLoop], excited: MotionSamples
) -> None:
    """Each loop has a different wrong gain; code that confuses joints with motors mixes them."""
    assert cell.plant is not None
    factors = np.array([1.1, 0.9, 1.05, 1.2, 0.85, 1.15])
    wrong = [
        replace(loop, gain=factor * loop.gain)
        for loop, factor in zip(loops, factors.tolist(), strict=True)
    ]
    model = known_estimate(cell, {})
    driven = closed_loop(cell, cell.plant.without_unmodelled(), excited)
    measured = repeated_error(cell.robot, excited, [driven])
    found = tune(excited, measured, model, wrong, cell.config.position_gain_per_s)
    assert found.used == (True,) * 6
    np.testing.assert_allclose(found.scale, factors, rtol=0.1)  # axis 4 sticks at reversals
    np.testing.assert_allclose(found.delay_s, 0.0, atol=5e-4)


def test_refinement_reduces_the_error_of_every_motor(
    cell: LoadedCell, loops: list[VelocityLoop], excited: MotionSamples
) -> None:
    assert cell.plant is not None
    model, truth = known_estimate(cell, {}), cell.plant.without_unmodelled()
    wrong = [replace(loop, gain=1.1 * loop.gain) for loop in loops]
    samples, sizes = excited, []
    for seed in range(3):
        measured = repeated_error(cell.robot, samples, [closed_loop(cell, truth, samples, seed)])
        found = refinement(samples, measured, model, wrong, cell.config.position_gain_per_s)
        sizes.append(measured.rms)
        ahead = samples.velocity if samples.feedforward is None else samples.feedforward
        more = with_period(samples, np.zeros_like(ahead), found.correction)
        samples = replace(samples, feedforward=ahead + more)
    assert (sizes[1] < sizes[0] / 12.0).all()
    assert (sizes[2] <= sizes[1]).all()


def test_the_on_line_feedforward_equals_that_of_the_whole_motion(
    cell: LoadedCell, loops: list[VelocityLoop]
) -> None:
    assert cell.plant is not None
    step_s = cell.config.cycle_time_s
    motion = MultipointMotion(kind="multipoint", robot="kr15", points=2, seed=3)
    samples = motion.plan(cell.robot, step_s)
    model = RobotModel.from_description(cell.robot)
    values = true_parameters(model, cell.robot, cell.plant)
    one = SampleTorque.of(model, values, least_smoothing_rad_s=REST_RAD_S)
    forward = OnlineFeedforward.of(cell.config, cell.robot, one, loops)
    points = drive(source_of(forward, samples.position))
    sent = np.array([point.feedforward for point in points])[1 : len(samples) + 1]
    torque_nm = torque(model, samples.position, samples.velocity, samples.acceleration, values)
    of_motors = convert_to_motors(cell.robot, samples.velocity)
    expected = convert_to_joints(cell.robot, feedforward(loops, of_motors, torque_nm, step_s))
    difference = np.abs(sent - expected)[20:-5]
    assert np.median(difference) < 1e-5
    # When a motor starts to move or reverses, its friction changes within some cycles.
    assert np.mean(difference < 2e-3) > 0.95
    uncoupled = feedforward(loops, samples.velocity, torque_nm, step_s)
    assert np.abs(sent - uncoupled)[20:-5].max() > 0.02, "the coupling must matter"


def test_a_path_too_fast_for_a_motor_is_refused_on_line(
    cell: LoadedCell, loops: list[VelocityLoop]
) -> None:
    """The joints are within their limits, but the motor of axis 6, which also turns with axis 5, is
    too fast.
    """
    assert cell.plant is not None
    step_s = cell.config.cycle_time_s
    model = RobotModel.from_description(cell.robot)
    one = SampleTorque.of(model, true_parameters(model, cell.robot, cell.plant))
    forward = OnlineFeedforward.of(cell.config, cell.robot, one, loops)
    limits = [joint.limits for joint in cell.robot.joints]
    middle = np.array([0.5 * (each.position_min + each.position_max) for each in limits])
    time_s = step_s * np.arange(600)
    rise = np.clip(time_s / 1.5, 0.0, 1.0)
    share = rise**3 * (10.0 - 15.0 * rise + 6.0 * rise**2)
    own = convert_to_motors(cell.robot, np.eye(6))  # row j: motors' speeds if joint j turns alone
    fast = int(np.argmax(np.abs(own[:, 5])[:5]))
    way = np.zeros(6)
    way[5], way[fast] = 1.0, np.sign(own[fast, 5])
    speed = 0.97 * np.array([each.velocity for each in limits]) / 1.875 * 1.5
    source = source_of(forward, middle + np.outer(share - 0.5, way * speed))
    drive(source)
    assert source.stop is not None
    assert source.stop.code is StopCode.POINTS_REFUSED
    assert source.stop.joint == "axis6"
    assert source.stop.limit == pytest.approx(1.01 * limits[5].velocity)
    assert "motor" in source.stop.text
