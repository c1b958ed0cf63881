"""`rid-daq export`: files for other programs, and refused requests."""

from __future__ import annotations

import csv
import ctypes
import importlib.util
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yaml

from acquisition.motion.samples import Phase
from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from config.load import load_cell
from dynamics.model.robot_model import RobotModel, torque
from dynamics.model.true_parameters import true_parameters
from identification.consistency.closest_robot import find_closest
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.estimation.estimate import Estimate, predict
from identification.estimation.file import write_estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.model.options import ModelOptions
from rid_daq.app import run

CYCLE_S = 0.008


@pytest.fixture(scope="module")
def estimate() -> Estimate:
    """Return an estimate of the bundled arm from three noisy periods."""
    cell = load_cell("ir361")
    assert cell.plant is not None
    model = RobotModel.from_description(cell.robot)
    motion = design_two_harmonic(
        cell.robot, TwoHarmonicOptions(5.0, highest_harmonic=6, tries=20, periods=3), CYCLE_S
    )
    path = motion.trajectory(cell.robot, CYCLE_S)
    times = path.sample_times_s
    q, v, a = path.position(times), path.velocity(times), path.acceleration(times)
    tau = torque(model, q, v, a, true_parameters(model, cell.robot, cell.plant))
    rows = 3 * len(times)
    noise = np.random.default_rng(0).standard_normal((rows, 3))
    recording = Recording(
        joint_names=cell.robot.joint_names,
        time_s=np.arange(rows, dtype=np.float64) * CYCLE_S,
        position=np.tile(q, (3, 1)),
        torque_nm=np.tile(tau, (3, 1)) + noise,
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(rows),
        source="cell",
        sample_period_s=CYCLE_S,
        samples_per_period=len(times),
    )
    return fit_periodic(cell.robot, [average_periods(recording)]).estimate(run_ids=("made */ up",))


@pytest.fixture
def model_file(estimate: Estimate, tmp_path: Path) -> Path:
    write_estimate(tmp_path / "model.json", estimate)
    return tmp_path / "model.json"


@pytest.fixture
def motion() -> np.ndarray:
    return np.random.default_rng(2).uniform(-1.5, 1.5, (3, 30, 3))


def c_torques(source: Path, motion: np.ndarray) -> list[list[float]]:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    library = source.with_suffix(".so")
    strict = ["-std=c99", "-Wall", "-Werror", "-shared", "-fPIC"]
    subprocess.run([compiler, *strict, "-o", library, source, "-lm"], check=True)
    function = ctypes.CDLL(str(library)).ir361_inverse_dynamics
    out, tau = (ctypes.c_double * 3)(), []
    for sample in motion.transpose(1, 0, 2):
        function(*((ctypes.c_double * 3)(*row) for row in sample), out)
        tau.append(list(out))
    return tau


def python_torques(source: Path, motion: np.ndarray) -> np.ndarray:
    spec = importlib.util.spec_from_file_location("exported", source)
    assert spec is not None
    assert spec.loader is not None
    module: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.inverse_dynamics(*motion)


FUNCTIONS = [("c", "robot.c", c_torques), ("python", "robot.py", python_torques)]


