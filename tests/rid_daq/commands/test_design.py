"""`rid-daq design`: the motion file, its description on the terminal, and refused requests."""

from __future__ import annotations

import json
import os
import pty
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.motion_file import load_motion
from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from dynamics.model.robot_model import torque
from identification.design.criteria import Condition, DOptimal, Goals
from identification.design.problem import ExcitationProblem
from identification.design.search import refine_start
from identification.design.task import criterion_of_options, excitation_problem
from identification.design.verification import check_motion
from identification.estimation.estimate import Estimate
from identification.estimation.file import write_estimate
from rid_daq.app import run
from tests.builders.json_output import document
from tests.builders.known_model import known_estimate
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    return load_cell("ir361")


def problem(
    cell: LoadedCell, model: Estimate | None = None, given: Sequence[Estimate] = ()
) -> ExcitationProblem:
    """Return the optimisation problem for a motion of 10 s and three harmonics."""
    return excitation_problem(
        cell.config,
        cell.robot,
        period_s=10.0,
        harmonics=3,
        criterion=DOptimal(),
        model=model,
        given=given,
    )


def run_design(capsys: pytest.CaptureFixture[str], output: Path, *words: str) -> dict[str, Any]:
    assert run(["design", "ir361", "-o", str(output), "--starts", "2", "--json", *words]) == 0
    return document(capsys)


def test_design_writes_a_motion_within_all_limits(
    cell: LoadedCell, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "motion.yaml"
    document = run_design(capsys, path, "--criterion", "condition")
    motion = load_motion(path)
    assert isinstance(motion, FourierMotion)
    motion.plan(cell.robot, cell.config.cycle_time_s)
    assert document["condition_number"] < 40.0
    assert [trial["seed"] for trial in document["trials"]] in ([0, 1], [1, 0])
    assert list(document["trials"][0]) == ["elapsed_s", "seed", "worth", "broken"]
    assert all(use["held"] for use in document["limits"])
    assert any(use["active"] for use in document["limits"])
    assert "2 random first guesses (--seed 0" in path.read_text()


def test_equal_seeds_and_starts_give_equal_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, again, other = (tmp_path / f"{name}.yaml" for name in "abc")
    run_design(capsys, first)
    run_design(capsys, again)
    run_design(capsys, other, "--seed", "1")
    assert first.read_bytes() == again.read_bytes()
    assert first.read_bytes() != other.read_bytes()


def test_the_output_names_active_limits_and_unchecked_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["design", "ir361", "-o", str(tmp_path / "m.yaml"), "--starts", "1"]) == 0
    output = capsys.readouterr().out
    assert "log determinant" in output
    assert "Active limits: " in output
    assert "Torque is not checked" in output
    assert "Collisions are not checked" in output


