"""Position reference of a drive: read from its status bits by SDO, stated in the cell file, or
unknown.
"""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from config.cell.cell import CanBusConfig, CellConfig, DriveAxis
from config.cell.drive_safety import DriveSafety
from config.cell.servo_profile import ReferencedBits, ServoProfile
from config.errors import PreflightError
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from drivers.cell import Cell
from drivers.interfaces.servo_axes import DriveSetting
from drivers.ports.can_link import CanLink
from drivers.servo.position_counter import NOT_REFERENCED, REFERENCED
from tests.builders.obedient_cell import ObedientCell

STATUS_BIT = ReferencedBits(object="6041h:00", mask=1 << 15)
STATE_NUMBER = ReferencedBits(object="2040h:03", bits=8, mask=0xFF, value=19)


def robot() -> RobotDescription:
    limits = JointLimits(
        position_min=-3.0, position_max=3.0, velocity=2.0, acceleration=10.0, torque=300.0
    )
    return RobotDescription(
        name="two",
        kinematics=Kinematics(convention="modified_dh", rows=(KinematicRow(a_m=0.1),) * 2),
        joints=tuple(
            Joint(name=name, limits=limits, gear_ratio=100.0) for name in ("base", "elbow")
        ),
    )


def cell_with(bits: ReferencedBits | None, zero_counts: int | None = None) -> CellConfig:
    """Return a cell whose first drive has these referenced bits, and optionally a stated zero."""
    stated = {} if zero_counts is None else {"position_zero_counts": zero_counts}
    first = {"joint": "base", "node_id": 1, "servo": ServoProfile(referenced=bits)}
    return CellConfig(
        name="two",
        robot="two",
        cycle_time_ms=4,
        can=CanBusConfig(interface="virtual", channel="two"),
        axes=(
            DriveAxis.model_validate(first | stated),
            DriveAxis(joint="elbow", node_id=2),
        ),
        position_gain_per_s=10.0,
        drive_safety=DriveSafety(quick_stop_deceleration_rad_s2=20.0, following_error_rad=0.3),
    )


def bring_up(
    cell: CellConfig, *, homed: bool = True
) -> tuple[list[DriveSetting], PreflightError | None]:
    """Bring up the drives; return the reference findings and the refusal."""
    bus = ObedientCell(cell, robot(), 4096, referenced=homed)
    with Cell(cell, robot(), CanLink(bus)) as opened:
        refused = None
        try:
            opened.axes.bring_up()
        except PreflightError as error:
            refused = error
        settings = opened.axes.settings()
    return [setting for setting in settings if setting.name == REFERENCED], refused


@pytest.mark.parametrize("bits", [STATUS_BIT, STATE_NUMBER])
def test_a_referenced_drive_is_accepted(bits: ReferencedBits) -> None:
    (first, _), refused = bring_up(cell_with(bits, zero_counts=500))
    assert refused is None
    assert (first.object_name, first.verdict) == (bits.object, "ok")
    assert first.found.startswith("referenced, by the drive")


@pytest.mark.parametrize("bits", [STATUS_BIT, STATE_NUMBER])
def test_an_unreferenced_drive_is_refused_even_with_a_stated_zero(
    bits: ReferencedBits,
) -> None:
    (first, second), refused = bring_up(cell_with(bits, zero_counts=500), homed=False)
    assert refused is not None
    assert refused.refusal == first.code == NOT_REFERENCED == "RID-DRIVE-NOT-REFERENCED"
    assert first.verdict == "red"
    assert "home the drive" in first.next_action
    assert (second.verdict, second.code) == ("shown", "")  # the drive has no such bit


def test_without_such_bits_the_cell_file_can_state_the_zero() -> None:
    (first, second), refused = bring_up(cell_with(None, zero_counts=0), homed=False)
    assert refused is None
    assert "position_zero_counts 0" in first.found
    assert second.found.startswith("not known")
    assert {first.verdict, second.verdict} == {"shown"}


def test_an_object_that_the_drive_lacks_is_refused() -> None:
    cell = cell_with(STATE_NUMBER)
    profile = ServoProfile(referenced=STATE_NUMBER, lacks=("2040h",))
    axis = cell.axes[0].model_copy(update={"servo": profile})
    (first, _), refused = bring_up(cell.model_copy(update={"axes": (axis, cell.axes[1])}))
    assert refused is not None
    assert first.found == "not in this drive"
    assert "referenced" in first.next_action


def test_an_axis_can_disable_the_bits_of_its_profile() -> None:
    drive_profile = ServoProfile.model_validate({"referenced": None})
    assert drive_profile.on(ServoProfile(referenced=STATUS_BIT)).referenced is None
    assert ServoProfile().on(ServoProfile(referenced=STATUS_BIT)).referenced == STATUS_BIT


@pytest.mark.parametrize(
    "wrong",
    [
        {"object": "6041h:00", "mask": 1 << 12},  # homing attained, in homing mode only
        {"object": "6041h:00", "mask": 1 << 15 | 1 << 3},
        {"object": "2040h:00", "bits": 8, "mask": 1 << 8},
        {"object": "2040h:00", "mask": 3, "value": 4},
        {"object": "2040h:00", "mask": 0},
    ],
)
def test_unsuitable_bits_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        ReferencedBits.model_validate(wrong)
