"""The message on a stop of the axis test names the keys of units that may be wrong."""

from __future__ import annotations

import pytest

from acquisition.supervision.stop_reason import StopCode, StopReason
from config.cell.cell import CellConfig
from config.cell.servo_profile import ServoProfile
from config.load import load_cell
from rid_daq.commissioning.axis_stop import OF_WRONG_UNITS, suspected_units
from rid_daq.operations.cell.axes import AxesRequest, AxesResult
from rid_daq.operations.cell.axis_tester import AxisTestOutcome

CELL = load_cell("ir361").config


def stopped(code: StopCode) -> StopReason:
    """Return the stop of a joint that moves with the tested one."""
    return StopReason(code, "joint axis3: beyond a limit", joint="axis3")


def of_mode(servo: ServoProfile) -> CellConfig:
    """Return the cell with another servo profile."""
    return CELL.model_copy(update={"servo": servo})


@pytest.mark.parametrize("code", sorted(OF_WRONG_UNITS))
def test_a_joint_that_moves_too_fast_makes_the_units_of_its_drive_doubtful(code: StopCode) -> None:
    sentence = suspected_units(stopped(code), "axis1", CELL)
    assert all(word in sentence for word in ("axis1", "velocity_unit", "encoder_increments"))
    assert ("axis3: torque, rated_torque_nm" in sentence) == (code is StopCode.TORQUE_LIMIT)


def test_a_drive_that_receives_positions_has_no_velocity_unit() -> None:
    cell = of_mode(ServoProfile(mode="cyclic_position"))
    sentence = suspected_units(stopped(StopCode.TORQUE_LIMIT), "axis1", cell)
    assert "encoder_increments" in sentence
    assert "velocity_unit" not in sentence


@pytest.mark.parametrize("code", [StopCode.STOP_BUTTON, StopCode.BUS, StopCode.STUCK_ENCODER])
def test_other_stops_say_nothing_on_units(code: StopCode) -> None:
    assert suspected_units(stopped(code), "axis1", CELL) == ""
    assert suspected_units(None, "axis1", CELL) == ""


def test_the_document_of_a_stopped_test_names_the_keys() -> None:
    outcome = AxisTestOutcome("ir361", (), None, None, "check velocity_unit")
    result = AxesResult(AxesRequest(cell="ir361"), outcome)
    assert result.document()["suspected"] == "check velocity_unit"
