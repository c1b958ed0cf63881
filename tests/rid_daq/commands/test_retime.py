"""`rid-daq retime`: a motion file becomes a faster one, with its page; mistakes are told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.limits import verify_limits
from acquisition.motion.motion_file import load_motion
from config.load import load_cell
from identification.estimation.estimate import predict
from identification.estimation.file import read_estimate, write_estimate
from rid_daq.app import run
from tests.builders.known_model import known
from tests.builders.told import document

PATH = """
kind: joint_path
robot: ir361
speed_fraction: 0.6
points:
- [0.0, 0.0, 0.0]
- [0.5, 0.3, -0.4]
- [0.9, 0.1, 0.3]
- [0.0, 0.2, 0.5]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    estimate = known(load_cell("ir361"), {})
    estimate = replace(estimate, covariance_jackknife=np.diag((0.01 * estimate.values) ** 2))
    write_estimate(tmp_path / "model.json", estimate)
    (tmp_path / "path.yaml").write_text(PATH)
    return tmp_path


def words(folder: Path, *more: object) -> list[str]:
    model, path, fast = (str(folder / name) for name in ("model.json", "path.yaml", "fast.yaml"))
    own = ["retime", "ir361", path, "--model", model, "-o", fast]
    return [*own, *(str(word) for word in more)]


def test_a_motion_is_timed_and_shown(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(words(folder, "--report", folder / "fast.html", "--json")) == 0
    told = document(capsys)
    assert told["shorter_percent"] > 20.0
    assert told["off_the_path"] < 1e-4
    assert [joint["joint"] for joint in told["joints"]] == ["axis1", "axis2", "axis3"]
    cell = load_cell("ir361")
    motion = load_motion(folder / "fast.yaml")
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    verify_limits(samples, cell.robot)
    model = read_estimate(folder / "model.json")
    torque = np.abs(predict(model, samples.position, samples.velocity, samples.acceleration))
    for j, joint in enumerate(told["joints"]):
        assert torque[:, j].max() == pytest.approx(joint["torque_peak"], rel=1e-6)
        assert torque[:, j].max() + joint["torque_margin"] * 0.5 < joint["torque_limit"]
    page = (folder / "fast.html").read_text()
    assert "Timed to its limits" in page
    assert "limit curve" in page
    assert "path.yaml" in page


def test_the_next_command_is_to_record(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(words(folder, "--confidence", "0", "--margin", "0.1")) == 0
    said = capsys.readouterr().out
    assert "% shorter" in said
    assert "rid-daq record ir361" in said


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--confidence", "1.5"], "confidence of 1.5"),
        (["--margin", "2"], "margin of 2"),
        (["--margin", "0.97"], "cannot be driven within its limits at any speed: torque of axis3"),
        (["--jerk", "1", "--jerk", "2"], "--jerk has 2 values: give one, or one for each of 3"),
        (["--torque-rate", "-1"], "--torque-rate must be positive"),
        (["--mass", "300"], "--mass"),
        (["--base-limits"], "--base-limits: cell ir361 has no `plate` with `limits`"),
        (["--rms-torque", "5"], "RMS torque of axis2 is"),
    ],
)
def test_what_cannot_be_is_told(
    more: list[str], told: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words(folder, *more)) != 0
    assert told in " ".join(capsys.readouterr().err.split())
    assert not (folder / "fast.yaml").exists()
