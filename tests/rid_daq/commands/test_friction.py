"""`rid-daq friction` on the lock-step simulated arm, whose friction is known."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.motion.kinds.constant_velocity import ConstantVelocityMotion, SpeedRuns
from acquisition.motion.kinds.fourier import FourierJoint
from acquisition.motion.kinds.reversed import ReversedMotion
from acquisition.motion.motion_file import load_motion
from acquisition.runs.folder import RunFolder
from config.load import load_cell, to_yaml
from rid_daq.app import run
from tests.builders.console_blocks import assert_shown

pytestmark = pytest.mark.slow

CELL = load_cell("ir361")
STEADY = ConstantVelocityMotion(
    kind="constant_velocity",
    robot="ir361",
    pose=(0.0, 0.0, 0.3),
    joints=(
        SpeedRuns(joint="axis1", low=-0.8, high=0.8, speeds=(0.03, 0.06, 0.1, 0.2, 0.6, 1.3)),
        SpeedRuns(joint="axis3", low=-1.0, high=2.0, speeds=(0.1, 0.3, 1.0)),
    ),
    longest_run_s=2.5,
)
THERE_AND_BACK = ReversedMotion(
    kind="reversed",
    robot="ir361",
    period_s=6.0,
    periods=2,
    ramp_s=2.0,
    joints=(
        FourierJoint(joint="axis1", sine=(0.7, 0.1), cosine=(0.0, 0.2)),
        FourierJoint(joint="axis2", offset=-0.2, sine=(0.3, 0.2), cosine=(0.4, 0.0)),
        FourierJoint(joint="axis3", offset=0.5, sine=(-0.4, 0.3), cosine=(0.6, 0.1)),
    ),
)


def true_friction(joint: int, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper bounds of the plant's friction [N m] at speeds [rad/s]."""
    assert CELL.plant is not None
    assert CELL.plant.unmodelled is not None
    axis, extra = CELL.plant.axes[joint], CELL.plant.unmodelled.axes[joint]
    fall = np.exp(-speed / extra.stribeck_velocity_rad_s)
    alone = axis.coulomb_nm + extra.stribeck_nm * fall + axis.viscous_nm_s * speed
    largest = CELL.robot.joints[joint].limits.torque / 4.0  # of the torques of these motions
    warm = 1.0 + 300.0 * extra.friction_drift_per_s
    return warm * alone, (alone + extra.load_friction * largest) * 1.01


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    # The bundled cell without its force plate, which does not measure friction.
    cell = folder / "arm.yaml"
    cell.write_text(to_yaml(CELL.config.model_copy(update={"plate": None, "name": "arm"})))
    for name, motion in (("steady", STEADY), ("reversed", THERE_AND_BACK)):
        path = folder / f"{name}.yaml"
        path.write_text(to_yaml(motion))
        assert run(["record", str(cell), str(path), "--label", name, "--runs", str(folder)]) == 0
    return folder


def friction_of(
    runs: Path, capsys: pytest.CaptureFixture[str], *words: str
) -> dict[str, dict[str, Any]]:
    capsys.readouterr()
    assert run(["friction", *words, "--runs", str(runs), "--json"]) == 0
    section = json.loads(capsys.readouterr().out)["friction"]
    return {joint["joint"]: joint for joint in section["joints"]}


