"""Writing a plate's zero into a cell file leaves everything else unchanged."""

from __future__ import annotations

import os
from importlib.resources import files
from pathlib import Path

from config.cell.plate import PlateZero
from config.errors import ConfigError
from config.load import load_cell
from rid_daq.runs.plate_zero_lines import replace_zero, write_zero, zero_lines
from tests.builders.raised_codes import raises_code

ZERO = PlateZero(
    offset_n=(1.5, -2.0, 0.0, 1e-7, 4.0, 5.0, 6.0, -1250.25),
    drift_n_s=(0.01,) * 8,
    pose=(-1.570796, -0.2, 0.5),
    rest_n=(0.0,) * 8,
)
OTHER = ZERO.model_copy(update={"offset_n": (9.0,) * 8})
BUNDLED = files("config").joinpath("bundled/cells/ir361.yaml").read_text()


def zero_of(text: str, tmp_path: Path) -> PlateZero | None:
    path = tmp_path / "cell.yaml"
    path.write_text(text)
    plate = load_cell(str(path)).config.plate
    assert plate is not None
    return plate.zero


def without_new(text: str) -> str:
    lines = text.splitlines(keepends=True)
    start = next(i for i, line in enumerate(lines) if line.startswith("  zero:"))
    return "".join(lines[:start] + lines[start + 5 :])


def test_the_zero_is_read_back_and_nothing_else_has_changed(tmp_path: Path) -> None:
    changed = replace_zero(BUNDLED, ZERO, "cell.yaml", "run 1")
    assert zero_of(changed, tmp_path) == ZERO
    assert without_new(changed) == BUNDLED
    assert "  zero: # run 1\n" in changed


def test_an_older_zero_is_replaced(tmp_path: Path) -> None:
    old = BUNDLED.replace(
        "  amplifier:\n",
        "  zero: # of May\n    offset_n: [1.0, 2.0, 3.0, 4.0,\n      5.0, 6.0, 7.0, 8.0]\n"
        "  # the amplifier stands on the shelf\n  amplifier:\n",
    )
    changed = replace_zero(old, OTHER, "cell.yaml")
    assert zero_of(changed, tmp_path) == OTHER
    assert "of May" not in changed
    assert "  # the amplifier stands on the shelf\n  amplifier:\n" in changed
    assert replace_zero(changed, ZERO, "c").count("zero:") == 1


def test_line_ends_are_preserved(tmp_path: Path) -> None:
    windows = BUNDLED.rstrip("\n").replace("\n", "\r\n")
    changed = replace_zero(windows, ZERO, "cell.yaml")
    assert "\n" not in changed.replace("\r\n", "")
    assert without_new(changed) == windows


def test_a_zero_at_the_end_without_a_line_end_is_replaced(tmp_path: Path) -> None:
    old = BUNDLED.rstrip("\n") + "\n  zero: {offset_n: [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]}"
    assert zero_of(replace_zero(old, ZERO, "cell.yaml"), tmp_path) == ZERO


def test_a_plate_section_on_one_line_is_refused() -> None:
    text = "name: x\nplate: {a_m: 0.1}\n"
    with raises_code(ConfigError, "RID-PLATE-ZERO-WRITE"):
        replace_zero(text, ZERO, "cell.yaml")
    with raises_code(ConfigError, "RID-PLATE-ZERO-WRITE"):
        replace_zero("name: x\n", ZERO, "cell.yaml")


def test_the_target_of_a_link_is_replaced_and_keeps_its_mode(tmp_path: Path) -> None:
    real, link = tmp_path / "real.yaml", tmp_path / "link.yaml"
    real.write_text(BUNDLED)
    real.chmod(0o640)
    link.symlink_to(real)
    write_zero(link, ZERO)
    assert link.is_symlink()
    assert os.stat(real).st_mode & 0o777 == 0o640
    assert zero_of(real.read_text(), tmp_path) == ZERO


def test_the_printed_lines_equal_the_written_ones() -> None:
    assert zero_lines(ZERO, "run 1") in replace_zero(BUNDLED, ZERO, "cell.yaml", "run 1")
