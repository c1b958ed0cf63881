"""Coupled wrist on the bus: drives use motor positions, the program joint positions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from config.load import load_robot
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from drivers.canopen.frames import Frame, rpdo_cob_id
from drivers.servo.axes import CanServoAxes
from drivers.servo.cia402 import AxisUnits

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

COUPLING = ((1.0, 0.0, 0.0), (0.5, 1.0, 0.0), (-0.25, 0.2, 1.0))


@pytest.fixture
def robot(robot: RobotDescription) -> RobotDescription:
    """Bench robot with a coupled wrist: every motor also moves the joints after its own."""
    return robot.model_copy(update={"coupling": COUPLING})


def units_of(bench: Bench) -> list[AxisUnits]:
    units = [setup.units for setup in bench.axes._setups]
    known = [unit for unit in units if unit is not None]
    assert len(known) == len(units)
    return known


def last_commands(bench: Bench) -> list[float]:
    """Return the last velocity commands of the drives, in rad/s of their own joints."""
    last: dict[int, Frame] = {frame.cob_id: frame for _, frame in bench.bus.sent}
    units = units_of(bench)
    return [
        units[axis].velocity(
            int.from_bytes(last[rpdo_cob_id(axis + 1)].data[2:6], "little", signed=True)
        )
        for axis in range(3)
    ]


def test_a_robot_without_coupling_has_no_coupling_matrix() -> None:
    assert WristCoupling.of_robot(load_robot("ir361")) is None


def test_the_bundled_wrist_couples_the_last_three_axes() -> None:
    coupling = WristCoupling.of_robot(load_robot("kr15"))
    assert coupling is not None
    assert coupling.motors_of == ((0,), (1,), (2,), (3,), (3, 4), (3, 4, 5))
    joints = np.zeros(6)
    coupling.to_joints(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]), joints)
    np.testing.assert_allclose(joints, [0.0, 0.0, 0.0, 1.0, 0.0125, -0.01])
    np.testing.assert_allclose(coupling.to_motors(joints), [0, 0, 0, 1, 0, 0], atol=1e-15)


def test_counts_of_motors_are_converted_to_joint_positions_once(bench: Bench) -> None:
    bench.enabled()
    units = units_of(bench)
    turned = np.array([0.3, -0.2, 0.1])
    for drive, unit, angle in zip(bench.drives, units, turned, strict=True):
        drive.objects[0x6064, 0] = unit.counts(angle).to_bytes(4, "little", signed=True)
    bench.cycle(np.zeros(3))
    bench.cycle(np.zeros(3))
    np.testing.assert_allclose(bench.axes.answers.position, np.array(COUPLING) @ turned, atol=1e-4)
    assert bench.axes.answers.position_counts.tolist() == [
        unit.counts(angle) for unit, angle in zip(units, turned, strict=True)
    ]


def test_joint_velocities_are_converted_to_motor_velocities(bench: Bench) -> None:
    assert isinstance(bench.axes, CanServoAxes)
    bench.enabled()
    bench.cycle(np.array([0.1, 0.0, 0.0]))
    np.testing.assert_allclose(
        last_commands(bench), np.linalg.solve(np.array(COUPLING), [0.1, 0.0, 0.0]), atol=1e-3
    )