@pytest.mark.parametrize(("form", "name", "torques"), FUNCTIONS)
def test_an_exported_function_as_identified_predicts_like_the_model_file(
    form: str,
    name: str,
    torques: Any,
    estimate: Estimate,
    model_file: Path,
    motion: np.ndarray,
    tmp_path: Path,
) -> None:
    out = tmp_path / name
    words = ["export", str(model_file), "--to", form, "-o", str(out), "--as-identified"]
    assert run(words) == 0
    np.testing.assert_allclose(
        torques(out, motion), predict(estimate, *motion), rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize(("form", "name", "torques"), FUNCTIONS)
def test_an_exported_function_uses_the_physically_consistent_parameters(
    form: str,
    name: str,
    torques: Any,
    estimate: Estimate,
    model_file: Path,
    motion: np.ndarray,
    tmp_path: Path,
) -> None:
    out = tmp_path / name
    assert run(["export", str(model_file), "--to", form, "-o", str(out)]) == 0
    q, v, a = motion
    expected = torque(estimate.model, q, v, a, find_closest(estimate).standard_values)
    np.testing.assert_allclose(torques(out, motion), expected, rtol=1e-9, atol=1e-9)


def test_pinocchio_reads_the_physically_consistent_links(
    estimate: Estimate, model_file: Path, motion: np.ndarray, tmp_path: Path
) -> None:
    out = tmp_path / "robot.urdf"
    assert run(["export", str(model_file), "--to", "urdf", "-o", str(out)]) == 0
    robot = pin.buildModelFromUrdf(str(out))
    tau = [pin.rnea(robot, robot.createData(), *x) for x in motion.transpose(1, 0, 2)]
    links = ModelOptions(rotors=False, friction=False, spring=False).build(estimate.robot)
    values = find_closest(estimate).standard_values[: len(links.parameter_names)]
    q, v, a = motion
    np.testing.assert_allclose(tau, torque(links, q, v, a, values), rtol=1e-9, atol=1e-9)


@pytest.mark.fault(33)
def test_an_inconsistent_model_is_exported_only_with_despite_misfit(
    estimate: Estimate,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
) -> None:
    # The inertia about axis 1 is much smaller than that of the same links about axis 2.
    values = np.array(estimate.values)
    values[estimate.base.names.index("Izz1")] = 2.0
    write_estimate(tmp_path / "model.json", replace(estimate, values=values))
    out = tmp_path / "robot.urdf"
    words = ["export", str(tmp_path / "model.json"), "--to", "urdf", "-o", str(out)]
    assert run(words) == 6
    assert "RID-MODEL-INCONSISTENT" in capsys.readouterr().err
    assert not out.exists()
    assert run([*words, "--despite-misfit"]) == 0
    assert "contradict every possible robot" in out.read_text().partition("<robot")[0]
    measured("exit code 6, no file written")


def test_despite_misfit_without_effect_is_refused(
    model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["export", str(model_file), "--to", "csv", "-o", str(tmp_path / "table.csv")]
    assert run([*words, "--as-identified", "--despite-misfit"]) == 2
    assert "RID-OPTION-NO-EFFECT" in capsys.readouterr().err


def test_a_robot_description_cannot_be_exported_as_identified(
    model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["export", str(model_file), "--to", "sdf", "-o", str(tmp_path / "x"), "--as-identified"]
    assert run(words) == 2
    assert "RID-EXPORT-LINKS" in capsys.readouterr().err


def test_tables_contain_the_parameters(
    estimate: Estimate, model_file: Path, tmp_path: Path
) -> None:
    for form in ("csv", "json"):
        out = tmp_path / f"table.{form}"
        assert run(["export", str(model_file), "--to", form, "-o", str(out)]) == 0
    with (tmp_path / "table.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["kind"] == "identified"]
    np.testing.assert_array_equal([float(row["value"]) for row in rows], estimate.values)
    document = json.loads((tmp_path / "table.json").read_text())
    assert document["runs"] == ["made */ up"]


def test_an_existing_file_is_not_overwritten(model_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "robot.py"
    out.write_text("mine")
    words = ["export", str(model_file), "--to", "python", "-o", str(out)]
    assert run(words) == 2
    assert out.read_text() == "mine"
    assert run([*words, "--overwrite"]) == 2, "the file is not an export of rid-daq"
    assert out.read_text() == "mine"
    out.unlink()
    assert run(words) == 0
    assert run(words) == 2
    assert run([*words, "--overwrite"]) == 0
    assert "inverse_dynamics" in out.read_text()
    model = model_file.read_bytes()
    assert run(["export", str(model_file), "--to", "c", "-o", str(model_file), "--overwrite"]) == 2
    assert model_file.read_bytes() == model


def test_a_file_that_is_not_a_model_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "no.json").write_text("{}")
    out = tmp_path / "robot.c"
    assert run(["export", str(tmp_path / "no.json"), "--to", "c", "-o", str(out)]) == 2
    assert "RID-FILE-VALUE" in capsys.readouterr().err
    assert not out.exists()


def test_a_users_urdf_is_updated(
    estimate: Estimate,
    model_file: Path,
    motion: np.ndarray,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    own, out = tmp_path / "own.urdf", tmp_path / "updated.urdf"
    assert run(["export", str(model_file), "--to", "urdf", "-o", str(own)]) == 0
    text = own.read_text()
    own.write_text(re.sub(r'<mass value="[^"]*"', '<mass value="9"', text[text.index("<robot") :]))
    words = ["export", str(model_file), "--to", "urdf", "--urdf", str(own), "-o", str(out)]
    assert run(words) == 0
    assert "written by rid-daq" in out.read_text().partition("</robot>")[2]
    robot, other = (pin.buildModelFromUrdf(str(path)) for path in (out, own))
    tau, wrong = (
        np.array([pin.rnea(each, each.createData(), *x) for x in motion.transpose(1, 0, 2)])
        for each in (robot, other)
    )
    links = ModelOptions(rotors=False, friction=False, spring=False).build(estimate.robot)
    values = find_closest(estimate).standard_values[: len(links.parameter_names)]
    difference = np.abs(tau - torque(links, motion[0], motion[1], motion[2], values))
    # Axis 2 has a spring: how much of the weight it carries follows from the nominal masses.
    assert difference[:, [0, 2]].max() < 0.1
    assert np.abs(tau - wrong)[:, [0, 2]].max() > 3.0
    assert run(words) == 2, "an existing file"
    assert run([*words, "--overwrite"]) == 0
    again = ["export", str(model_file), "--to", "urdf", "--urdf", str(out), "-o", "again.urdf"]
    assert run(again) == 2, "an updated file would drift"
    assert "RID-URDF-UPDATED" in capsys.readouterr().err


def test_the_result_of_an_update_has_numbers(
    estimate: Estimate, model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own, out = tmp_path / "own.urdf", tmp_path / "updated.urdf"
    assert run(["export", str(model_file), "--to", "urdf", "-o", str(own)]) == 0
    capsys.readouterr()
    words = ["export", str(model_file), "--to", "urdf", "--urdf", str(own), "-o", str(out)]
    assert run([*words, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    changes = result["urdf"]
    assert [link["name"] for link in changes["links"]] == ["link1", "link2", "link3"]
    assert [joint["name"] for joint in changes["joints"]] == list(estimate.robot.joint_names)
    base = estimate.base
    rigid = [text for text, is_one in zip(base.expressions, base.rigid_body, strict=True) if is_one]
    assert [each["expression"] for each in changes["combinations"]] == rigid
    for joint in (0, 2):  # joint 2 has a spring, which a URDF cannot express
        torques = result["torques"][joint]
        assert torques["difference_rms"] < 0.1 * torques["difference_without_armature_rms"]


@pytest.mark.parametrize(
    ("extra", "code"),
    [
        (["--to", "sdf", "--urdf", "own.urdf"], "RID-OPTION-NO-EFFECT"),
        (["--to", "urdf", "--tip", "tool"], "RID-REQUEST-INVALID"),
        (["--to", "urdf", "--urdf", "missing.urdf"], "RID-FILE-READ"),
    ],
)
def test_options_of_an_update_are_checked(
    extra: list[str],
    code: str,
    model_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["export", str(model_file), "-o", f"out.{extra[1]}", *extra]) == 2
    assert code in capsys.readouterr().err


def test_a_fixed_link_that_does_not_fit_into_the_measured_body_is_refused(
    model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own, out = tmp_path / "own.urdf", tmp_path / "updated.urdf"
    assert run(["export", str(model_file), "--to", "urdf", "-o", str(own)]) == 0
    heavy = (
        '<link name="anvil"><inertial><mass value="900"/><inertia ixx="9" ixy="0" ixz="0"'
        ' iyy="9" iyz="0" izz="9"/></inertial></link><joint name="bolt" type="fixed">'
        '<origin xyz="1 0 0"/><parent link="link3"/><child link="anvil"/></joint></robot>'
    )
    own.write_text(own.read_text().replace("</robot>", heavy))
    words = ["export", str(model_file), "--to", "urdf", "--urdf", str(own), "-o", str(out)]
    assert run(words) == 6
    refused = capsys.readouterr().err
    assert "RID-EXPORT-FIXED-LINKS" in refused
    assert "anvil" in refused
    assert not out.exists()


def test_parameters_of_the_kdl_solver_name_the_chain_of_a_urdf(
    estimate: Estimate, model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own, out = tmp_path / "own.urdf", tmp_path / "kdl.yaml"
    assert run(["export", str(model_file), "--to", "urdf", "-o", str(own)]) == 0
    words = ["export", str(model_file), "--to", "kdl", "-o", str(out)]
    assert run(words) == 2
    assert "RID-OPTION-NEEDS" in capsys.readouterr().err
    # A cover that is fixed to link 2 is not on the chain from base to tool.
    cover = (
        '<link name="cover"><inertial><mass value="15"/><inertia ixx="0.01" ixy="0" ixz="0"'
        ' iyy="0.01" iyz="0" izz="0.01"/></inertial></link><joint name="bolt" type="fixed">'
        '<origin xyz="0.2 0.5 0"/><parent link="link2"/><child link="cover"/></joint></robot>'
    )
    own.write_text(own.read_text().replace("</robot>", cover))
    capsys.readouterr()
    assert run([*words, "--urdf", str(own), "--json"]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert sum("σ" in note for note in notes) == 1, "the cover is not part of the identified robot"
    update = ["export", str(model_file), "--to", "urdf", "--urdf", str(own)]
    assert run([*update, "-o", str(tmp_path / "new.urdf")]) == 0
    capsys.readouterr()
    assert run([*words, "--urdf", str(tmp_path / "new.urdf"), "--overwrite", "--json"]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert not any("σ" in note for note in notes)
    parameters = yaml.safe_load(out.read_text())["/**"]["ros__parameters"]
    assert parameters["inverse_dynamics_solver_plugin_name"] == (
        "kdl_inverse_dynamics_solver/InverseDynamicsSolverKDL"
    )
    assert parameters["kdl"]["root"] == "base"
    assert parameters["kdl"]["tip"] == "tool"
    assert parameters["kdl"]["gravity"] == pytest.approx(estimate.robot.gravity_m_s2)
    assert "cover (15 kg)" in out.read_text()
