"""A force plate of another program, from CSV files to estimate and verdict."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.runs.catalogue import find_run
from benchmarks.loaded import Workplace
from benchmarks.plates import ForeignFiles, as_six_components, differences, named_mistake

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> ForeignFiles:
    """Return the CSV files of a recorded run; a correct map has imported them as run `csv`."""
    work = Workplace(tmp_path_factory.mktemp("foreign"), "ir361")
    work.excitation("excitation", 1, 4)
    work.record("excitation", "recorded")
    found = ForeignFiles.of(work, "recorded")
    found.as_recorded("csv")
    return found


@pytest.mark.parametrize("kind", ["external", "combined"])
def test_estimates_are_those_of_the_recorded_run(files: ForeignFiles, kind: str) -> None:
    relative, _ = differences(files.work, "csv", kind)
    assert relative < 1e-9


def test_six_components_give_the_estimate_of_the_channels(files: ForeignFiles) -> None:
    assert as_six_components(files) < 0.1


def test_a_turned_plate_is_named_with_the_key_of_the_map(files: ForeignFiles) -> None:
    roll, pitch, yaw = files.plate["rotation_rad"]
    assert named_mistake(files, "plate rotation", {"rotation_rad": [roll, pitch, yaw + 1.5708]})


def test_an_external_model_is_judged_by_the_wrench(files: ForeignFiles) -> None:
    differences(files.work, "csv", "external")  # identifies both models
    model = files.work.path("recorded external.json")
    said = files.work("validate", model, "csv")
    checked = {line["text"] for line in said["verdict"]["checks"]}
    assert {f"relative error of the base wrench, {name}" for name in ("Fx", "Fz", "Mz")} < checked
    assert said["verdict"]["passed"]


def test_a_wrench_that_the_external_model_does_not_predict_fails(files: ForeignFiles) -> None:
    differences(files.work, "csv", "external")
    files.as_recorded("twice", scale=[2.0] * 8)
    said = files.work("validate", files.work.path("recorded external.json"), "twice", codes=(1,))
    assert not said["verdict"]["passed"]


def test_the_report_of_the_import_shows_the_delay(files: ForeignFiles) -> None:
    files.as_recorded("shown")
    page = Path(find_run(files.work.folder / "runs", "shown").file("report.html")).read_text()
    assert "the motion shows" in page


def test_several_runs_are_judged_by_their_wrench_together(files: ForeignFiles) -> None:
    differences(files.work, "csv", "external")
    table = files.work.folder / "robot.csv"
    names, rows = table.read_text().split("\n", 1)
    values = np.loadtxt(rows.splitlines(), delimiter=",")
    values[:, -1] += 1e-6  # another run never has equal torques
    np.savetxt(table, values, fmt="%.17g", delimiter=",", header=names.strip(), comments="")
    files.as_recorded("again")
    model = files.work.path("recorded external.json")
    said = files.work("validate", model, "csv", "again")
    assert len([line for line in said["verdict"]["checks"] if "base wrench" in line["text"]]) == 6
    assert said["verdict"]["passed"]
