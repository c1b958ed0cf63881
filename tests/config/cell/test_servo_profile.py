"""Drive family in a cell file, and combinations of the keys of profile, cell and axis."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.cell.servo_profile import ServoProfile, TorqueObject
from config.errors import ConfigError
from config.load import load_cell, read_named
from tests.builders.raised_codes import raises_code

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
    ],
)
def test_a_contradictory_profile_is_refused(
    tmp_path: Path, servo: str, code: str, details: tuple[str, ...]
) -> None:
    with raises_code(ConfigError, code, *details):
        load_cell(cell_file(tmp_path, servo))
