"""`--payload`: commands that predict torques use the stated payload."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.runs.catalogue import find_run
from compensation.feedforward.file import LARGEST_FILE_BYTES, feedforward_content
from config.arrays import FloatArray
from config.formats.json_file import read_content
from config.load import load_cell
from dynamics.geometry.kinematics import flange_pose
from dynamics.model.robot_model import RobotModel
from dynamics.model.true_parameters import true_parameters
from identification.estimation.file import write_estimate
from identification.payload.body import parameters_to_parent
from identification.payload.file import write_payload
from identification.payload.verdict import PayloadCheck, PayloadResult
from rid_daq.app import run
from tests.builders.certified import estimate_of, write_payload_file
from tests.builders.identified_run import arm_in_motion, identified_run
from tests.builders.json_output import document
from tests.builders.known_body import link_parameters
from tests.builders.known_model import joint_path, with_payload_columns, write_path_files

CIRCLE = joint_path([0.0, 0.0, 0.0], [0.4, 0.3, -0.4], [0.0, 0.2, 0.3])
SHARE = 0.3  # of link 3: the payload of the recorded runs
LINK_3 = link_parameters(3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with models without and with payload, a payload, loops and a path."""
    folder = tmp_path_factory.mktemp("stated")
    write_path_files(folder, CIRCLE)
    return folder


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with runs without and with a payload, models, and the payload."""
    root = tmp_path_factory.mktemp("loaded")
    arm = arm_in_motion()
    model = identified_run(root / "runs", arm, "alone", 1)
    write_estimate(root / "model.json", model)
    identified_run(root / "runs", arm, "alone again", 2)
    identified_run(root / "runs", arm, "loaded", 3, **dict.fromkeys(LINK_3, 1.0 + SHARE))
    write_estimate(root / "both.json", with_payload_columns(model))
    write_payload_file(root / "payload.json", SHARE * last_link(arm.cell.robot.name))
    return root


def last_link(name: str) -> FloatArray:
    """Return the true parameters of the last link in the frame of the flange, shape (10,)."""
    cell = load_cell(name)
    assert cell.plant is not None
    model = RobotModel.from_description(cell.robot)
    values = dict(
        zip(model.parameter_names, true_parameters(model, cell.robot, cell.plant), strict=True)
    )
    at_link = np.array([values[name] for name in LINK_3])
    return np.array(
        np.linalg.solve(parameters_to_parent(flange_pose(cell.robot)), at_link), dtype=np.float64
    )


COMMANDS = {
    "retime": "retime ir361 {0}/path.yaml --model {0}/{1}.json -o {0}/out.yaml",
    "compensate": "compensate ir361 {0}/path.yaml --model {0}/{1}.json --loop {0}/loops.json"
    " -o {0}/out.json",
    "stream": "stream ir361 {0}/path.yaml --model {0}/{1}.json --loop {0}/loops.json"
    " --runs {0}/out",
    "record": "record ir361 {0}/path.yaml --model {0}/{1}.json --runs {0}/out",
    "design": "design ir361 --kind multisine --model {0}/{1}.json -o {0}/out.yaml",
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_model_with_a_payload_is_refused_without_a_statement(
    folder: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(COMMANDS[name].format(folder, "both").split()) == 2
    assert "RID-PAYLOAD-UNSTATED" in capsys.readouterr().err
    assert not [*folder.glob("out*")]


@pytest.mark.parametrize("name", COMMANDS)
def test_the_payload_of_a_model_that_has_none_is_refused(
    folder: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [*COMMANDS[name].format(folder, "alone").split(), "--payload", "model"]
    assert run(words) == 2
    assert "RID-PAYLOAD-UNSTATED" in capsys.readouterr().err
    assert not [*folder.glob("out*")]


@pytest.mark.parametrize("name", COMMANDS)
def test_two_payloads_are_refused(
    folder: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [*COMMANDS[name].format(folder, "alone").split(), "--payload", "none"]
    assert run([*words, "--payload", str(folder / "payload.json")]) == 2
    assert "RID-OPTION-EXCLUSIVE" in capsys.readouterr().err
    assert not [*folder.glob("out*")]


def feedforward(folder: Path, model: str, *words: str) -> FloatArray:
    out = folder / f"ff {model} {len(words)}.json"
    command_words = COMMANDS["compensate"].format(folder, model).split()[:-1]
    assert run([*command_words, str(out), "--overwrite", *words]) == 0
    return np.array(feedforward_content(read_content(out, LARGEST_FILE_BYTES), out).feedforward)


def test_the_feedforward_is_computed_for_robot_and_payload(folder: Path) -> None:
    by_file = feedforward(folder, "alone", "--payload", str(folder / "payload.json"))
    by_model = feedforward(folder, "both", "--payload", "model")
    np.testing.assert_allclose(by_file, by_model, rtol=1e-6, atol=1e-9)
    empty = feedforward(folder, "alone")
    np.testing.assert_allclose(feedforward(folder, "both", "--payload", "none"), empty, atol=1e-9)
    assert np.abs(by_file - empty).max() > 1e-3


def test_a_feedforward_file_names_its_payload(folder: Path) -> None:
    for payload, origin in (("none", "none"), (str(folder / "payload.json"), None)):
        feedforward(folder, "alone", "--payload", payload)
        out = folder / "ff alone 2.json"
        found = feedforward_content(read_content(out, LARGEST_FILE_BYTES), out).origin.payload
        assert found == origin or (origin is None and len(found) == 64)


def prediction_errors(
    runs: Path, capsys: pytest.CaptureFixture[str], *words: str
) -> tuple[int, list[float]]:
    code = run(["validate", *words, "--runs", str(runs / "runs"), "--json"])
    axes = document(capsys)["validation"]["axes"]
    return code, [axis["relative_error_percent"] for axis in axes]


def test_a_loaded_run_is_predicted_as_accurately_as_an_unloaded_one(
    runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, payload = str(runs / "model.json"), str(runs / "payload.json")
    alone = prediction_errors(runs, capsys, model, "alone again")
    loaded = prediction_errors(runs, capsys, model, "loaded", "--payload", payload)
    assert (alone[0], loaded[0]) == (0, 0)
    assert max(loaded[1]) < 1.2 * max(alone[1])
    assert max(prediction_errors(runs, capsys, model, "loaded")[1]) > 3.0 * max(loaded[1])


@pytest.mark.parametrize(
    "words", [("validate", "both.json", "loaded"), ("compare", "both.json", "alone")]
)
def test_validate_refuses_a_model_with_a_payload_that_is_not_stated(
    runs: Path, words: tuple[str, str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    command = [words[0], str(runs / words[1]), words[2], "--runs", str(runs / "runs")]
    assert run(command) == 2
    assert "RID-PAYLOAD-UNSTATED" in capsys.readouterr().err


def test_models_are_compared_on_a_loaded_run(
    runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["compare", str(runs / "model.json"), "alone again", "--on", "loaded", "--json"]
    words += ["--runs", str(runs / "runs")]
    percents = []
    for more in ([], ["--payload", str(runs / "payload.json")]):
        assert run([*words, *more]) in (0, 1)
        (prediction,) = document(capsys)["predictions"]
        percents.append(max(axis["first_percent"] for axis in prediction["axes"]))
    assert percents[0] > 3.0 * percents[1]


def test_the_identification_runs_of_the_payload_give_no_verdict(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_id = find_run(runs / "runs", "loaded").run_id
    estimate = estimate_of(load_cell("ir361"), (run_id,))
    file = tmp_path / "payload.json"
    write_payload(file, PayloadResult(estimate, (PayloadCheck("parameters", 10, "≥", 10),)))
    words = ["validate", str(runs / "model.json"), "loaded", "--payload", str(file)]
    assert run([*words, "--runs", str(runs / "runs")]) == 6
    assert "RID-VALIDATE-SAME-RUN" in capsys.readouterr().err
