"""Files that are named beside a cell belong to its robot, or are refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.motion.kinds.multipoint import MultipointMotion
from config.errors import ConfigError
from config.load import LoadedCell, load_cell, to_yaml
from rid_daq.jobs.cell_files import motion_bytes, motion_for


@pytest.fixture
def cell() -> LoadedCell:
    return load_cell("ir361")


def written(folder: Path, robot: str) -> Path:
    motion = MultipointMotion(kind="multipoint", robot=robot, points=3, seed=1)
    path = folder / "motion.yaml"
    path.write_text(f"# kept as it stands\n{to_yaml(motion)}")
    return path


def test_a_motion_of_the_cells_robot_is_kept_with_its_comments(
    cell: LoadedCell, tmp_path: Path
) -> None:
    path = written(tmp_path, cell.robot.name)
    motion = motion_for(path, cell)
    assert motion.robot == cell.robot.name
    assert motion_bytes(motion, path) == path.read_bytes()


def test_a_motion_of_another_robot_is_refused_by_both_names(
    cell: LoadedCell, tmp_path: Path
) -> None:
    path = written(tmp_path, "another")
    with pytest.raises(ConfigError) as refused:
        motion_for(path, cell)
    for word in (str(path), "'another'", repr(cell.robot.name), cell.config.name):
        assert word in str(refused.value)
