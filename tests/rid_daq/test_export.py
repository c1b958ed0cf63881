"""`rid-daq export`: files that other programs read, and what is refused."""

from __future__ import annotations

import csv
import ctypes
import importlib.util
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.excitation import FourierTrajectory
from acquisition.motion_samples import Phase
from acquisition.periods import average_periods
from acquisition.recording import Recording
from config.load import load_cell
from dynamics.robot_model import RobotModel, torque
from identification.estimate import Estimate, predict
from identification.estimate_file import write_estimate
from identification.estimators import estimate_periodic
from identification.experiment_design import design_two_harmonic
from rid_daq.app import run
from rid_daq.truth import true_parameters

CYCLE_S = 0.008


@pytest.fixture(scope="module")
def estimate() -> Estimate:
    """Return an estimate of the bundled arm from three noisy periods."""
    cell = load_cell("ir361")
    model = RobotModel.from_description(cell.robot)
    motion = design_two_harmonic(cell.robot, 5.0, CYCLE_S, highest_harmonic=6, tries=20, periods=3)
    path = FourierTrajectory.from_motion(motion, cell.robot, CYCLE_S)
    times = path.sample_times_s
    q, v, a = path.position(times), path.velocity(times), path.acceleration(times)
    tau = torque(model, q, v, a, true_parameters(model, cell.robot, cell.plant))
    rows = 3 * len(times)
    noise = np.random.default_rng(0).standard_normal((rows, 3))
    recording = Recording(
        joint_names=cell.robot.joint_names,
        time_s=np.arange(rows) * CYCLE_S,
        position=np.tile(q, (3, 1)),
        torque_nm=np.tile(tau, (3, 1)) + noise,
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(rows),
        source="cell",
        sample_period_s=CYCLE_S,
        samples_per_period=len(times),
    )
    return estimate_periodic(cell.robot, [average_periods(recording)], run_ids=("made */ up",))


@pytest.fixture
def model_file(estimate: Estimate, tmp_path: Path) -> Path:
    write_estimate(tmp_path / "model.json", estimate)
    return tmp_path / "model.json"


@pytest.fixture
def motion() -> np.ndarray:
    return np.random.default_rng(2).uniform(-1.5, 1.5, (3, 30, 3))


def test_the_c_function_predicts_what_the_model_file_predicts(
    estimate: Estimate, model_file: Path, motion: np.ndarray, tmp_path: Path
) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    source, library = tmp_path / "robot.c", tmp_path / "robot.so"
    assert run(["export", str(model_file), "--to", "c", "-o", str(source)]) == 0
    strict = ["-std=c99", "-Wall", "-Werror", "-shared", "-fPIC"]
    subprocess.run([compiler, *strict, "-o", library, source, "-lm"], check=True)
    function = ctypes.CDLL(str(library)).ir361_inverse_dynamics
    out, tau = (ctypes.c_double * 3)(), []
    for sample in motion.transpose(1, 0, 2):
        function(*((ctypes.c_double * 3)(*row) for row in sample), out)
        tau.append(list(out))
    np.testing.assert_allclose(tau, predict(estimate, *motion), rtol=1e-9, atol=1e-9)


def test_the_python_function_predicts_what_the_model_file_predicts(
    estimate: Estimate, model_file: Path, motion: np.ndarray, tmp_path: Path
) -> None:
    path = tmp_path / "robot.py"
    assert run(["export", str(model_file), "--to", "python", "-o", str(path)]) == 0
    tau = imported(path).inverse_dynamics(*motion)
    np.testing.assert_allclose(tau, predict(estimate, *motion), rtol=1e-9, atol=1e-9)


def test_tables_hold_the_parameters(estimate: Estimate, model_file: Path, tmp_path: Path) -> None:
    for form in ("csv", "json"):
        out = tmp_path / f"table.{form}"
        assert run(["export", str(model_file), "--to", form, "-o", str(out)]) == 0
    with (tmp_path / "table.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["kind"] == "identified"]
    np.testing.assert_array_equal([float(row["value"]) for row in rows], estimate.values)
    document = json.loads((tmp_path / "table.json").read_text())
    assert document["runs"] == ["made */ up"]


def test_a_file_that_is_there_is_kept(model_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "robot.py"
    out.write_text("mine")
    words = ["export", str(model_file), "--to", "python", "-o", str(out)]
    assert run(words) == 2
    assert out.read_text() == "mine"
    assert run([*words, "--overwrite"]) == 0
    assert "inverse_dynamics" in out.read_text()


def test_what_is_no_model_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "no.json").write_text("{}")
    out = tmp_path / "robot.c"
    assert run(["export", str(tmp_path / "no.json"), "--to", "c", "-o", str(out)]) == 2
    assert "not an estimate" in capsys.readouterr().err
    assert not out.exists()


def imported(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location("exported", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
