"""`tracking --tracker`: the error at the tool is shown next to the error at the motors.

Another test finds the rests of a recording for a calibration.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.samples import Phase
from acquisition.runs.catalogue import find_runs
from acquisition.tracker.rests import find_rests
from benchmarks.measured_arm import MeasuredArm
from dynamics.geometry.kinematics import Chain, forward
from rid_daq.app import run
from rid_daq.runs.motion_runs import read_motion_run
from tests.builders.json_output import document

pytestmark = pytest.mark.slow

BENT = np.array([0.0, 1e-3, -5e-4])
"""Deflection of the gears in the second half of the motion [rad]."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recorded run and the tracker's file of this run."""
    folder = tmp_path_factory.mktemp("tracker")
    motion = folder / "motion.yaml"
    motion.write_text("kind: multipoint\nrobot: ir361\nseed: 4\npoints: 3\n")
    runs = ["--runs", str(folder / "runs")]
    assert run(["record", "ir361", str(motion), "--label", "moved", *runs]) == 0
    one = read_motion_run(find_runs(folder / "runs", ("moved",))[0], unfinished=False)
    recording = one.data.recording
    later = (recording.time_s > np.median(recording.time_s))[:, np.newaxis]
    path = forward(Chain.from_description(one.data.robot), recording.position - BENT * later)
    lines = ["time_s;x_mm;y_mm;z_mm"]
    for time_s, point in zip(recording.time_s, path, strict=True):
        row = (time_s + 77.25, *(1e3 * point[[1, 0, 2]] * [1.0, -1.0, 1.0]))
        lines.append(";".join(f"{value:.6f}".replace(".", ",") for value in row))
    (folder / "tracker.csv").write_text("\n".join(lines))
    assert (recording.phase == Phase.MAIN).any()
    return folder


def test_the_error_at_the_tool_is_reported(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["tracking", "moved", "--runs", str(folder / "runs")]
    words += ["--tracker", str(folder / "tracker.csv")]
    assert run([*words, "--json"]) == 0
    told = document(capsys)
    (tool,) = told["tool_side"]
    assert tool["clock_offset_s"] == pytest.approx(77.25, abs=0.02)
    assert tool["mean_m"] > tool["motor_mean_m"] + 1e-4
    assert 2e-4 < tool["mean_m"] < 1.5e-3
    assert "tracker.csv" in Path(told["report"]).read_text(encoding="utf-8")
    assert run([*words, "--tracker", str(folder / "tracker.csv"), "--json"]) == 2
    assert document(capsys)["error"]["code"] == "RID-OPTION-COUNT"
    assert run([*words, "--point", "0.765,0,0.02", "--json"]) == 0
    assert document(capsys)["tool_side"][0]["residual_m"] > tool["residual_m"]


def test_a_tracker_file_of_another_motion_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = (folder / "tracker.csv").read_text().splitlines()
    times = [line.split(";", 1)[0] for line in lines[1:]]
    points = [line.split(";", 1)[1] for line in lines[:0:-1]]
    other = folder / "other.csv"
    rows = [f"{time};{point}" for time, point in zip(times, points, strict=True)]
    other.write_text("\n".join((lines[0], *rows)))
    words = ["tracking", "moved", "--runs", str(folder / "runs"), "--tracker", str(other)]
    assert run([*words, "--json"]) == 6
    assert document(capsys)["error"]["code"] == "RID-TRACKER-ALIGNMENT"


def test_recorded_rests_give_the_joint_positions_of_a_calibration(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    form, motion, runs = (tmp_path / name for name in ("poses.csv", "poses.yaml", "runs"))
    words = ["calibrate", "poses", "ir361", "-o", str(form), "--count", "12"]
    assert run([*words, "--motion", str(motion), "--dwell", "1", "--speed-fraction", "0.9"]) == 0
    more = ["--label", "poses", "--runs", str(runs)]
    assert run(["record", "ir361", str(motion), *more]) == 0
    one = read_motion_run(find_runs(runs, ("poses",))[0], unfinished=False)
    rests = find_rests(one.data.recording).position
    assert len(rests) == 12
    arm = MeasuredArm.of(one.data.robot, np.array([0.765, 0.0, 0.0]), (1e8, 1e8, 1e8), 4)
    points = arm.points(rests, np.zeros(12))
    lines = [",".join(f"{value:.9f}" for value in point) for point in points]
    form.write_text("\n".join(("x_m,y_m,z_m", *lines)))
    capsys.readouterr()
    words = ["calibrate", "ir361", str(form), "--run", "poses", "--runs", str(runs), "--json"]
    assert run(words) == 0
    errors = document(capsys)["errors"]
    assert errors["before"]["mean_m"] > 1e-3
    assert errors["after"]["max_m"] < 2e-5
