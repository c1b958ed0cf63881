"""`rid-daq calibrate`: measured points correct a robot file; no robot file is replaced."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.motion_file import load_motion
from benchmarks.measured_arm import FRAME, MeasuredArm
from config.load import load_cell, load_robot, to_yaml
from dynamics.geometry.kinematics import Chain, forward
from identification.estimation.file import write_estimate
from identification.kinematics.calibration import probe_positions
from rid_daq.app import run
from tests.builders.json_output import document
from tests.builders.known_model import known_estimate

NOISE_M = 2e-5


@pytest.fixture(scope="module")
def arm() -> MeasuredArm:
    return MeasuredArm.of(load_robot("ir361"), np.array([0.765, 0.0, 0.0]), (5e4, 6e4, 2e4), 2)


@pytest.fixture(scope="module")
def folder(arm: MeasuredArm, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a nominal robot, and poses with measured points to fit and to check."""
    folder = tmp_path_factory.mktemp("calibrate")
    (folder / "robot.yaml").write_text(to_yaml(arm.robot))
    probes = probe_positions(arm.robot, 60)
    noise = NOISE_M * np.random.default_rng(7).normal(size=(60, 3))
    loads = np.where(np.arange(60) % 2, 8.0, 0.0)
    rows = np.column_stack([probes, 1e3 * (arm.points(probes, loads) + noise), loads])
    header = "axis1,axis2,axis3,x_mm,y_mm,z_mm,load_kg"
    for name, part in (("poses.csv", rows[:40]), ("check.csv", rows[40:])):
        lines = [",".join(f"{value:.6f}" for value in row) for row in part]
        (folder / name).write_text("\n".join((header, *lines, "")))
    return folder


def words(folder: Path, *more: object) -> list[str]:
    return ["calibrate", str(folder / "robot.yaml"), str(folder / "poses.csv"), *map(str, more)]


