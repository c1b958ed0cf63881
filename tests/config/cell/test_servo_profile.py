"""Servo profiles of a cell file, and keys of cell and axis that replace those of the profile."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.cell.servo_profile import ServoProfile, TorqueObject
from config.errors import ConfigError
from config.load import load_cell, read_named
from tests.builders.raised_codes import line_of, raises_code

FAMILY = """\
velocity_unit: rpm
velocity_units: 1000.0
acceleration_unit: rpm
torque: {object: 6078h:00, of: rated_current}
lacks: [608Fh, 6076h:00]
"""


def cell_file(folder: Path, servo: str, axis1: str = "{joint: axis1, node_id: 1}") -> str:
    text = read_named("ir361", "cells", None)[0].decode()
    text = text.replace("  - {joint: axis1, node_id: 1}", f"  - {axis1}")
    (folder / "cell.yaml").write_text(f"{text}servo: {servo}\n")
    (folder / "family.yaml").write_text(FAMILY)
    return str(folder / "cell.yaml")


def test_without_a_profile_drives_follow_the_standard_in_full() -> None:
    cell = load_cell("ir361").config
    assert {cell.servo_of(axis) for axis in cell.axes} == {ServoProfile()}


def test_a_profile_file_for_all_drives_and_one_drive_with_additional_keys(tmp_path: Path) -> None:
    own = "{joint: axis1, node_id: 1, servo: {rated_current_a: 3.5, velocity_units: 10.0}}"
    loaded = load_cell(cell_file(tmp_path, "family.yaml", own))
    first, second, _ = map(loaded.config.servo_of, loaded.config.axes)
    assert (first.rated_current_a, first.velocity_units, first.velocity_unit) == (3.5, 10.0, "rpm")
    assert (second.rated_current_a, second.velocity_units) == (None, 1000.0)
    assert second.torque == TorqueObject(object="6078h:00", of="rated_current")
    assert loaded.files["servo1.yaml"] == FAMILY.encode()


def test_a_key_of_an_axis_overrides_the_profile(tmp_path: Path) -> None:
    own = "{joint: axis1, node_id: 1, velocity_unit: 0.1rpm}"
    cell = load_cell(cell_file(tmp_path, "family.yaml", own)).config
    assert cell.servo_of(cell.axes[0]).velocity_unit == "0.1rpm"


def test_keys_in_the_cell_file_extend_a_named_profile(tmp_path: Path) -> None:
    cell = load_cell(cell_file(tmp_path, "{base: family.yaml, encoder_increments: 8192.0}")).config
    profile = cell.servo_of(cell.axes[2])
    assert (profile.encoder_increments, profile.velocity_unit) == (8192.0, "rpm")


@pytest.mark.parametrize(
    ("servo", "code", "details"),
    [
        ("epos", "RID-FILE-UNKNOWN", ("bundled servo", "'epos'")),
        ("{torque: {object: 6077, of: ampere}}", "RID-FILE-VALUE", ("torque.object:", "6077")),
        ("{rated_torque_nm: 5000000.0}", "RID-FILE-VALUE", ("servo.rated_torque_nm:", "5e+06 N m")),
        ("{torque: {object: '6077h:00', bits: 32}}", "RID-FILE-VALUE", ("servo:", "bits", "16")),
        ("{settings: [{object: '6007h:00', bits: 16, value: 0}]}", "RID-FILE-VALUE", ("6007h:00",)),
        ("{settings: [{object: '2100h:00', bits: 8, value: 300}]}", "RID-FILE-VALUE", ("300", "8")),
        (
            "{settings: [{object: '2100h:00', bits: 8, value: 1}, {object: '2100h:00', bits: 8,"
            " value: 2}]}",
            "RID-FILE-VALUE",
            ("2100h:00",),
        ),
        (
            "{base: faulhaber_mc3000, torque: {object: '6077h:00'}}",
            "RID-CELL-VALUE",
            ("cell.yaml:", "axis1", "6077h:00"),
        ),
        (
            "{base: faulhaber_mc3000, mode: cyclic_position}",
            "RID-CELL-VALUE",
            ("cell.yaml:", "cyclic_position", "2301h:02"),
        ),
        (
            "{settings: [{object: '6072h:00', bits: 16, value: 9}]}",
            "RID-FILE-VALUE",
            ("6072h:00", "torque_limit"),
        ),
    ],
)
def test_a_contradictory_profile_is_refused(
    tmp_path: Path, servo: str, code: str, details: tuple[str, ...]
) -> None:
    with raises_code(ConfigError, code, *details):
        load_cell(cell_file(tmp_path, servo))


@pytest.mark.parametrize(
    ("servo", "axis", "details"),
    [
        ("{mode: cyclic_position}", "velocity_unit: rpm", ("velocity_unit", "cyclic_position")),
        (
            "{rated_torque_nm: 1.0, rated_current_a: 10.0}",
            "servo: {torque_constant_nm_per_a: 2.0}",
            ("axis1", "0.1 N", "2 N"),
        ),
    ],
)
def test_keys_of_an_axis_that_contradict_the_drives_of_the_cell_are_refused(
    tmp_path: Path, servo: str, axis: str, details: tuple[str, ...]
) -> None:
    file = cell_file(tmp_path, servo, f"{{joint: axis1, node_id: 1, {axis}}}")
    line = line_of(Path(file), "axes") + 1
    with raises_code(ConfigError, "RID-CELL-VALUE", f"cell.yaml:{line}:", *details):
        load_cell(file)


def test_a_drive_with_fixed_pdos_can_have_a_torque_of_32_bits(tmp_path: Path) -> None:
    servo = "{base: faulhaber_mc3000, torque: {object: '2304h:02', of: rated_current, bits: 32}}"
    cell = load_cell(cell_file(tmp_path, servo)).config
    assert cell.servo_of(cell.axes[0]).torque.bits == 32


def test_a_setting_of_the_program_can_be_compared(tmp_path: Path) -> None:
    servo = "{settings: [{object: '6085h:00', bits: 32, value: 9, written: false}]}"
    cell = load_cell(cell_file(tmp_path, servo)).config
    assert cell.servo_of(cell.axes[0]).settings[0].value == 9
