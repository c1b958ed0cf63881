"""The pose of a robot at rest: the newer of the preflight and the last motion."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import pytest

from config.load import LoadedCell, load_cell
from rid_daq.preflight.check_line import CheckLine
from rid_daq.preflight.last_pose import last_pose, store_pose
from rid_daq.service.records import Preflight
from rid_daq.workbench.view.resting_pose import RestingPose, resting_pose

MEASURED = (0.1, -0.2, 0.3)


@pytest.fixture
def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> LoadedCell:
    """Return a cell without a stored last pose; a pose that a test stores is removed after it."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return load_cell("ir361")


def line(where: str, what: str, position: float | None) -> CheckLine:
    return CheckLine(where, what, "", "", "shown", position=position)


def preflight(cell: LoadedCell, at_s: float, joints: int = 3) -> Preflight:
    names = cell.robot.joint_names[:joints]
    lines = tuple(
        line(f"{name}, node {i}", "position (6064h)", MEASURED[i - 1])
        for i, name in enumerate(names, start=1)
    )
    other = line("axis1, node 1", "answers", None)
    return Preflight(at_s=at_s, passed=True, problem=None, lines=(other, *lines))


def test_without_a_run_or_a_preflight_no_pose_is_known(cell: LoadedCell) -> None:
    assert resting_pose(cell, None) == RestingPose()


def test_a_preflight_that_did_not_reach_every_drive_gives_no_pose(cell: LoadedCell) -> None:
    assert resting_pose(cell, preflight(cell, 1e9, joints=2)).position is None


def test_the_newer_source_counts(cell: LoadedCell) -> None:
    store_pose(cell, (0.5, 0.5, 0.5), "run 01M8")
    stored = last_pose(cell)
    assert stored is not None
    stored_s = datetime.fromisoformat(stored.when_utc).timestamp()
    newer = resting_pose(cell, preflight(cell, stored_s + 60.0))
    assert newer == RestingPose(MEASURED, "the preflight", stored_s + 60.0)
    older = resting_pose(cell, preflight(cell, stored_s - 60.0))
    assert older == RestingPose((0.5, 0.5, 0.5), "the last motion", stored_s)
