from __future__ import annotations

import re
from pathlib import Path

import pytest

from acquisition.motion.motion_file import load_motion
from config.load import load_cell
from rid_daq.app import run


def test_files_of_init_load_and_the_motions_keep_the_limits(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "cell"
    assert run(["init", str(folder)]) == 0
    loaded = load_cell(str(folder / "cell.yaml"))
    assert loaded.config.simulated
    for name in ("motion.yaml", "validation.yaml"):
        motion = load_motion(folder / name)
        assert motion.robot == loaded.robot.name
        motion.plan(loaded.robot, loaded.config.cycle_time_s)


def test_every_file_of_init_has_comments(tmp_path: Path) -> None:
    run(["init", str(tmp_path)])
    for path in tmp_path.iterdir():
        text = path.read_text()
        comments = sum("#" in line for line in text.splitlines())
        assert comments >= 5, path.name


def test_every_commented_out_section_loads_if_enabled(tmp_path: Path) -> None:
    run(["init", str(tmp_path)])
    path = tmp_path / "cell.yaml"
    key = re.compile(r"^# (?=[a-z_]+:( |$)|  )", re.MULTILINE)
    path.write_text(key.sub("", path.read_text()))
    config = load_cell(str(path)).config
    assert config.validation_limits_percent
    assert config.workspace
    assert config.plate
    assert config.monitor


def test_init_does_not_overwrite_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "robot.yaml").write_text("mine")
    assert run(["init", str(tmp_path)]) == 2
    assert "RID-FILE-EXISTS" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["robot.yaml"]
    assert (tmp_path / "robot.yaml").read_text() == "mine"
