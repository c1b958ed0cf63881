"""A model in a run folder is the model of this run, or it is refused."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.runs.catalogue import find_run
from config.errors import RecordingError
from rid_daq.app import run
from rid_daq.runs.run_model import read_model
from tests.builders.identified_run import arm_in_motion, identified_run
from tests.builders.raised_codes import raises_code


@pytest.fixture(scope="module")
def two_runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root, arm = tmp_path_factory.mktemp("runs"), arm_in_motion()
    for seed, label in enumerate(("one", "two")):
        identified_run(root, arm, label, seed)
    return root


@pytest.fixture
def folder_of(two_runs: Path, tmp_path: Path) -> Callable[[str], Path]:
    """Return a function for the folder of a run with a label, in a copy of all runs."""
    root = shutil.copytree(two_runs, tmp_path / "runs")
    return lambda label: find_run(root, label).path


def test_the_model_of_a_run_is_read(folder_of: Callable[[str], Path]) -> None:
    folder = folder_of("one")
    assert read_model(folder / "model.json").run_ids == (folder.name,)


def test_a_model_in_another_runs_folder_is_refused(
    folder_of: Callable[[str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    one, two = folder_of("one"), folder_of("two")
    shutil.copy(one / "model.json", two / "model.json")
    with raises_code(RecordingError, "RID-RUN-MIXED", one.name, two.name):
        read_model(two / "model.json")
    assert run(["compare", "one", "two", "--runs", str(one.parent)]) != 0
    assert "RID-RUN-MIXED" in capsys.readouterr().err
    outside = one.parent.parent / "model.json"
    shutil.copy(one / "model.json", outside)
    assert read_model(outside).run_ids == (one.name,), "a copy elsewhere belongs to no folder"


@pytest.mark.parametrize("name", ["recording.mcap", "robot.yaml"])
def test_a_model_whose_run_has_another_file_is_refused(
    name: str, folder_of: Callable[[str], Path]
) -> None:
    one = folder_of("one")
    (one / name).write_bytes((one / name).read_bytes() + b"\n")
    with raises_code(RecordingError, "RID-RUN-CHANGED", name):
        read_model(one / "model.json")
