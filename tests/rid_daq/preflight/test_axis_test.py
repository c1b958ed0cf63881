"""On a real cell, a valid axis test is part of the preflight.

A change of a file of the cell makes the test invalid.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from config.errors import ConfigError, PreflightError, RecordingError
from config.load import LoadedCell, load_cell, read_named
from rid_daq.preflight.axis_test import (
    AxisTestRule,
    axis_test_file,
    axis_test_line,
    require_axis_test,
    sign_axis,
)
from tests.builders.raised_codes import raises_code


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set a new state folder for this test, and return the folder of rid-daq in it."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "rid-daq"


def real_cell(folder: Path) -> LoadedCell:
    """Return the bundled cell as a user's real cell."""
    path = folder / "cell.yaml"
    if not path.exists():
        path.write_bytes(read_named("ir361", "cells", None)[0])
    loaded = load_cell(str(path))
    return replace(loaded, config=loaded.config.model_copy(update={"simulated": False}))


def sign_all(loaded: LoadedCell) -> None:
    for name in loaded.robot.joint_names:
        sign_axis(loaded, name, "a run")


def test_a_real_cell_moves_only_after_the_axis_test(tmp_path: Path) -> None:
    loaded = real_cell(tmp_path)
    with raises_code(PreflightError, "RID-AXIS-TEST-MISSING", "axis1", "axis2", "axis3", "cell.y"):
        require_axis_test(loaded, AxisTestRule.REQUIRED)
    line = axis_test_line(loaded, AxisTestRule.REQUIRED)
    assert (line.verdict, line.code) == ("red", "RID-AXIS-TEST-MISSING")
    assert "rid-daq axes" in line.next_action
    sign_all(loaded)
    assert require_axis_test(loaded, AxisTestRule.REQUIRED).startswith("passed, ")
    tested = axis_test_line(loaded, AxisTestRule.REQUIRED)
    assert (tested.verdict, tested.code) == ("ok", "")


def test_an_axis_that_is_missing_is_named(tmp_path: Path) -> None:
    loaded = real_cell(tmp_path)
    sign_axis(loaded, "axis1", "a run")
    sign_axis(loaded, "axis3", "a run")
    with raises_code(PreflightError, "RID-AXIS-TEST-MISSING", "axis2"):
        require_axis_test(loaded, AxisTestRule.REQUIRED)


@pytest.mark.parametrize("file", ["cell.yaml", "robot.yaml"])
def test_an_axis_test_is_invalid_after_a_change_of_a_file(file: str, tmp_path: Path) -> None:
    loaded = real_cell(tmp_path)
    sign_all(loaded)
    changed = replace(loaded, files=loaded.files | {file: loaded.files[file] + b"\n# changed"})
    with raises_code(PreflightError, "RID-AXIS-TEST-MISSING"):
        require_axis_test(changed, AxisTestRule.REQUIRED)
    sign_axis(changed, "axis1", "a run")
    with raises_code(PreflightError, "RID-AXIS-TEST-MISSING", "axis2", "axis3"):
        require_axis_test(changed, AxisTestRule.REQUIRED)


def test_a_waived_axis_test_lists_the_missing_axes(tmp_path: Path) -> None:
    loaded = real_cell(tmp_path)
    sign_axis(loaded, "axis1", "a run")
    assert require_axis_test(loaded, AxisTestRule.WAIVED) == "waived; missing: axis2, axis3"
    assert axis_test_line(loaded, AxisTestRule.WAIVED).verdict == "allowed"


def test_a_simulated_cell_needs_no_axis_test() -> None:
    loaded = load_cell("ir361")
    assert require_axis_test(loaded, AxisTestRule.REQUIRED) == ""
    assert axis_test_line(loaded, AxisTestRule.REQUIRED).verdict == "shown"
    assert axis_test_file(loaded) is None
    assert sign_axis(loaded, "axis1", "a run") is None


def test_an_invalid_axis_test_file_is_named(tmp_path: Path) -> None:
    loaded = real_cell(tmp_path)
    sign_all(loaded)
    path = axis_test_file(loaded)
    assert path is not None
    path.write_text("{}")
    with raises_code(ConfigError, "RID-FILE-VALUE", path.name):
        require_axis_test(loaded, AxisTestRule.REQUIRED)


def record_path(loaded: LoadedCell) -> Path:
    found = axis_test_file(loaded)
    assert found is not None
    return found


@pytest.mark.promise("axis-test-signed")
def test_an_axis_test_file_next_to_the_cell_file_does_not_count(tmp_path: Path) -> None:
    loaded = real_cell(tmp_path)
    sign_all(loaded)
    record_path(loaded).rename(tmp_path / "cell.axes.json")
    assert axis_test_line(loaded, AxisTestRule.REQUIRED).verdict == "red"


