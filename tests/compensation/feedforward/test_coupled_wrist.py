"""Coupled wrist: loops and torques belong to the motors, the feedforward to the joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.motion.kinds.multipoint import MultipointMotion
from acquisition.motion.samples import MotionSamples
from benchmarks.closed_loop import plant_at, true_loops
from compensation.compensated_motion import with_feedforward
from compensation.loops.velocity_loop import VelocityLoop
from compensation.online.online import OnlineFeedforward
from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from config.robot.wrist_coupling import WristCoupling
from dynamics.model.one_sample import SampleTorque
from dynamics.model.robot_model import RobotModel, torque
from dynamics.model.true_parameters import true_parameters
from tests.builders.raised_codes import raises_code

SETTLE_ROWS = 100


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    """The six-axis cell with thirty times its wrist coupling, so that its effect is large."""
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
    """Return the joints' RMS errors of a motion through position loop and plant."""
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


def test_on_line_compensation_is_refused_with_the_remedy(
    cell: LoadedCell, loops: list[VelocityLoop]
) -> None:
    assert cell.plant is not None
    model = RobotModel.from_description(cell.robot)
    one = SampleTorque.of(model, true_parameters(model, cell.robot, cell.plant))
    with raises_code(ConfigError, "RID-ROBOT-COUPLED-WRIST"):
        OnlineFeedforward.of(cell.config, cell.robot, one, loops)
