"""A model identified from arrays: parameters, torques and models for other programs."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest

from config.errors import ConfigError, DataQualityError, EstimationError
from config.robot.friction_terms import FrictionTerm
from rid_daq.api import Model, Recording, Robot, identify, read_recording, validate
from rid_daq.report.sections.estimate import EstimateSection
from tests.builders.known_model import estimate_with_terms
from tests.builders.point_streams import CELL
from tests.builders.raised_codes import raises_code
from tests.rid_daq.api.conftest import Arm


def test_intervals_contain_the_true_parameters(model: Model, arm: Arm) -> None:
    true = model.estimate.base.from_standard(arm.theta)
    inside = [
        low <= value <= high
        for (low, high), value in zip([p.interval for p in model.parameters], true, strict=True)
    ]
    assert np.mean(inside) >= 0.85
    assert [p.name for p in model.parameters] == list(model.estimate.base.names)
    assert model.problems == ()
    assert np.all(model.residual_percent < 5.0)


def test_predicted_torques_equal_those_of_the_true_arm(model: Model, arm: Arm) -> None:
    _, q, v, a = arm.motion(7, 5.0)
    error = model.inverse_dynamics(q, v, a) - arm.torque_nm(q, v, a)
    assert np.all(np.sqrt(np.mean(error**2, axis=0)) < 2.0)
    one = model.inverse_dynamics(q[3], v[3], a[3])
    np.testing.assert_allclose(one, model.inverse_dynamics(q, v, a)[3], rtol=1e-12)


def test_a_parameter_is_printed_with_its_interval(model: Model) -> None:
    shown = next(each for each in model.parameters if each.is_shown)
    name, value, sign, reach, *unit = str(shown).removeprefix(shown.expression).split()
    assert (name, sign, " ".join(unit)) == ("=", "±", shown.unit)
    assert float(value.replace("−", "-")) == pytest.approx(shown.value, rel=0.1)
    assert float(reach) == pytest.approx(2.0 * shown.sigma, rel=0.1)


def test_the_regressor_times_the_values_is_the_torque(model: Model, arm: Arm) -> None:
    _, q, v, a = arm.motion(8, 1.0)
    y = model.regressor(q, v, a)
    assert y.shape == (*q.shape, len(model.values))
    np.testing.assert_allclose(y @ model.values, model.inverse_dynamics(q, v, a), atol=1e-9)


def test_a_joint_that_moves_in_one_sample_slides() -> None:
    """One sample has no past from which the presliding deflection could be computed."""
    terms: tuple[FrictionTerm, ...] = ("coulomb", "viscous")
    torques = []
    for own, distance_rad in ((terms, None), ((*terms, "presliding"), 1e-3)):
        estimate = estimate_with_terms(CELL, own, 10.0, distance_rad)
        model = Model(estimate, EstimateSection.of(estimate))
        torques.append(model.inverse_dynamics(np.zeros(3), [0.5, -0.5, 0.0], np.zeros(3)))
    np.testing.assert_allclose(torques[1], torques[0], rtol=1e-12)


def test_mass_matrix_and_friction_are_parts_of_the_inverse_dynamics(model: Model, arm: Arm) -> None:
    _, q, v, a = arm.motion(9, 1.0)
    mass, rest = model.mass_matrix(q), np.zeros_like(q)
    assert mass.shape == (*q.shape, q.shape[1])
    np.testing.assert_allclose(mass, np.swapaxes(mass, 1, 2), atol=1e-9)
    still = model.inverse_dynamics(q, rest, rest)
    by_mass = still + np.einsum("sij,sj->si", mass, a)
    np.testing.assert_allclose(model.inverse_dynamics(q, rest, a), by_mass, atol=1e-8)
    creeping = np.full_like(v, 0.01)
    moved = model.inverse_dynamics(q, creeping, rest) - still
    np.testing.assert_allclose(moved, model.friction(creeping), atol=0.05)


def test_a_saved_and_loaded_model_is_equal(model: Model, tmp_path: Path) -> None:
    model.save(tmp_path / "model.json")
    again = Model.load(tmp_path / "model.json")
    np.testing.assert_array_equal(again.values, model.values)
    assert again.parameters == model.parameters
    with raises_code(ConfigError, "RID-OUTPUT-EXISTS", "model.json"):
        model.save(tmp_path / "model.json")
    model.save(tmp_path / "model.json", overwrite=True)


def test_pinocchio_gets_the_same_inertias(model: Model, arm: Arm) -> None:
    built = model.to_pinocchio()
    q = arm.motion(10, 1.0)[1][0]
    mass = pinocchio.crba(built, built.createData(), q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    np.testing.assert_allclose(mass, model.mass_matrix(q), rtol=0.1, atol=3.0)
    assert list(built.names)[1:] == list(model.robot.joint_names)


def test_mujoco_gets_the_same_mass_matrix(model: Model, arm: Arm) -> None:
    built, other = model.to_mujoco(), model.to_pinocchio()
    data = mujoco.MjData(built)
    data.qpos[:] = arm.motion(10, 1.0)[1][0]
    mujoco.mj_forward(built, data)
    mass = np.zeros((built.nv, built.nv))
    for column, unit in zip(mass, np.eye(built.nv), strict=True):
        mujoco.mj_mulM(built, data, column, unit)
    judge = pinocchio.crba(other, other.createData(), data.qpos)
    judge = np.triu(judge) + np.triu(judge, 1).T
    np.testing.assert_allclose(mass, judge, atol=1e-6)


def test_without_mujoco_the_error_says_what_to_install(
    model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with raises_code(ConfigError, "RID-INSTALL-LIBRARY", "mujoco"):
        model.to_mujoco()


def test_an_exported_urdf_is_read_as_a_robot(model: Model, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(model.to_urdf(), encoding="utf-8")
    robot = Robot.from_urdf(tmp_path / "arm.urdf")
    assert robot.joint_names == model.robot.joint_names


def test_a_users_urdf_gets_the_identified_inertias(model: Model, tmp_path: Path) -> None:
    own = model.to_urdf()
    mine = own[own.index("<robot") :].replace('name="link2"', 'name="my_link"')
    mine = mine.replace('link="link2"', 'link="my_link"')
    mine = re.sub(r'<mass value="[^"]*"', '<mass value="9"', mine)
    (tmp_path / "mine.urdf").write_text(mine, encoding="utf-8")
    updated = model.to_urdf(tmp_path / "mine.urdf")
    assert updated.startswith(mine[: mine.index("<dynamics")])
    assert "my_link" in updated
    assert updated != mine
    (tmp_path / "mine.urdf").write_bytes(b"<!-- \xe9 -->" + mine.encode())
    with raises_code(ConfigError, "RID-FILE-SYNTAX"):
        model.to_urdf(tmp_path / "mine.urdf")


def test_a_validation_passes_on_another_motion_only(
    model: Model, train: Recording, arm: Arm
) -> None:
    result = validate(model, arm.recording(2))
    assert result.passed
    assert result.relative_error_percent.shape == (3,)
    assert result.measured_nm.shape == result.predicted_nm.shape == result.counted.shape
    assert [line.split()[0] for line in str(result).splitlines()[3:6]] == [
        "axis1",
        "axis2",
        "axis3",
    ]
    assert not validate(model, arm.recording(2), limits_percent=1e-3).passed
    with raises_code(DataQualityError, "RID-VALIDATE-SAME-RUN"):
        validate(model, train)


def test_rows_of_the_fit_are_recognised_in_another_recording(
    model: Model, train: Recording, tmp_path: Path
) -> None:
    half = len(train) // 2
    part = Recording.from_arrays(
        5.0 + train.time_s[:half],
        train.position[:half],
        train.torque_nm[:half],
        robot=train.robot,
        torques="motor_torque",
        name="part",
    )
    model.save(tmp_path / "model.json")
    assert len(model.estimate.imported_row_hashes) == 256
    with raises_code(DataQualityError, "RID-VALIDATE-SAME-RUN", " 53 %"):
        validate(Model.load(tmp_path / "model.json"), part)


def test_short_recordings_are_judged_together_without_a_filter_across_them(
    model: Model, arm: Arm
) -> None:
    short = [arm.recording(seed, seconds) for seed, seconds in ((2, 4.0), (3, 2.5))]
    for one in short:
        with raises_code(DataQualityError, "RID-RUN-STILL"):
            validate(model, one)
    together = validate(model, short)
    assert together.passed
    assert [each.run for each in together.runs] == ["run 2", "run 3"]
    for j in range(3):
        axes = [each.axes[j] for each in together.runs]
        squares = [axis.samples * (axis.rms_error or np.nan) ** 2 for axis in axes]
        pooled = np.sqrt(sum(squares) / sum(axis.samples for axis in axes))
        assert together.rms_error_nm[j] == pytest.approx(pooled, rel=1e-9)
    alone = [validate(model, arm.recording(seed, 8.0)) for seed in (2, 3)]
    both = validate(model, [arm.recording(seed, 8.0) for seed in (2, 3)])
    for name in ("predicted_nm", "measured_nm", "counted", "time_s"):
        parts = np.concatenate([getattr(each, name) for each in alone])
        np.testing.assert_array_equal(getattr(both, name), parts)
    assert "run 3" in str(both)
    with raises_code(ConfigError, "RID-API-ARGUMENT"):
        validate(model, [])


def test_a_wrong_torque_sign_is_reported_as_a_problem(arm: Arm) -> None:
    time_s, q, v, a = arm.motion(5, 20.0)
    wrong = arm.torque_nm(q, v, a) * np.array([1.0, -1.0, 1.0])
    model = identify(
        Recording.from_arrays(time_s, q, wrong, torques="motor_torque", robot=arm.robot)
    )
    assert model.problems
    assert any("axis2" in sentence for sentence in model.problems)


@pytest.mark.parametrize(
    "shapes", [((4, 3), (4, 2), (4, 3)), ((4, 3), (5, 3), (4, 3)), ((2,), (2,), (2,))]
)
def test_arrays_of_other_shapes_are_refused(
    model: Model, shapes: tuple[tuple[int, ...], ...]
) -> None:
    with raises_code(EstimationError, "RID-API-ARGUMENT", "(samples, 3)"):
        model.inverse_dynamics(*(np.zeros(shape) for shape in shapes))


def test_positions_in_degrees_are_refused(model: Model, arm: Arm) -> None:
    _, q, v, a = arm.motion(10, 5.0)
    degrees = np.rad2deg(q)
    for compute in (model.inverse_dynamics, model.regressor):
        with raises_code(ConfigError, "RID-API-ARGUMENT", "rad"):
            compute(degrees, v, a)
    with raises_code(ConfigError, "RID-API-ARGUMENT", "1e+308"):
        model.mass_matrix(np.full(len(q[0]), 1e308))
    with raises_code(ConfigError, "RID-API-ARGUMENT", "rad"):
        Recording.from_arrays(np.arange(len(q)) * 0.01, degrees, q, robot=arm.robot)


def test_options_of_the_request_are_checked(train: Recording) -> None:
    with raises_code(ConfigError, "RID-REQUEST-INVALID", "speed"):
        identify(train, options={"speed": 3})
    with raises_code(ConfigError, "RID-OPTION-EXCLUSIVE"):
        identify(train, choose=True, friction=["coulomb"])
    with raises_code(ConfigError, "RID-API-ARGUMENT"):
        identify([])


def test_the_model_has_the_requested_friction_terms(train: Recording) -> None:
    model = identify(train, friction=["coulomb", "viscous"], diagnose=False)
    assert not [p for p in model.parameters if p.name.startswith("fo_")]


def test_a_run_folder_is_read_as_a_recording(run_folder: Path, model: Model) -> None:
    before = {path: path.read_bytes() for path in run_folder.iterdir()}
    recording = read_recording(run_folder)
    assert recording.is_periodic
    found = identify(recording, diagnose=False)
    z = (found.values - model.values) / np.hypot(found.sigma, model.sigma)
    assert np.mean(np.abs(z) < 3.0) >= 0.85
    assert {path: path.read_bytes() for path in run_folder.iterdir()} == before
    with raises_code(ConfigError, "RID-OPTION-NO-EFFECT"):
        read_recording(run_folder, map="ur10e_31")


def test_progress_is_reported_and_nothing_is_printed(
    arm: Arm, capfd: pytest.CaptureFixture[str]
) -> None:
    reports: list[tuple[str, float, float | None]] = []
    identify(
        arm.recording(6, 6.0),
        diagnose=False,
        options={"cross_check": True},
        progress=lambda title, done, total: reports.append((title, done, total)),
    )
    assert reports[0][1] == 0.0
    assert reports[-1][1] == reports[-1][2]
    assert capfd.readouterr() == ("", "")


def test_the_search_for_mistakes_reports_progress(arm: Arm) -> None:
    done: list[tuple[str, float]] = []
    identify(arm.recording(6, 6.0), progress=lambda step, amount, _: done.append((step, amount)))
    searched = [amount for step, amount in done if step.startswith("Searching for mistakes")]
    assert searched == [0.0, 1.0, 2.0]
    assert "Estimating the parameters" in {step for step, _ in done}


def test_a_robot_description_with_other_joints_is_refused(train: Recording, arm: Arm) -> None:
    with raises_code(ConfigError, "RID-ROBOT-OTHER", "joint1"):
        identify(train, robot=Robot.load("ur10e"))
    with raises_code(ConfigError, "RID-API-ARGUMENT", "(samples, 6)"):
        Recording.from_arrays(
            train.time_s, train.position, train.torque_nm, robot=Robot.load("ur10e")
        )


def test_nothing_is_left_on_disk(arm: Arm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    recording = arm.recording(4, 3.0)
    assert len(recording) > 500
    del recording
    assert list(tmp_path.iterdir()) == []
