"""The torque that is compared with limits, if friction depends on temperature."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from compensation.compensated_motion import compensated_motion, refuse_torque
from compensation.feedforward.motor_reference import motor_reference
from config.errors import LimitError
from config.load import LoadedCell, load_cell
from dynamics.terms.conditions import Conditions
from identification.elasticity.limit_torque import limit_temperature_note, limit_torque
from identification.estimation.estimate import predict
from tests.builders.elastic_model import links_model
from tests.builders.known_model import known_estimate
from tests.builders.point_streams import loops_of
from tests.builders.raised_codes import raises_code
from tests.builders.warm_model import by_temperature
from tests.builders.warming_arm import motion

WAY = motion(20.0, 4)
STEP_S = 0.01
COLD_K = 298.15


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    return load_cell("ir361")


def test_a_warming_joint_has_the_larger_torque_of_cold_and_warm(cell: LoadedCell) -> None:
    followed = by_temperature(cell, measured=False)
    assert followed.warming is not None
    settled = followed.warming.steady_temperatures(followed.robot, WAY[1])
    cold, half, warm = (
        np.abs(predict(followed, *WAY, Conditions(temperature_k=COLD_K + share)))
        for share in (0.0 * (settled - COLD_K), 0.5 * (settled - COLD_K), settled - COLD_K)
    )
    assert (cold > warm).any()
    assert (warm > cold).any()  # at which friction helps to slow down
    held = np.abs(limit_torque(followed, *WAY, STEP_S))
    np.testing.assert_array_equal(held, np.maximum(cold, warm))
    assert (half <= held + 1e-9).all()
    assert "axis1, axis2 after a long rest" in limit_temperature_note(followed)


def test_with_measured_temperatures_the_torque_is_that_at_the_reference_with_a_note(
    cell: LoadedCell,
) -> None:
    measured = by_temperature(cell, measured=True)
    there = Conditions(temperature_k=np.full(3, COLD_K))
    np.testing.assert_array_equal(
        limit_torque(measured, *WAY, STEP_S), predict(measured, *WAY, there)
    )
    assert "(axis1 25 °C, axis2 25 °C)" in limit_temperature_note(measured)


def test_other_models_have_their_own_torque(cell: LoadedCell) -> None:
    plain = known_estimate(cell, {})
    np.testing.assert_array_equal(limit_torque(plain, *WAY, STEP_S), predict(plain, *WAY))
    assert limit_temperature_note(plain) == ""


def test_a_model_of_the_links_has_the_torques_of_the_motors(cell: LoadedCell) -> None:
    links, loops = links_model(cell), loops_of(cell)
    joints = tuple(
        FourierJoint(joint=name, offset=0.1, sine=(0.2, 0.05), cosine=(0.0, 0.05))
        for name in cell.robot.joint_names
    )
    motion = FourierMotion(kind="fourier", robot="ir361", period_s=2.0, periods=1, joints=joints)
    planned = motion.plan(cell.robot, cell.config.cycle_time_s)
    reference = motor_reference(planned, links, links.robot)
    motors = reference.samples
    moved = (motors.position, motors.velocity, motors.acceleration)
    rigid = predict(links, *moved)
    found = limit_torque(links, *moved, motors.sample_period_s)
    error, rigid_error = (np.std(each - reference.torque_nm, axis=0) for each in (found, rigid))
    assert (rigid_error > 0.05).all()
    assert (error < 0.15 * rigid_error).all(), error / rigid_error
    # The feedforward of an uncorrected motion is that of these torques, too.
    ahead = compensated_motion(motors, links, loops).feedforward
    wanted = compensated_motion(planned, links, loops, reference=reference).feedforward
    as_rigid = compensated_motion(motors, known_estimate(cell, {}), loops).feedforward
    assert ahead is not None
    assert wanted is not None
    assert as_rigid is not None
    assert np.std(ahead - wanted) < 0.1 * np.std(as_rigid - wanted)
    # The limit lies between the torques of the motors and those of rigid gears.
    largest, of_rigid = (float(np.abs(each[:, 1]).max()) for each in (found, rigid))
    limit = cell.robot.joints[1].limits.model_copy(update={"torque": 0.5 * (largest + of_rigid)})
    axis2 = cell.robot.joints[1].model_copy(update={"limits": limit})
    other = (cell.robot.joints[0], axis2, cell.robot.joints[2])
    robot = cell.robot.model_copy(update={"joints": other})
    refuse_torque(motion, motors, links if largest < of_rigid else known_estimate(cell, {}), robot)
    with raises_code(LimitError, "RID-MOTION-LIMIT", "'axis2'"):
        refuse_torque(
            motion, motors, known_estimate(cell, {}) if largest < of_rigid else links, robot
        )