def edit_joint(record: dict[str, object], axis: dict[str, object]) -> None:
    axis["joint"] = "axis1"


def edit_tester(record: dict[str, object], axis: dict[str, object]) -> None:
    axis["who"] = "anna"


def edit_signature(record: dict[str, object], axis: dict[str, object]) -> None:
    axis["signature"] = "0" * 64


def remove_signature(record: dict[str, object], axis: dict[str, object]) -> None:
    del axis["signature"]


def edit_cell(record: dict[str, object], axis: dict[str, object]) -> None:
    record["cell"] = "kr15"


@pytest.mark.promise("axis-test-signed")
@pytest.mark.parametrize(
    "edit", [edit_joint, edit_tester, edit_signature, remove_signature, edit_cell]
)
def test_an_edited_axis_test_does_not_count(
    edit: Callable[[dict[str, object], dict[str, object]], None], tmp_path: Path
) -> None:
    loaded = real_cell(tmp_path)
    sign_axis(loaded, "axis2", "a run")
    path = record_path(loaded)
    record = json.loads(path.read_text())
    edit(record, record["axes"][0])
    path.write_text(json.dumps(record))
    line = axis_test_line(loaded, AxisTestRule.REQUIRED)
    assert line.found == "missing: axis1, axis2, axis3"
    assert line.verdict == "red"


@pytest.mark.promise("axis-test-signed")
def test_an_axis_test_copied_for_other_files_does_not_count(tmp_path: Path) -> None:
    loaded = real_cell(tmp_path)
    sign_all(loaded)
    changed = replace(loaded, files=loaded.files | {"cell.yaml": b"# another\n"})
    record_path(loaded).rename(record_path(changed))
    record = json.loads(record_path(changed).read_text())
    assert axis_test_line(changed, AxisTestRule.REQUIRED).verdict == "red"
    sign_axis(changed, "axis1", "a run")
    true = json.loads(record_path(changed).read_text())
    record |= {name: true[name] for name in ("cell_sha256", "robot_sha256")}
    record_path(changed).write_text(json.dumps(record))
    found = axis_test_line(changed, AxisTestRule.REQUIRED).found
    assert found == "missing: axis1, axis2, axis3", (
        "the signatures have the hashes of other files, so no axis counts"
    )


@pytest.mark.promise("axis-test-signed")
def test_an_axis_test_of_another_account_or_computer_does_not_count(
    tmp_path: Path, state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded = real_cell(tmp_path)
    sign_all(loaded)
    monkeypatch.setattr("rid_daq.preflight.axis_test._computer_id", lambda: "another")
    assert axis_test_line(loaded, AxisTestRule.REQUIRED).verdict == "red"
    monkeypatch.undo()
    monkeypatch.setenv("XDG_STATE_HOME", str(state.parent))
    assert axis_test_line(loaded, AxisTestRule.REQUIRED).verdict == "ok"
    (state / "axis-test.key").unlink()
    assert axis_test_line(loaded, AxisTestRule.REQUIRED).verdict == "red", "a new signing key"


@pytest.mark.promise("axis-test-signed")
def test_a_signing_key_that_others_can_access_is_refused(tmp_path: Path, state: Path) -> None:
    loaded = real_cell(tmp_path)
    sign_all(loaded)
    secret = state / "axis-test.key"
    assert secret.stat().st_mode & 0o777 == 0o600
    assert state.stat().st_mode & 0o777 == 0o700
    os.chmod(secret, 0o640)
    with pytest.raises(RecordingError) as refused:
        axis_test_line(loaded, AxisTestRule.REQUIRED)
    assert refused.value.refusal == "RID-STATE-FOREIGN"
    os.chmod(secret, 0o600)
    os.chmod(state, 0o770)
    with pytest.raises(RecordingError) as refused:
        axis_test_line(loaded, AxisTestRule.REQUIRED)
    assert refused.value.refusal == "RID-STATE-FOREIGN"


def test_a_damaged_signing_key_is_refused(tmp_path: Path, state: Path) -> None:
    loaded = real_cell(tmp_path)
    sign_all(loaded)
    secret = state / "axis-test.key"
    whole = secret.read_bytes()
    for content in (b"", whole[:-1], whole + b"x"):
        secret.write_bytes(content)
        with raises_code(RecordingError, "RID-STATE-DAMAGED", str(secret)):
            require_axis_test(loaded, AxisTestRule.REQUIRED)


def test_the_axis_test_names_the_tester(tmp_path: Path) -> None:
    loaded = real_cell(tmp_path)
    for name in loaded.robot.joint_names:
        sign_axis(loaded, name, "a run", "Anna")
    assert axis_test_line(loaded, AxisTestRule.REQUIRED).found.endswith(", Anna")
