"""The axis test is part of the preflight of a real cell, until a file changes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from config.errors import ConfigError, PreflightError
from config.load import LoadedCell, load_cell, read_named
from rid_daq.preflight.axis_test import (
    AxisTestRule,
    axis_test_file,
    axis_test_line,
    require_axis_test,
    sign_axis,
)


def real(folder: Path) -> LoadedCell:
    """Return the bundled cell as one of a person's own, and real."""
    path = folder / "cell.yaml"
    if not path.exists():
        path.write_bytes(read_named("ir361", "cells", None)[0])
    loaded = load_cell(str(path))
    return replace(loaded, config=loaded.config.model_copy(update={"simulated": False}))


def sign_all(loaded: LoadedCell) -> None:
    for name in loaded.robot.joint_names:
        sign_axis(loaded, name, "a run")


def test_a_real_cell_is_moved_only_after_the_axis_test(tmp_path: Path) -> None:
    loaded = real(tmp_path)
    with pytest.raises(PreflightError, match=r"axis1, axis2, axis3 .*run `rid-daq axes .*cell\.y"):
        require_axis_test(loaded, AxisTestRule.REQUIRED)
    line = axis_test_line(loaded, AxisTestRule.REQUIRED)
    assert line.verdict == "red"
    assert "rid-daq axes" in line.next_action
    sign_all(loaded)
    assert require_axis_test(loaded, AxisTestRule.REQUIRED).startswith("passed, ")
    assert axis_test_line(loaded, AxisTestRule.REQUIRED).verdict == "ok"


def test_an_axis_that_is_missing_is_named(tmp_path: Path) -> None:
    loaded = real(tmp_path)
    sign_axis(loaded, "axis1", "a run")
    sign_axis(loaded, "axis3", "a run")
    with pytest.raises(PreflightError, match="the axis test of axis2 is missing"):
        require_axis_test(loaded, AxisTestRule.REQUIRED)


@pytest.mark.parametrize("file", ["cell.yaml", "robot.yaml"])
def test_it_counts_no_more_once_a_file_has_changed(file: str, tmp_path: Path) -> None:
    loaded = real(tmp_path)
    sign_all(loaded)
    changed = replace(loaded, files=loaded.files | {file: loaded.files[file] + b"\n# changed"})
    with pytest.raises(PreflightError, match="older than cell or robot file"):
        require_axis_test(changed, AxisTestRule.REQUIRED)
    sign_axis(changed, "axis1", "a run")
    with pytest.raises(PreflightError, match="axis2, axis3 is missing"):
        require_axis_test(changed, AxisTestRule.REQUIRED)


def test_who_waives_it_is_told_what_is_missing_for_the_run(tmp_path: Path) -> None:
    loaded = real(tmp_path)
    sign_axis(loaded, "axis1", "a run")
    assert require_axis_test(loaded, AxisTestRule.WAIVED) == "waived; missing: axis2, axis3"
    assert axis_test_line(loaded, AxisTestRule.WAIVED).verdict == "allowed"


def test_a_simulated_cell_needs_none() -> None:
    loaded = load_cell("ir361")
    assert require_axis_test(loaded, AxisTestRule.REQUIRED) == ""
    assert axis_test_line(loaded, AxisTestRule.REQUIRED).verdict == "shown"
    assert axis_test_file(loaded) is None
    assert sign_axis(loaded, "axis1", "a run") is None


def test_a_file_that_is_no_axis_test_is_refused_by_its_name(tmp_path: Path) -> None:
    loaded = real(tmp_path)
    (tmp_path / "cell.axes.json").write_text("{}")
    with pytest.raises(ConfigError, match=r"cell\.axes\.json"):
        require_axis_test(loaded, AxisTestRule.REQUIRED)
