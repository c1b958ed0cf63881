"""`rid-daq compare`: two estimates of one robot, and of a robot whose friction has changed."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.runs.folder import RunFolder
from config.errors import EstimationError
from config.load import load_robot
from identification.estimation.estimate import Estimate
from identification.estimation.file import write_estimate
from identification.export.model import ExportModel
from identification.validation.estimate_difference import compare_estimates
from rid_daq.app import run
from tests.builders.identified_run import arm_in_motion, identified_run
from tests.builders.json_output import document
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow


Measure = Callable[..., Estimate]


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("compare") / "runs"


@pytest.fixture(scope="module")
def measure(root: Path) -> Measure:
    """Return a function that writes a computed run of the bundled arm, and its estimate."""
    return functools.partial(identified_run, root, arm_in_motion())


@pytest.fixture(scope="module")
def monday(measure: Measure) -> Estimate:
    return measure("monday", 1)


@pytest.fixture(scope="module")
def tuesday(measure: Measure) -> Estimate:
    return measure("tuesday", 2)


@pytest.fixture(scope="module")
def arm_with_more_friction(measure: Measure) -> Estimate:
    """Return the estimate of the arm with 20 % more Coulomb friction in axis2."""
    return measure("dry", 3, fc_axis2=1.2)


def test_differences_are_divided_by_the_standard_deviation_of_the_difference(
    monday: Estimate, tuesday: Estimate
) -> None:
    difference = compare_estimates(monday, tuesday)
    assert difference.names == monday.base.names
    i = difference.names.index("fc_axis2")
    expected = (tuesday.values[i] - monday.values[i]) / math.hypot(
        monday.sigma[i], tuesday.sigma[i]
    )
    assert difference.sigmas[i] == pytest.approx(expected)
    assert difference.limit_sigmas == pytest.approx(3.5, abs=0.2)
    assert difference.agree
    assert difference.shared_runs == ()


def test_a_joint_with_more_friction_is_named(
    monday: Estimate, arm_with_more_friction: Estimate
) -> None:
    difference = compare_estimates(monday, arm_with_more_friction)
    assert not difference.agree
    assert difference.names[difference.worst] == "fc_axis2"


def test_base_parameters_with_different_expressions_are_not_compared(
    monday: Estimate, tuesday: Estimate
) -> None:
    words = ("something else", *tuesday.base.expressions[1:])
    other = replace(tuesday, base=replace(tuesday.base, expressions=words))
    difference = compare_estimates(monday, other)
    assert difference.only_first == difference.only_second == (monday.base.names[0],)
    assert monday.base.names[0] not in difference.names


def test_another_robot_is_refused(monday: Estimate) -> None:
    robot = load_robot("kr15")
    stranger = object.__new__(Estimate)
    object.__setattr__(stranger, "robot", robot)
    with raises_code(EstimationError, "RID-ROBOT-OTHER"):
        compare_estimates(monday, stranger)


def test_a_robot_with_the_same_joints_but_another_name_is_refused(monday: Estimate) -> None:
    renamed = monday.robot.model_copy(update={"name": "another_arm"})
    with raises_code(EstimationError, "RID-ROBOT-OTHER", "another_arm"):
        compare_estimates(monday, replace(monday, robot=renamed))


@pytest.mark.usefixtures("monday")
@pytest.mark.parametrize("on", [[], ["--on", "monday"]])
def test_a_run_is_not_predicted_with_a_model_of_another_robot(
    root: Path,
    monday: Estimate,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    on: list[str],
) -> None:
    """The joints have the same names, but the robot files differ."""
    turned = monday.robot.model_copy(update={"gravity_m_s2": (0.0, 0.0, -9.81)})
    write_estimate(tmp_path / "other.json", replace(monday, robot=turned))
    models = [str(tmp_path / "other.json")] * 2 if on else ["monday", str(tmp_path / "other.json")]
    assert run(["compare", *models, *on, "--runs", str(root)]) == 2
    error = capsys.readouterr().err
    assert "RID-ROBOT-OTHER" in error
    assert "gravity_m_s2" in error


@pytest.mark.usefixtures("monday", "tuesday")
def test_compare_predicts_both_runs_with_both_models(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["compare", "monday", "tuesday", "--runs", str(root), "--json"]) == 0
    result = document(capsys)
    assert result["verdict"]["passed"] is True
    assert [each["label"] for each in result["predictions"]] == ["monday", "tuesday"]
    first = result["predictions"][0]
    assert (first["first_has_seen_it"], first["second_has_seen_it"]) == (True, False)
    for axis in first["axes"]:
        assert axis["second_percent"] == pytest.approx(axis["first_percent"], rel=0.05)


@pytest.mark.usefixtures("monday", "arm_with_more_friction")
def test_a_change_gives_an_exit_code_and_a_sentence(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["compare", "monday", "dry", "--runs", str(root), "--on", "dry"]) == 1
    output = capsys.readouterr().out
    assert "differ: fc_axis2 by" in output
    assert output.count("Torque errors on run") == 1
    assert "by dry (identified from this run) [%]" in output


@pytest.mark.usefixtures("monday")
def test_models_of_the_same_run_are_noted_as_not_independent(
    root: Path, monday: Estimate, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_estimate(tmp_path / "copy.json", monday)
    words = ["compare", "monday", str(tmp_path / "copy.json"), "--runs", str(root)]
    assert run(words) == 0
    assert "equal parameters prove nothing" in capsys.readouterr().out


@pytest.mark.usefixtures("monday")
def test_a_model_of_links_behind_elastic_gears_is_noted(
    root: Path, monday: Estimate, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    joints = tuple(
        joint.model_copy(update={"stiffness_nm_rad": 2e4}) for joint in monday.robot.joints
    )
    robot = monday.robot.model_copy(update={"joints": joints})
    links = replace(monday, robot=robot, gear_torque_nm=np.array([0.5, 1.25, 0.25]))
    write_estimate(tmp_path / "links.json", links)
    words = ["compare", "monday", str(tmp_path / "links.json"), "--runs", str(root), "--json"]
    assert run(words) == 0
    result = document(capsys)
    (note,) = result["notes"]
    assert "links.json" in note
    assert "axis2 1.2 N m" in note
    axes = result["predictions"][0]["axes"]
    # The model of the links is wrong for this arm, whose gears are rigid.
    assert all(axis["second_percent"] > 1.1 * axis["first_percent"] for axis in axes)
    origin = ExportModel.from_estimate(links).origin
    assert len(origin) == len(ExportModel.from_estimate(monday).origin) + 1


@pytest.mark.usefixtures("monday")
def test_a_run_without_a_model_and_an_unknown_run_are_refused(
    root: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    RunFolder.create(root, "raw")
    for words, message in (
        (["monday", "raw"], "identify it first"),
        (["monday", "nobody"], "no run 'nobody'"),
        ([str(tmp_path / "missing.json"), "monday"], "the file does not exist, and no run"),
    ):
        assert run(["compare", *words, "--runs", str(root)]) == 2
        assert message in capsys.readouterr().err
