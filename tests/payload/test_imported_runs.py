"""`rid-daq payload identify` with imported runs, and bodies that were left on the flange."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from acquisition.recording.recording import Recording
from acquisition.runs.catalogue import find_run
from config.arrays import FloatArray
from identification.estimation.file import write_estimate
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from identification.payload.body import PayloadBody
from rid_daq.app import run
from rid_daq.operations.estimation.run_estimation import EstimationJob, estimate_runs
from rid_daq.runs.run_data import RunData
from rid_daq.terminal.exit_codes import ExitCode

pytestmark = pytest.mark.usefixtures("plain_reports")

IMPORTED = ("empty", "first", "second", "third", "left on", "heavy left on")
COARSE_RAD = np.deg2rad(0.2)


@pytest.fixture(scope="module")
def imported(lab: SimpleNamespace, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Imported periodic runs: unloaded, three times loaded, and with a light or a heavy body.

    The bodies were left on the flange. Two runs also exist with coarse positions.
    """
    place = tmp_path_factory.mktemp("imported")
    robot = lab.six_axes(name="six")
    motion = lab.motion_of(robot)
    (place / "six.yaml").write_text(robot.model_dump_json(), encoding="utf-8")
    columns = {
        "name": "six",
        "robot": "six.yaml",
        "columns": 13,
        "time": {"column": 0, "unit": "s"},
        "units": {"position": "rad", "torque": "Nm"},
        "joints": [
            {"joint": name, "position": 1 + j, "torque": 7 + j}
            for j, name in enumerate(robot.joint_names)
        ],
        "plausible": {"position": 7.0, "speed": 8.0, "torque": 900.0},
        "period_s": 8.0,
        "torques": "motor_torque",
    }
    (place / "map.yaml").write_text(json.dumps(columns), encoding="utf-8")
    rest = PayloadBody(0.3, np.array([0.0, 0.0, 0.04]), 1e-3 * np.eye(3))
    heavy = PayloadBody(5.8, np.array([0.0, 0.0, 0.3]), 0.1 * np.eye(3))
    carried = [None, lab.medium, lab.medium, lab.medium, rest, heavy]
    for seed, (label, payload) in enumerate(zip(IMPORTED, carried, strict=True), 1):
        recording = lab.measured(robot, motion, payload, seed=seed, friction=1.0 + 0.05 * seed)
        import_run(place, label, recording, recording.position)
        if label in ("empty", "first"):
            steps = np.round(recording.position / COARSE_RAD)
            import_run(place, f"coarse {label}", recording, COARSE_RAD * steps)
    return place


def import_run(place: Path, label: str, recording: Recording, position: FloatArray) -> None:
    """Import a recording as run `label`, with `position` instead of its positions."""
    table = np.column_stack([recording.time_s, position, recording.torque_nm])
    with (place / f"{label}.csv").open("w", newline="") as file:
        csv.writer(file).writerows(table.tolist())
    words = ["import", str(place / f"{label}.csv"), "--map", str(place / "map.yaml")]
    assert run([*words, "--label", label, "--runs", str(place / "runs")]) == 0


def test_repeated_periodic_runs_from_csv_files_of_another_manufacturer(
    lab: SimpleNamespace, imported: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Three runs are with the payload and one is without; the scatter of the three is reported."""
    capsys.readouterr()
    words = ["payload", "identify", "--unloaded", "empty", "--no-rotors", "--json"]
    for label in ("first", "second", "third"):
        words += ["--loaded", label]
    assert run([*words, "--runs", str(imported / "runs")]) == 0
    document = json.loads(capsys.readouterr().out)
    section = document["payload"]
    assert section["repeats"]["runs"] == 3
    assert section["repeats"]["ratio"] < 2.0
    for entry, truth in zip(section["parameters"], lab.medium.reported, strict=True):
        assert abs(entry["value"] - truth) < 3.0 * entry["std"]


@pytest.mark.parametrize(
    ("band", "code", "passed"), [((), 0, True), (("--band", "12"), ExitCode.DATA_QUALITY, False)]
)
def test_rounded_positions_narrow_the_default_band_and_fail_a_wide_one(
    lab: SimpleNamespace,
    imported: Path,
    capsys: pytest.CaptureFixture[str],
    band: tuple[str, ...],
    code: int,
    passed: bool,
) -> None:
    capsys.readouterr()
    words = ["payload", "identify", "--unloaded", "coarse empty", "--loaded", "coarse first"]
    words += ["--no-rotors", "--json", "--runs", str(imported / "runs"), *band]
    assert run(words) == code
    document = json.loads(capsys.readouterr().out)
    rounding = document["verdict"]["checks"][-1]
    assert (rounding["limit"], rounding["passed"]) == (pytest.approx(0.1), passed)
    for entry, truth in zip(document["payload"]["parameters"], lab.medium.reported, strict=True):
        assert abs(entry["value"] - truth) < 3.0 * entry["std"]


def test_a_body_left_on_the_flange_is_found_with_a_model_of_the_robot(
    imported: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs, model = ["--runs", str(imported / "runs")], str(imported / "empty.json")
    how = EstimationJob(EstimationOptions(ModelOptions(rotors=False)))
    empty = RunData.load(find_run(imported / "runs", "empty"))
    write_estimate(Path(model), estimate_runs([empty], how).estimate)
    words = ["payload", "identify", "--loaded", "first", "--procedure", "together", *runs]
    capsys.readouterr()
    # Without a model of the robot, the check passes and states its assumption.
    assert run([*words, "--no-rotors", "--unloaded", "left on"]) == 0
    capsys.readouterr()
    assert run([*words, "--unloaded", "left on", "--model", model]) == 1
    output = " ".join(capsys.readouterr().out.split())
    assert (
        "Failed: mass on the flange in the runs without payload, according to the model" in output
    )
    assert "Remove it and record these runs again." in output


def test_a_heavy_body_left_on_the_flange_is_named_as_the_likely_mistake(
    imported: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["payload", "identify", "--no-rotors", "--unloaded", "heavy left on"]
    capsys.readouterr()
    assert run([*words, "--loaded", "first", "--runs", str(imported / "runs")]) == 1
    output = " ".join(capsys.readouterr().out.split())
    assert "Failed: probability that a physically consistent body explains the data" in output
    assert "A heavy object on the flange in the runs without payload is subtracted" in output