def test_the_corrected_robot_file_predicts_measured_points(
    arm: MeasuredArm, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = folder / "calibrated.yaml"
    assert run(words(folder, "--check", folder / "check.csv", "-o", output, "--json")) == 0
    told = document(capsys)
    assert told["rank"] == told["largest_rank"] == 15
    assert told["stiffness_not_shown"] == ["axis1"]
    assert told["errors"]["before"]["mean_m"] > 1e-3
    assert told["errors"]["after"]["mean_m"] < 3.0 * NOISE_M
    assert told["errors"]["geometry"]["mean_m"] > 3.0 * told["errors"]["after"]["mean_m"]
    stiffness = {each["joint"]: each for each in told["stiffness"]}
    for joint, true in zip(("axis2", "axis3"), 1.0 / arm.compliance[1:], strict=True):
        assert stiffness[joint]["stiffness"] == pytest.approx(true, rel=0.03)
        assert stiffness[joint]["is_precise"]
    corrected = load_robot(str(output))
    assert corrected.joints[1].stiffness_nm_rad == stiffness["axis2"]["stiffness"]
    changed = {each["key"] for each in told["changes"]}
    assert {"kinematics.calibration.1.theta_rad", "joints.1.stiffness_nm_rad"} < changed
    # The geometry alone, without the deflection: unloaded poses near the vertical bend little.
    pose = np.array([[0.4, 0.02, 1.5]])
    tool = {each["name"]: each["value"] for each in told["parameters"]}
    place = np.array([tool[f"base {axis}"] for axis in "xyz"])
    assert np.linalg.norm(place - FRAME.translation) < 3e-3
    measured = FRAME.inverse().act(arm.points(pose, np.zeros(1))[0])
    assert np.linalg.norm(forward(Chain.from_description(corrected), pose)[0] - measured) < 6e-3


def test_copied_rows_count_once(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Otherwise copies would narrow the intervals."""
    lines = (folder / "poses.csv").read_text().splitlines()
    copied = tmp_path / "poses.csv"
    copied.write_text("\n".join([*lines, *lines[1:]]))
    found = []
    for poses in (folder / "poses.csv", copied):
        assert run(["calibrate", str(folder / "robot.yaml"), str(poses), "--json"]) == 0
        found.append(document(capsys))
    assert found[1]["parameters"] == found[0]["parameters"]
    assert any("40" in note for note in found[1]["notes"])


@pytest.mark.parametrize("table", ["poses.csv", "check.csv"])
def test_a_contradicted_calibration_is_not_written(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], table: str
) -> None:
    """The point of one pose is 75 mm off."""
    paths = {name: folder / name for name in ("poses.csv", "check.csv")}
    lines = paths[table].read_text().splitlines()
    cells = lines[8].split(",")
    lines[8] = ",".join([*cells[:3], str(float(cells[3]) + 75.0), *cells[4:]])
    paths[table] = tmp_path / table
    paths[table].write_text("\n".join(lines))
    output = tmp_path / "calibrated.yaml"
    asked = ["calibrate", str(folder / "robot.yaml"), str(paths["poses.csv"]), "-o", str(output)]
    more = ["--check", str(paths["check.csv"])] if table == "check.csv" else []
    assert run([*asked, *more, "--json"]) == 1
    told = document(capsys)
    assert not told["holds"]
    assert any(table in note and "9" in note for note in told["notes"])
    assert not output.exists()
    assert run([*asked, *more]) == 1
    assert f"{table}:9" in capsys.readouterr().out


def test_a_robot_file_is_never_replaced(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = (folder / "robot.yaml").read_bytes()
    assert run(words(folder, "-o", folder / "robot.yaml", "--json")) == 2
    assert document(capsys)["error"]["code"] == "RID-OUTPUT-EXISTS"
    assert (folder / "robot.yaml").read_bytes() == before


def test_people_read_the_identifiable_set_and_the_errors(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words(folder)) == 0
    text = capsys.readouterr().out
    for part in ("15 of at most 15", "axis3 theta", "axis2 beta", "N m/rad", "axis1"):
        assert part in text


def test_a_robot_without_drawing_data_needs_a_model_for_its_gears(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    poses = str(folder / "poses.csv")
    assert run(["calibrate", "ir361", poses, "--json"]) == 0
    told = document(capsys)
    assert told["stiffness"] == []
    assert len(told["notes"]) == 2  # rigid gears; loads without effect
    model = tmp_path / "model.json"
    write_estimate(model, known_estimate(load_cell("ir361"), {}))
    assert run(["calibrate", "ir361", poses, "--model", str(model), "--json"]) == 0
    assert [each["joint"] for each in document(capsys)["stiffness"]] == ["axis2", "axis3"]


def test_too_few_poses_have_a_code(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    few = tmp_path / "few.csv"
    few.write_text("\n".join((folder / "poses.csv").read_text().splitlines()[:6]))
    assert run(["calibrate", str(folder / "robot.yaml"), str(few), "--json"]) == 6
    assert document(capsys)["error"]["code"] == "RID-KINEMATICS-FEW"


def test_proposed_poses_are_recorded_and_measured(
    arm: MeasuredArm, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot, poses = str(folder / "robot.yaml"), tmp_path / "form.csv"
    motions = [tmp_path / name for name in ("free.yaml", "loaded.yaml")]
    more = ["--count", "20", "--load", "8", "--motion", motions[0], "--loaded-motion", motions[1]]
    words = ["calibrate", "poses", robot, "-o", str(poses), *map(str, more), "--json"]
    assert run(words) == 0
    told = document(capsys)
    assert len(told["poses"]) == 20
    for motion in motions:
        assert len(load_motion(motion).plan(arm.robot, 0.004).whole().position) > 10 / 0.004
    # An empty form is refused; a filled one calibrates.
    assert run(["calibrate", robot, str(poses), "--json"]) == 2
    assert document(capsys)["error"]["code"] == "RID-TRACKER-ROW"
    position = np.array([each["position"] for each in told["poses"]])
    loads = np.array([each["load_kg"] for each in told["poses"]])
    measured = arm.points(np.round(position, 6), loads)
    lines = poses.read_text().splitlines()
    assert lines[0].startswith("pose,axis1,axis2,axis3,load_kg,x_m,y_m,z_m")
    filled = [lines[0]]
    for line, point in zip(lines[1:], measured, strict=True):
        places = ",".join(f"{value:.9f}" for value in point)
        filled.append(line.replace(",,,,", f",{places},", 1))
    poses.write_text("\n".join(filled))
    assert run(["calibrate", robot, str(poses), "--json"]) == 0
    assert document(capsys)["errors"]["after"]["max_m"] < 1e-4
    assert run(words) == 2
    assert document(capsys)["error"]["code"] == "RID-OUTPUT-EXISTS"
    assert run([*words, "--overwrite"]) == 2  # a filled table is never replaced
    assert document(capsys)["error"]["code"] == "RID-OUTPUT-FOREIGN"
    poses.unlink()
    assert run([*words, "--overwrite"]) == 0
    assert run([*words, "--overwrite"]) == 0


def test_a_check_with_rows_of_the_fit_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words(folder, "--check", folder / "poses.csv", "--json")) == 2
    error = document(capsys)["error"]
    assert error["code"] == "RID-OPTION-NO-EFFECT"
    assert "40" in error["message"]


def test_no_table_of_poses_is_written_if_a_motion_is_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    form, motion = tmp_path / "form.csv", tmp_path / "loaded.yaml"
    words = ["calibrate", "poses", str(folder / "robot.yaml"), "-o", str(form), "--count", "12"]
    assert run([*words, "--loaded-motion", str(motion), "--json"]) != 0  # no pose is loaded
    assert "error" in document(capsys)
    assert not form.exists()
