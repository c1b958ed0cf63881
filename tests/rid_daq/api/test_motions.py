"""Motions from Python: design, points, retiming, compensation and plots."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from compensation.loops.loop_file import write_loops
from compensation.loops.velocity_loop import VelocityLoop
from config.errors import ConfigError, DataQualityError, EstimationError, LimitError
from config.formats.yaml_tree import dump_yaml as to_yaml_text
from config.load import load_cell
from rid_daq.api import (
    Model,
    Motion,
    Payload,
    Recording,
    compensate,
    design,
    plot,
    retime,
    validate,
)
from rid_daq.report.sections.estimate import EstimateSection
from tests.builders.certified import MEDIUM, write_payload_file
from tests.builders.known_model import known_estimate, with_payload_columns
from tests.builders.raised_codes import raises_code
from tests.rid_daq.api.conftest import Arm

QUICK = {"excitation": {"method": "two-harmonic", "tries": 4}}
POSES = [[0.0, -0.3, 0.4], [0.4, 0.0, 0.2], [0.6, -0.2, 0.6]]


@pytest.fixture(scope="module")
def path() -> Motion:
    return Motion.through(POSES, cell="ir361", speed_fraction=0.3)


def test_an_excitation_of_a_robot_keeps_its_limits_and_is_saved(arm: Arm, tmp_path: Path) -> None:
    motion = design(arm.robot, period_s=4.0, periods=2, options=QUICK)
    limits = [joint.limits for joint in arm.robot.description.joints]
    assert motion.position.shape == motion.velocity.shape == (len(motion.time_s), 3)
    assert np.all(np.abs(motion.velocity).max(axis=0) <= [each.velocity for each in limits])
    shown = [line.split()[0] for line in str(motion).splitlines()[2:5]]
    assert shown == list(arm.robot.joint_names)
    motion.save(tmp_path / "motion.yaml")
    again = Motion.load(tmp_path / "motion.yaml", cell=arm.robot)
    np.testing.assert_array_equal(again.position, motion.position)
    with raises_code(ConfigError, "RID-OUTPUT-EXISTS"):
        motion.save(tmp_path / "motion.yaml")


def test_a_planned_trajectory_is_loaded_like_a_motion(tmp_path: Path) -> None:
    u = np.linspace(0.0, 1.0, 9)[:, None]
    q = POSES[0] + np.subtract(POSES[2], POSES[0]) * (10 * u**3 - 15 * u**4 + 6 * u**5)
    points = [
        {"positions": row, "time_from_start": {"secs": second, "nsecs": 0}}
        for second, row in enumerate(q.tolist())
    ]
    names = ["axis1", "axis2", "axis3"]
    message = {"joint_trajectory": {"joint_names": names, "points": points}}
    table = [",".join(map(str, [second, *row])) for second, row in enumerate(q.tolist())]
    files = {
        "plan.json": json.dumps(message),
        "plan.yaml": to_yaml_text(message),
        "plan.csv": "\n".join([",".join(["time_s", *names]), *table, ""]),
    }
    for name, content in files.items():
        (tmp_path / name).write_text(content)
        motion = Motion.load(tmp_path / name, cell="ir361")
        np.testing.assert_allclose(motion.position[[0, -1]], [POSES[0], POSES[2]], atol=1e-12)
    (tmp_path / "other.yaml").write_text("cycle_time_s: 0.01\n")
    with raises_code(ConfigError, "RID-FILE-VALUE", "kind"):
        Motion.load(tmp_path / "other.yaml", cell="ir361")


def test_a_design_reports_its_starts() -> None:
    fractions: list[float] = []
    options = {"excitation": {"starts": 1, "harmonics": 2}}
    design(
        "ir361",
        period_s=4.0,
        options=options,
        progress=lambda _step, done, _total: fractions.append(done),
    )
    assert fractions[0] == 0.0
    assert fractions[-1] >= 1.0


def test_a_path_is_retimed_within_the_torque_limits(path: Motion, model: Model) -> None:
    faster = retime(path, model, margin=0.1)
    assert faster.duration_s < path.duration_s
    limits = [joint.limits.torque for joint in model.robot.description.joints]
    torque = model.inverse_dynamics(faster.position, faster.velocity, faster.acceleration)
    assert np.all(np.abs(torque).max(axis=0) <= limits)
    with raises_code(ConfigError, "RID-MOTION-KIND"):
        retime(design("ir361", period_s=4.0, options=QUICK), model)


def test_texts_name_arguments_instead_of_temporary_files(
    path: Motion, model: Model, loops: Path, arm: Arm
) -> None:
    driven = compensate(path, model, loops)
    for result in (design("ir361", period_s=4.0, options=QUICK), retime(path, model), driven):
        assert not any(name in str(result) for name in (".yaml", "model.json", "rid-daq-"))
    short = arm.recording(5, seconds=4.0)
    with raises_code(DataQualityError, "RID-RUN-STILL", "run 5:") as still:
        validate(model, short)
    assert "rid-daq-" not in str(still.value)
    wrong = design("ir361", kind="multisine")
    with raises_code(ConfigError, "RID-MOTION-KIND", "the motion") as raised:
        retime(wrong, model)
    assert "rid-daq-" not in str(raised.value)


def test_points_outside_the_limits_are_refused() -> None:
    with raises_code(LimitError, "RID-MOTION-LIMIT", "axis1"):
        Motion.through([[0.0, 0.0, 0.0], [99.0, 0.0, 0.0]], cell="ir361")
    with raises_code(ConfigError, "RID-API-ARGUMENT", "(poses, joints)"):
        Motion.through([0.0, 1.0], cell="ir361")


@pytest.fixture(scope="module")
def loops(model: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file with the velocity loops of the arm."""
    path = tmp_path_factory.mktemp("loops") / "loops.json"
    found = [
        VelocityLoop(name, 900.0, 0.08, 0.0, 0.002, ("gain",), np.eye(1), 1.0, ())
        for name in model.robot.joint_names
    ]
    write_loops(path, found, "ir361", "a run")
    return path