def test_a_model_limits_the_torques_and_a_plane_the_workspace(
    cell: LoadedCell, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "workshop"
    assert run(["init", str(folder)]) == 0
    with (folder / "cell.yaml").open("a") as file:
        file.write(
            "workspace:\n  planes:\n"
            "    - {name: the wall, normal: [-1.0, 0.0, 0.0], offset_m: -0.9}\n"
        )
    model = tmp_path / "model.json"
    write_estimate(model, known_estimate(load_cell(str(folder / "cell.yaml")), {}))
    capsys.readouterr()
    words = ["design", str(folder / "cell.yaml"), "-o", str(tmp_path / "m.yaml"), "--starts", "2"]
    assert run([*words, "--model", str(model), "--json"]) == 0
    uses = {use["what"]: use for use in json.loads(capsys.readouterr().out)["limits"]}
    assert uses["distance between the wall and the tool point"]["used"] >= 0.02
    motion = load_motion(tmp_path / "m.yaml")
    path = motion.plan(cell.robot, cell.config.cycle_time_s)
    estimate = known_estimate(cell, {})
    parameters = np.zeros(len(estimate.base.standard_names))
    parameters[list(estimate.base.kept)] = estimate.values
    tau = torque(estimate.model, path.position, path.velocity, path.acceleration, parameters)
    blocked = tmp_path / "blocked.yaml"
    freely = ["design", "ir361", "-o", str(blocked), "--method", "two-harmonic", "--tries", "5"]
    assert run(freely) == 0
    words = ["record", str(folder / "cell.yaml"), str(blocked), "--runs", str(tmp_path / "runs")]
    blocked.write_text(blocked.read_text().replace("robot: ir361", f"robot: {motion.robot}"))
    capsys.readouterr()
    assert run(words) == 3
    message = capsys.readouterr().err
    assert "RID-MOTION-COLLISION" in message
    assert "wall" in message
    quoted = [uses[f"torque of {name}"]["used"] for name in cell.robot.joint_names]
    np.testing.assert_allclose(quoted, np.abs(tau).max(axis=0), rtol=0.02)


@pytest.mark.parametrize(
    ("name", "expected", "kind"),
    [("condition", [], Condition), ("d-optimal", [], DOptimal), ("d-optimal", ["torque"], Goals)],
)
def test_options_select_the_criterion(
    cell: LoadedCell, name: str, expected: list[str], kind: type
) -> None:
    assert isinstance(criterion_of_options(cell.robot, name, expected), kind)


def test_a_wanted_parameter_that_is_named_twice_is_refused(cell: LoadedCell) -> None:
    with raises_code(ConfigError, "RID-OPTION-EXCLUSIVE"):
        criterion_of_options(cell.robot, "d-optimal", ["torque", "torque"])


def test_earlier_runs_direct_the_design_to_uncertain_parameters(cell: LoadedCell) -> None:
    weak = {"Ixz3": 100.0, "Iyz3": 100.0}
    earlier = known_estimate(cell, weak)
    cycle_s = cell.config.cycle_time_s
    alone = problem(cell, model=earlier)
    next_one = problem(cell, model=earlier, given=[earlier])
    for criterion in (DOptimal(), criterion_of_options(cell.robot, "d-optimal", list(weak))):
        judge = replace(next_one, criterion=criterion)
        served, plain = (
            min(
                check_motion(judge, refine_start(task, seed, cycle_s).motion, cycle_s).objective
                for seed in range(8)
            )
            for task in (judge, alone)
        )
        assert served < plain - 0.01


def test_information_about_friction_is_not_used_from_earlier_runs(cell: LoadedCell) -> None:
    earlier = known_estimate(cell, {})
    task = problem(cell, given=[earlier, earlier])
    assert task.given is not None
    names = task.base.names
    friction = [k for k, name in enumerate(names) if name.startswith(("fc_", "fv_"))]
    rest = [k for k in range(len(names)) if k not in friction]
    assert not task.given[friction].any()
    # Two equal estimates have twice the information; 600 equations of 3 joints are 200 samples.
    known_twice = 2.0 / np.diagonal(earlier.covariance_residual)[rest] / 200.0
    np.testing.assert_allclose(np.diagonal(task.given)[rest], known_twice)


@pytest.mark.parametrize("run_ids", [(), ("01A", "01B")])
def test_a_run_in_two_given_models_is_refused(
    cell: LoadedCell, tmp_path: Path, capsys: pytest.CaptureFixture[str], run_ids: tuple[str, ...]
) -> None:
    """Its information would count twice, also in a model that has another run besides."""
    one = replace(known_estimate(cell, {}), run_ids=run_ids)
    other = replace(one, values=1.1 * one.values if run_ids else one.values, run_ids=run_ids[1:])
    files = [tmp_path / "one.json", tmp_path / "other.json"]
    for file, estimate in zip(files, (one, other), strict=True):
        write_estimate(file, estimate)
    words = ["design", "ir361", "-o", str(tmp_path / "m.yaml"), "--starts", "1"]
    given = [word for file in files for word in ("--given", str(file))]
    assert run([*words, *given]) == 2
    assert "RID-OPTION-EXCLUSIVE" in capsys.readouterr().err


def test_a_model_of_another_robot_is_refused(cell: LoadedCell) -> None:
    ours = known_estimate(cell, {})
    joint = ours.robot.joints[0].model_copy(update={"name": "other"})
    robot = ours.robot.model_copy(update={"joints": (joint, *ours.robot.joints[1:])})
    with raises_code(ConfigError, "RID-ROBOT-OTHER"):
        problem(cell, model=replace(ours, robot=robot))


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ("--for m7", 2, "--for m7: "),
        ("--for=", 2, "--for: ''"),
        ("--for sx3,,Izz1", 2, "--for: 'sx3,,Izz1'"),
        ("--for sx3,Izz1,sx3", 2, "--for sx3: "),
        ("--period 9.999", 2, "whole number of cycles"),
        ("--harmonics 40 --period 0.24", 2, "above half the sampling frequency"),
        ("--harmonics 400", 2, "--harmonics"),
        ("--given nowhere.json", 2, "nowhere.json"),
        ("--scheduler tcp://127.0.0.1:9", 2, "no Dask scheduler responds"),
    ],
)
def test_invalid_options_are_refused_at_once(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: str,
    code: int,
    message: str,
) -> None:
    monkeypatch.setattr("identification.design.search.SCHEDULER_TIMEOUT_S", 0.5)
    output = tmp_path / "m.yaml"
    assert run(["design", "ir361", "-o", str(output), *words.split()]) == code
    assert message in capsys.readouterr().err
    assert not output.exists()


def test_ctrl_c_writes_the_best_motion_with_exit_code_130(tmp_path: Path) -> None:
    output = tmp_path / "m.yaml"
    words = ["-m", "rid_daq", "design", "ir361", "-o", str(output), "--starts", "100000"]
    process, terminal = pty.fork()
    if process == 0:
        os.execv(sys.executable, [sys.executable, *words])
    screen_text = b""
    until_s = time.monotonic() + 120.0
    pressed = False
    while time.monotonic() < until_s:
        try:
            screen_text += os.read(terminal, 65536)
        except OSError:
            break  # the program has closed its terminal
        if b"best log determinant" in screen_text and not pressed:
            pressed = True
            os.write(terminal, b"\x03")
    else:
        os.kill(process, signal.SIGKILL)
    _, status = os.waitpid(process, 0)
    assert os.waitstatus_to_exitcode(status) == 130
    assert b"The search was interrupted: this is the best motion found so far." in screen_text
    assert b"Traceback" not in screen_text
    assert isinstance(load_motion(output), FourierMotion)
