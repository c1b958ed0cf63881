"""`rid-daq compare`: two estimates of one robot, and of one that has changed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import JournalWriter, read_journal
from acquisition.journal.header import JournalHeader
from acquisition.motion.samples import Phase
from acquisition.processing.periods import average_periods
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.errors import EstimationError
from config.load import load_cell, load_robot
from dynamics.model.robot_model import RobotModel, torque
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.estimation.estimate import Estimate
from identification.estimation.estimators import estimate_periodic
from identification.estimation.file import write_estimate
from identification.validation.estimate_difference import compare_estimates
from rid_daq.app import run
from rid_daq.jobs.truth import true_parameters
from tests.builders.told import document

pytestmark = pytest.mark.slow

CYCLE_S = 0.008
PERIODS = 4

Measure = Callable[..., Estimate]


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("compare") / "runs"


@pytest.fixture(scope="module")
def measure(root: Path) -> Measure:
    """Return what records the bundled arm into a run folder, with its estimate."""
    cell = load_cell("ir361")
    model = RobotModel.from_description(cell.robot)
    motion = design_two_harmonic(
        cell.robot, TwoHarmonicOptions(5.0, highest_harmonic=6, tries=20, periods=PERIODS), CYCLE_S
    )
    path = motion.trajectory(cell.robot, CYCLE_S)
    times = path.sample_times_s
    q, v, a = path.position(times), path.velocity(times), path.acceleration(times)
    assert cell.plant is not None
    truth = true_parameters(model, cell.robot, cell.plant)

    def record(label: str, seed: int, **changes: float) -> Estimate:
        parameters = np.array(truth)
        for name, factor in changes.items():
            parameters[model.parameter_names.index(name)] *= factor
        count = PERIODS * len(times)
        noise = np.random.default_rng(seed).standard_normal((count, 3))
        rows = np.zeros(count, dtype=row_dtype(3))
        rows["time_s"] = np.arange(count) * CYCLE_S
        rows["cycle"] = rows["sample_index"] = np.arange(count)
        rows["position"] = np.tile(q, (PERIODS, 1))
        rows["torque_nm"] = np.tile(torque(model, q, v, a, parameters), (PERIODS, 1)) + noise
        rows["valid"], rows["phase"] = 1, Phase.MAIN
        folder = RunFolder.create(root, label)
        for name, content in cell.files.items():
            folder.write(name, content)
        header = JournalHeader(
            joint_names=cell.robot.joint_names,
            sample_period_s=CYCLE_S,
            samples_per_period=len(times),
            run_id=folder.run_id,
        )
        with JournalWriter(folder.file("recording.mcap"), header) as writer:
            writer.append(rows.tobytes())
        recording = read_journal(folder.file("recording.mcap")).recording()
        estimate = estimate_periodic(
            cell.robot, [average_periods(recording)], run_ids=(folder.run_id,)
        )
        write_estimate(folder.path / "model.json", estimate)
        folder.finish(RunStatus.COMPLETE)
        return estimate

    return record


@pytest.fixture(scope="module")
def monday(measure: Measure) -> Estimate:
    return measure("monday", 1)


@pytest.fixture(scope="module")
def tuesday(measure: Measure) -> Estimate:
    return measure("tuesday", 2)


@pytest.fixture(scope="module")
def dry(measure: Measure) -> Estimate:
    """The arm with a joint that rubs 20 % more."""
    return measure("dry", 3, fc_axis2=1.2)


def test_differences_are_told_in_sigmas_of_the_difference(
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


def test_a_joint_that_rubs_more_is_found_and_named(monday: Estimate, dry: Estimate) -> None:
    difference = compare_estimates(monday, dry)
    assert not difference.agree
    assert difference.names[difference.worst] == "fc_axis2"


def test_another_combination_is_another_parameter(monday: Estimate, tuesday: Estimate) -> None:
    words = ("something else", *tuesday.base.expressions[1:])
    other = replace(tuesday, base=replace(tuesday.base, expressions=words))
    difference = compare_estimates(monday, other)
    assert difference.only_first == difference.only_second == (monday.base.names[0],)
    assert monday.base.names[0] not in difference.names


def test_another_robot_is_refused(monday: Estimate) -> None:
    robot = load_robot("kr15")
    stranger = object.__new__(Estimate)
    object.__setattr__(stranger, "robot", robot)
    with pytest.raises(EstimationError, match="these are two robots"):
        compare_estimates(monday, stranger)


@pytest.mark.usefixtures("monday", "tuesday")
def test_two_runs_side_by_side(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", "monday", "tuesday", "--runs", str(root), "--json"]) == 0
    told = document(capsys)
    assert told["verdict"]["passed"] is True
    assert [each["label"] for each in told["predictions"]] == ["monday", "tuesday"]
    first = told["predictions"][0]
    assert (first["first_has_seen_it"], first["second_has_seen_it"]) == (True, False)
    for axis in first["axes"]:
        assert axis["second_percent"] == pytest.approx(axis["first_percent"], rel=0.05)


@pytest.mark.usefixtures("monday", "dry")
def test_a_change_is_an_exit_code_and_a_sentence(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["compare", "monday", "dry", "--runs", str(root), "--on", "dry"]) == 1
    said = capsys.readouterr().out
    assert "They differ: fc_axis2 by" in said
    assert said.count("Torque errors on run") == 1
    assert "by dry [%] (identified from it)" in said


@pytest.mark.usefixtures("monday")
def test_models_of_the_same_run_prove_nothing(
    root: Path, monday: Estimate, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_estimate(tmp_path / "copy.json", monday)
    words = ["compare", "monday", str(tmp_path / "copy.json"), "--runs", str(root)]
    assert run(words) == 0
    assert "equal parameters prove nothing" in capsys.readouterr().out


@pytest.mark.usefixtures("monday")
def test_what_cannot_be_compared_is_told(
    root: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    RunFolder.create(root, "raw")
    for words, said in (
        (["monday", "raw"], "identify it first"),
        (["monday", "nobody"], "no run 'nobody'"),
        ([str(tmp_path / "missing.json"), "monday"], "cannot be read"),
    ):
        assert run(["compare", *words, "--runs", str(root)]) == 2
        assert said in capsys.readouterr().err
