"""Blocks of a run, compatibility of runs, and facts of a motion, without a browser."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.errors import ConfigError, LimitError
from config.load import LoadedCell, load_cell
from rid_daq.blocks.block import Text
from rid_daq.blocks.plot import Plot
from rid_daq.figures.figure_item import figure_item
from rid_daq.report.result_file import RESULT
from rid_daq.workbench.data_check import check_data
from rid_daq.workbench.motion_blocks import motion_blocks
from rid_daq.workbench.run_blocks import run_blocks
from tests.builders.invented import whole_result
from tests.builders.raised_codes import raises_code

MOTION = """kind: fourier
robot: ir361
period_s: 2.0
periods: 3
ramp_s: 1.0
joints:
  - {joint: axis1, sine: [0.2, 0.05], cosine: [0.1, 0.0]}
  - {joint: axis2, sine: [0.2, 0.0], cosine: [0.1, 0.05]}
  - {joint: axis3, sine: [0.2, 0.02], cosine: [0.1, 0.03]}
"""


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    return load_cell("ir361")


def recorded(
    root: Path, cell: LoadedCell, label: str, status: RunStatus | None = RunStatus.COMPLETE
) -> RunFolder:
    """Write a run of a cell without its recording."""
    folder = RunFolder.create(root, label)
    for name, content in cell.files.items():
        folder.write(name, content)
    folder.write("motion.yaml", MOTION.encode())
    if status is not None:
        folder.finish(status)
    return folder


def test_a_run_has_the_blocks_of_its_results(tmp_path: Path, cell: LoadedCell) -> None:
    folder = recorded(tmp_path, cell, "plain")
    assert not list(run_blocks(folder))
    folder.file(RESULT).write_text(json.dumps(whole_result()))
    plots = [each for each in run_blocks(folder) if isinstance(each, Plot)]
    assert {"fit", "residual_spectrum", "path", "stop"} <= {each.name for each in plots}
    (fit, _) = [each for each in run_blocks(folder, ["curves"]) if isinstance(each, Plot)]
    assert figure_item(fit)["columns"]


def test_compatible_runs_pass_their_checks(tmp_path: Path, cell: LoadedCell) -> None:
    found = check_data(cell, [recorded(tmp_path, cell, "one"), recorded(tmp_path, cell, "two")])
    assert [each.passed for each in found.data] == [True, True]
    assert [each.text.split(":")[0] for each in found.model] == ["Run one", "Run two"]
    assert all("condition number" in each.text for each in found.model)
    assert found.parameters > 0
    assert set(found.friction) == set(cell.robot.joint_names)


def test_an_incompatible_run_fails_with_its_reason(tmp_path: Path, cell: LoadedCell) -> None:
    of_another = recorded(tmp_path, load_cell("kr15"), "another robot")
    stopped = recorded(tmp_path, cell, "stopped", RunStatus.STOPPED)
    unfinished = recorded(tmp_path, cell, "unfinished", None)
    changed = recorded(tmp_path, cell, "changed")
    file = changed.file("robot.yaml")
    file.write_text(file.read_text() + "# another hand\n")
    found = check_data(cell, [of_another, stopped, unfinished, changed]).data
    assert [each.passed for each in found] == [False] * 4
    words = ("of robot kr15, but the cell has ir361", "is stopped", "is unfinished", "robot.yaml")
    for each, word in zip(found, words, strict=True):
        assert word in each.text


def test_a_motion_has_facts_and_plots(tmp_path: Path, cell: LoadedCell) -> None:
    path = tmp_path / "motion.yaml"
    path.write_text(MOTION)
    facts, *plots = motion_blocks(cell, path, None)
    assert isinstance(facts, Text)
    assert "Condition number" in facts.text
    assert re.search(r"Duration: (8|9|10)\.\d s", facts.text)
    for plot in plots:
        assert isinstance(plot, Plot)
        assert figure_item(plot)["columns"]


def test_a_motion_of_another_robot_or_beyond_a_limit_is_refused(
    tmp_path: Path, cell: LoadedCell
) -> None:
    path = tmp_path / "motion.yaml"
    path.write_text(MOTION.replace("robot: ir361", "robot: kr15"))
    with raises_code(ConfigError, "RID-ROBOT-OTHER", "kr15"):
        list(motion_blocks(cell, path, None))
    path.write_text(MOTION.replace("sine: [0.2, 0.05]", "sine: [9.0, 0.05]"))
    with raises_code(LimitError, "RID-MOTION-LIMIT", "axis1"):
        list(motion_blocks(cell, path, None))
