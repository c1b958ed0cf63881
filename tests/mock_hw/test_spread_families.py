"""Drives with signals in several frames: fixed PDOs, and a torque read by SDO."""

from __future__ import annotations

from datetime import datetime
from fractions import Fraction

import pytest

from config.cell.servo_profile import ServoProfile
from config.errors import PreflightError
from config.formats.eds import parse_eds
from drivers.data_sheets.eds_check import eds_findings
from drivers.servo.bring_up import bus_load
from mock_hw.drive.eds import drive_eds
from mock_hw.drive.objects import SimulatedIdentity
from tests.builders.raised_codes import raises_code
from tests.mock_hw.test_families import INCREMENTS, bundled, cell_of, opened


@pytest.mark.parametrize(
    ("key", "held", "details"),
    [
        ((0x1601, 1), 0x2305_0108, ("1601h:01", "23050108h", "required: 23010108h")),
        ((0x1A02, 0), 1, ("1A02h:00", "1h", "required: 2h")),
        ((0x1402, 1), 0x77F, ("1402h:01", "77Fh", "required: 401h")),
    ],
)
def test_a_drive_with_other_fixed_pdos_is_never_commanded(
    key: tuple[int, int], held: int, details: tuple[str, ...]
) -> None:
    with opened(cell_of(bundled("faulhaber_mc3000"), ServoProfile())) as (open_cell, bus):
        bus.drives[0].objects._stored[key] = held
        with raises_code(PreflightError, "RID-PREFLIGHT-RED", "(node 1)", *details):
            open_cell.axes.bring_up()


@pytest.mark.parametrize("name", ["faulhaber_mc3000", "trinamic_tmcm16xx"])
def test_torque_and_position_in_several_frames_are_those_of_the_axis(name: str) -> None:
    cell = cell_of(bundled(name), ServoProfile())
    with opened(cell) as (open_cell, bus):
        open_cell.axes.bring_up()
        bus.axes[0].torque, bus.axes[0].counts = -500, 12345.0
        open_cell.axes.start()
        open_cell.axes.exchange()
        answers = open_cell.axes.answers
        assert answers.received.all()
        # 0.5 of the rated torque is 0.5 N m of the motor: 1.667 A, or 1667 mA in the drive's unit
        rated = 1e-3 * bus.drives[0].objects[0x6076, 0]
        assert answers.torque_nm[0] == pytest.approx(-0.5 * rated * 100.0, rel=1e-3)
        assert answers.torque_raw[0] == round(-0.5 * rated / 0.3 * 1000.0)
        assert answers.position_counts[0] == 12345
        shown = [s.found for s in open_cell.axes.settings() if s.name == "torque"]
        assert len(shown) == (name == "trinamic_tmcm16xx"), (
            "only drives whose torque is requested have a line with its rate"
        )


def test_a_data_sheet_with_other_fixed_pdos_is_refused() -> None:
    cell = cell_of(bundled("faulhaber_mc3000"), ServoProfile())
    identity = SimulatedIdentity(1, INCREMENTS, Fraction(100), 1000, cell.servo_of(cell.axes[0]))
    text = drive_eds(identity, "d.eds", datetime(2026, 1, 2))
    held = f"DefaultValue={0x2304_0220}"
    assert text.count(held) == 1
    sheet = parse_eds(text.replace(held, f"DefaultValue={0x2304_0320}").encode(), "d.eds")
    red = [f for f in eds_findings(sheet, cell, cell.axes[0]) if f.verdict == "red"]
    assert [(f.object_name, f.required, f.found) for f in red] == [
        ("1A02h:02", "23040220h", "23040320h")
    ]


def test_a_trace_with_other_settings_gives_no_position() -> None:
    with opened(cell_of(bundled("faulhaber_mc3000"), ServoProfile())) as (open_cell, bus):
        drive = bus.drives[0]
        open_cell.axes.bring_up()
        held = [drive.objects[0x2303, number] for number in range(1, 5)]
        assert held == [200, 4, 0, 1]
        drive.objects[0x2303, 1] = 0
        bus.axes[0].counts = 777.0
        open_cell.axes.start()
        open_cell.axes.exchange()
        assert open_cell.axes.answers.position_counts[0] != 777, (
            "the trace contains other signals, so it must not give a position"
        )


def test_a_drive_that_does_not_answer_its_request_counts_as_missing() -> None:
    cell = cell_of(bundled("trinamic_tmcm16xx"), ServoProfile())
    with opened(cell) as (open_cell, bus):
        axes = open_cell.axes
        axes.bring_up()
        axes.start()
        axes.exchange()
        assert axes.answers.received.tolist() == [True, True]
        torque = bus.drives[0].objects._entries.pop((0x6077, 0))
        open_cell.clock.sleep_until(open_cell.clock.now_s() + cell.cycle_time_s)
        axes.exchange()
        assert axes.answers.received.tolist() == [False, True]
        bus.drives[0].objects._entries[0x6077, 0] = torque


def test_additional_frames_are_part_of_the_bus_load() -> None:
    plain = bus_load(cell_of(ServoProfile(), ServoProfile()))
    for name in ("faulhaber_mc3000", "trinamic_tmcm16xx"):
        assert bus_load(cell_of(bundled(name), ServoProfile())) > plain + 0.04