@pytest.fixture(scope="module")
def gripper(tmp_path_factory: pytest.TempPathFactory) -> Payload:
    path = tmp_path_factory.mktemp("payload") / "payload.json"
    write_payload_file(path, MEDIUM.parameters)
    return Payload.load(path)


def test_a_feedforward_changes_the_speeds_and_is_saved(
    path: Motion, model: Model, loops: Path, tmp_path: Path
) -> None:
    ahead = compensate(path, model, loops)
    assert ahead.velocity.shape == path.velocity.shape
    assert np.abs(ahead.velocity - path.velocity).max() > 1e-4
    ahead.save(tmp_path / "feedforward.json")
    with raises_code(ConfigError, "RID-OUTPUT-EXISTS"):
        ahead.save(tmp_path / "feedforward.json")


def test_a_feedforward_contains_the_payload(
    path: Motion, model: Model, gripper: Payload, loops: Path
) -> None:
    empty = compensate(path, model, loops).velocity
    loaded = compensate(path, model, loops, payload=gripper).velocity
    assert np.abs(loaded - empty).max() > 1e-3
    of_loaded_model = compensate(path, model.with_payload(gripper), loops).velocity
    np.testing.assert_allclose(loaded, of_loaded_model, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(compensate(path, model, loops, payload="none").velocity, empty)
    for wrong in ("payload.json", 4.0):
        with raises_code(ConfigError, "RID-API-ARGUMENT", "none"):
            compensate(path, model, loops, payload=wrong)  # type: ignore[arg-type]


def test_a_feedforward_follows_a_load_that_changes(
    path: Motion, model: Model, gripper: Payload, loops: Path, tmp_path: Path
) -> None:
    gripper.save(tmp_path / "gripper.json")
    changes = tmp_path / "changes.yaml"
    changes.write_text("changes: [{at_s: 1.0, payload: gripper.json, ramp_s: 0.1}]")
    taken_up = compensate(path, model, loops, load_changes=changes).velocity
    empty = compensate(path, model, loops).velocity
    loaded = compensate(path, model, loops, payload=gripper).velocity
    before, most = path.time_s < 0.8, np.abs(loaded - empty).max()
    assert np.abs(taken_up - empty)[before].max() < 0.03 * most
    assert np.abs(taken_up - empty)[~before].max() > 0.3 * most
    changes.write_text("changes: [{at_s: 600.0, payload: gripper.json, ramp_s: 0.1}]")
    with raises_code(ConfigError, "RID-LOAD-CHANGE-TIME"):
        compensate(path, model, loops, load_changes=changes)


def test_a_model_with_a_payload_needs_a_statement(path: Motion, loops: Path) -> None:
    with_columns = with_payload_columns(known_estimate(load_cell("ir361"), {}))
    model = Model(with_columns, EstimateSection.of(with_columns))
    for function in (
        lambda: compensate(path, model, loops),
        lambda: retime(path, model),
        lambda: design("ir361", model=model, options=QUICK),
    ):
        with raises_code(EstimationError, "RID-PAYLOAD-UNSTATED", "with_payload"):
            function()
    alone = compensate(path, model, loops, payload="none").velocity
    loaded = compensate(path, model, loops, payload="model").velocity
    assert np.abs(loaded - alone).max() > 1e-3
    assert retime(path, model, payload="none", confidence=0.0).duration_s < path.duration_s


def test_motion_model_recording_and_validation_are_plotted(
    path: Motion, model: Model, train: Recording, arm: Arm, tmp_path: Path
) -> None:
    validation = validate(model, arm.recording(2))
    figures = (plot(path), plot(model), plot(train), plot(validation))
    for number, figure in enumerate(figures):
        assert figure.axes
        assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
        figure.savefig(tmp_path / f"{number}.png", dpi=30)


def test_a_notebook_shows_a_result_as_it_is_printed(model: Model, train: Recording) -> None:
    for result in (train, train.robot):
        assert repr(result) == str(result)
    assert len(repr(model)) < 100


def test_only_results_can_be_plotted() -> None:
    with raises_code(ConfigError, "RID-API-ARGUMENT", "float"):
        plot(3.5)  # type: ignore[arg-type]