def test_runs_at_constant_speed_give_the_plants_friction(
    runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    joints = friction_of(runs, capsys, "steady")
    assert set(joints) == {"axis1", "axis3"}
    for name, number in (("axis1", 0), ("axis3", 2)):
        curve = joints[name]["curve"]
        low, high = true_friction(number, np.array(curve["speed"]))
        spread = 3.0 * np.array(curve["odd_std"])
        assert (np.array(curve["odd"]) > low - spread).all()
        assert (np.array(curve["odd"]) < high + spread).all()


def test_the_friction_law_of_the_plant_is_selected(
    runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fits = friction_of(runs, capsys, "steady")["axis1"]["fits"]
    assert fits[0]["name"] == "Stribeck"
    values = {p["name"]: p["value"] for p in fits[0]["parameters"]}
    assert values["fc_axis1"] == pytest.approx(22.0, rel=0.03)
    assert values["fv_axis1"] == pytest.approx(25.0, rel=0.03)
    assert values["fs_axis1"] == pytest.approx(5.0, rel=0.3)
    assert values["vs_axis1"] == pytest.approx(0.04, rel=0.35)
    assert run(["friction", "steady", "--runs", str(runs)]) == 0
    output = capsys.readouterr().out
    assert_shown("friction", "rid-daq friction steady", output, same_numbers=False)


def test_a_path_in_both_directions_gives_the_plants_friction(
    runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    joints = friction_of(runs, capsys, "reversed")
    assert set(joints) == {"axis1", "axis2", "axis3"}
    for number, joint in enumerate(joints.values()):
        curve = joint["curve"]
        speed, odd = np.array(curve["speed"]), np.array(curve["odd"])
        low, high = true_friction(number, speed)
        fast = speed > 0.1
        spread = 3.0 * np.array(curve["odd_std"])
        assert (odd[fast] > (low - spread)[fast]).all()
        assert (odd[fast] < (high + spread)[fast]).all()
        assert curve["forward"] is None


@pytest.mark.usefixtures("drawn_reports")
def test_several_runs_are_evaluated_together_and_reported(
    runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert run(["friction", "steady", "reversed", "--runs", str(runs)]) == 0
    output = capsys.readouterr().out
    assert "axis2: " in output
    assert "in the robot file: friction: [coulomb, viscous, stribeck], stribeck_velocity:" in output
    report = Path(output.rsplit("Report: ", 1)[1].strip()).read_text()
    assert "Measured friction" in report
    assert 'id="friction-' in report


def test_friction_is_compared_with_a_model_file(
    runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = runs / "model.json"
    assert run(["identify", "reversed", "--runs", str(runs), "-o", str(model)]) == 0
    joints = friction_of(runs, capsys, "steady", "--model", str(model))
    assert " The model file is off by " in joints["axis1"]["sentence"]
    lines = joints["axis1"]["lines"]
    at = np.searchsorted(lines["speed"], 1.0)
    assert lines["torque"]["the model file"][at] == pytest.approx(47.0, rel=0.1)


def test_a_run_of_another_kind_of_motion_is_refused(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recorded = next(path for path in runs.glob("*/motion.yaml") if "reversed" in path.read_text())
    copy = tmp_path / recorded.parent.name
    shutil.copytree(recorded.parent, copy)
    RunFolder.open(copy).write("motion.yaml", to_yaml(THERE_AND_BACK.forward()).encode())
    assert run(["friction", str(copy)]) == 2
    error = capsys.readouterr().err
    assert "RID-FRICTION-RUNS" in error
    assert "fourier" in error


@pytest.mark.parametrize(
    ("kind", "more"),
    [
        ("constant-velocity", []),
        ("reversed", ["--method", "two-harmonic", "--tries", "3", "--periods", "2"]),
    ],
)
def test_design_writes_both_kinds_of_friction_motions(
    kind: str, more: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "motion.yaml"
    words = ["design", "ir361", "--kind", kind, "-o", str(out), *more]
    assert run(words) == 0
    output = capsys.readouterr().out
    assert f"Next: rid-daq record ir361 {out}" in output
    motion = load_motion(out)
    assert motion.kind == kind.replace("-", "_")
    samples = motion.plan(CELL.robot, CELL.config.cycle_time_s)
    assert f"Total duration {samples.duration_s:.0f} s" in output
    assert run(words) == 2  # the file exists


def test_the_friction_of_another_run_is_shown_beside(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert CELL.plant is not None
    weak = tuple(
        axis.model_copy(
            update={"coulomb_nm": 0.8 * axis.coulomb_nm, "viscous_nm_s": 0.8 * axis.viscous_nm_s}
        )
        for axis in CELL.plant.axes
    )
    (tmp_path / "plant.yaml").write_text(to_yaml(CELL.plant.model_copy(update={"axes": weak})))
    changed = {"plate": None, "name": "arm", "plant": str(tmp_path / "plant.yaml")}
    cell = tmp_path / "warm.yaml"
    cell.write_text(to_yaml(CELL.config.model_copy(update=changed)))
    motion = str(runs / "steady.yaml")
    assert run(["record", str(cell), motion, "--label", "warm", "--runs", str(runs)]) == 0
    alone = friction_of(runs, capsys, "steady")
    joints = friction_of(runs, capsys, "steady", "--against", "warm")
    for name, joint in joints.items():
        (beside,) = joint["beside"]
        assert beside["label"] == "warm"
        assert beside["curve"]["speed"] == joint["curve"]["speed"]
        assert -20.0 < beside["percent"] < -12.0  # Stribeck friction is not smaller
        assert joint["curve"] == alone[name]["curve"]
        assert alone[name].get("beside") is None
    assert run(["friction", "steady", "--against", "warm", "--runs", str(runs)]) == 0
    assert "warm" in capsys.readouterr().out
    assert run(["friction", "steady", "--against", "steady", "--runs", str(runs)]) == 2
    assert "RID-OPTION-NO-EFFECT" in capsys.readouterr().err
