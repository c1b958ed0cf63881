"""Ratings of simulated drives, compared by SDO with those of cell file and robot file."""

from __future__ import annotations

import pytest

from config.cell.servo_profile import ServoProfile
from config.errors import PreflightError
from config.robot.robot import RobotDescription
from drivers.cell import Cell
from drivers.interfaces.servo_axes import DriveSetting
from drivers.ports.can_link import CanLink
from drivers.servo.motor_ratings import NOT_AVAILABLE
from tests.builders.obedient_cell import ObedientCell
from tests.builders.raised_codes import raises_code
from tests.mock_hw.test_families import INCREMENTS, bundled, cell_of, robot

HELD_NM, HELD_A = 1.0, 10.0  # a third of 300 N m, by a gear of 100; 0.1 N m/A


def settings_of(
    held: ServoProfile, stated: ServoProfile, described: RobotDescription | None = None
) -> list[DriveSetting]:
    """Bring up drives of one profile with a cell file that states another.

    Returns:
        The settings of drive 1.

    Raises:
        PreflightError: A setting is red.
    """
    described = described or robot()
    bus = ObedientCell(cell_of(held, held), described, INCREMENTS)
    with Cell(cell_of(stated, stated), described, CanLink(bus)) as opened:
        opened.axes.bring_up()
        return [line for line in opened.axes.settings() if line.node_id == 1]


def with_constant(nm_per_a: float) -> RobotDescription:
    joints = [
        joint.model_copy(update={"torque_constant_nm_per_a": nm_per_a}) for joint in robot().joints
    ]
    return robot().model_copy(update={"joints": tuple(joints)})


@pytest.mark.parametrize(
    "stated",
    [
        ServoProfile(rated_torque_nm=1.2),
        ServoProfile(rated_current_a=12.0),
        ServoProfile(torque_constant_nm_per_a=0.2),
    ],
)
def test_a_cell_file_that_contradicts_the_drive_is_refused(stated: ServoProfile) -> None:
    with raises_code(PreflightError, "RID-DRIVE-RATING"):
        settings_of(ServoProfile(), stated)


def test_a_robot_file_that_contradicts_the_drive_is_refused_with_both_numbers() -> None:
    with raises_code(PreflightError, "RID-DRIVE-RATING", "10", "20"):
        settings_of(ServoProfile(), ServoProfile(), with_constant(20.0))


def test_drives_that_lack_the_ratings_do_not_agree() -> None:
    lacking = ServoProfile(lacks=("6073h", "6075h", "6076h", "60E0h", "60E1h"))
    stated = lacking.model_copy(
        update={"rated_torque_nm": 1.3, "rated_current_a": 13.0, "torque_constant_nm_per_a": 0.1}
    )
    lines = settings_of(lacking, stated, with_constant(20.0 / 3.0))
    missing = [line.name for line in lines if line.found.startswith(NOT_AVAILABLE)]
    assert missing == [
        "rated motor torque [N m]",
        "rated motor current [A]",
        "torque constant [N m/A]",
    ]
    (of_robot,) = (line for line in lines if line.name.startswith("torque constant, gear"))
    assert (of_robot.verdict, of_robot.headline != "") == ("shown", True)


@pytest.mark.parametrize("limit", ["6073h:00", "60E0h:00", "60E1h:00"])
def test_the_drives_further_limits_are_read(limit: str) -> None:
    lines = settings_of(ServoProfile(), ServoProfile())
    found = {line.name: line.found for line in lines if line.object_name == limit}
    assert found["torque for a stop"] == "650 N m"


def test_a_drive_whose_rated_current_is_in_6410h_is_compared() -> None:
    epos2 = bundled("epos2")
    with raises_code(PreflightError, "RID-DRIVE-RATING", "6410h:01"):
        settings_of(epos2, epos2.model_copy(update={"rated_current_a": 77.0}))
