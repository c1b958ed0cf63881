"""Key `plate` of a cell file: accepted and refused content."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from config.cell.plate import CHANNEL_NAMES, PlateConfig
from config.errors import ConfigError
from config.formats.yaml_tree import parse_yaml
from config.load import load_cell, to_yaml, validate
from tests.builders.raised_codes import line_of, raises_code

PLATE = """\
plate:
  a_m: 0.12
  b_m: 0.2
  az0_m: -0.054
  position_m: [0.0, 0.0, 0.0]
  rotation_rad: [3.141592653589793, 0.0, 0.0]
  amplifier:
    address: /dev/ttyUSB0
    baud_rate: 460800
    rate_hz: 1000.0
    low_pass_hz: 300.0
    range_n: [2500.0, 2500.0, 2500.0, 2500.0, 5000.0, 5000.0, 5000.0, 5000.0]
    sensitivity_pc_n: [-7.5, -7.5, -7.5, -7.5, -3.8, -3.8, -3.8, -3.8]
"""


def cell_with(tmp_path: Path, plate: str) -> str:
    text = load_cell("ir361").files["cell.yaml"].decode()
    path = tmp_path / "cell.yaml"
    path.write_text(text[: text.find("\nplate:") + 1 or None] + plate)
    return str(path)


def assert_refused(tmp_path: Path, old: str, new: str, key: str, *details: str) -> None:
    assert old in PLATE
    path = cell_with(tmp_path, PLATE.replace(old, new))
    line = line_of(Path(path), key.rpartition(".")[2])
    with raises_code(ConfigError, "RID-FILE-VALUE", f"{path}:{line}:", f" {key}: ", *details):
        load_cell(path)


def test_a_plate_is_read_and_written_unchanged(tmp_path: Path) -> None:
    plate = load_cell(cell_with(tmp_path, PLATE)).config.plate
    assert plate is not None
    assert plate.amplifier.profile == "kistler_style"
    assert (plate.sensitivity, plate.zero, plate.limits) == (None, None, None)
    assert validate(parse_yaml(to_yaml(plate).encode(), "plate.yaml"), PlateConfig) == plate


def test_full_scale_equals_the_range(tmp_path: Path) -> None:
    plate = load_cell(cell_with(tmp_path, PLATE)).config.plate
    assert plate is not None
    newtons = np.array(plate.amplifier.newtons_per_count) * plate.amplifier.full_scale_counts
    assert newtons.tolist() == [2500.0] * 4 + [5000.0] * 4
    assert len(CHANNEL_NAMES) == 8


def test_seven_channels_are_refused(tmp_path: Path) -> None:
    seven = ("[-7.5, -7.5, -7.5, -7.5,", "[-7.5, -7.5, -7.5,")
    assert_refused(tmp_path, *seven, "plate.amplifier.sensitivity_pc_n", "7 values", "least 8")


def test_millimetres_are_recognised(tmp_path: Path) -> None:
    assert_refused(tmp_path, "a_m: 0.12", "a_m: 120.0", "plate.a_m", "120 mm", "0.12 m")


def test_a_sensor_plane_above_the_surface_is_refused(tmp_path: Path) -> None:
    assert_refused(tmp_path, "-0.054", "0.054", "plate.az0_m", "write -0.054")
    assert_refused(tmp_path, "-0.054", "-54.0", "plate.az0_m", "54 mm", "0.054 m")


def test_a_low_pass_too_weak_against_aliasing_is_refused(tmp_path: Path) -> None:
    low_pass = ("low_pass_hz: 300.0", "low_pass_hz: 600.0")
    assert_refused(tmp_path, *low_pass, "plate.amplifier", "low_pass_hz", "600", "500 Hz")


def test_a_dead_sensor_is_named(tmp_path: Path) -> None:
    dead = ("[-7.5, -7.5, -7.5,", "[-7.5, -7.5, 0.0,")
    assert_refused(tmp_path, *dead, "plate.amplifier", "sensitivity_pc_n", "fy14")


def test_crosstalk_that_cannot_be_inverted_is_refused(tmp_path: Path) -> None:
    rows = ", ".join(["[1, 0, 0, 0, 0, 0, 0, 0]"] * 8).replace("1", "1.0").replace(" 0", " 0.0")
    crosstalk = ("  amplifier:", f"  sensitivity: [{rows}]\n  amplifier:")
    assert_refused(tmp_path, *crosstalk, "plate", "sensitivity")
