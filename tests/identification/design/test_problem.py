"""Design problem: exact gradients, limits as penalties, and criteria with known values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.errors import ConfigError
from config.load import load_robot
from config.robot.bodies import Box, Plane, Workspace
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import regressor
from identification.design.criteria import Condition, DOptimal
from identification.design.model import design_model
from identification.design.problem import ExcitationProblem
from tests.builders.raised_codes import raises_code

WORKSPACE = Workspace(
    planes=(Plane(name="the floor", normal=(0.0, 0.0, 1.0), offset_m=-0.2),),
    boxes=(Box(name="the wall", keep="out", min_m=(0.8, -1.0, -1.0), max_m=(1.0, 1.0, 2.0)),),
)


@pytest.fixture(scope="module")
def problem() -> ExcitationProblem:
    robot = load_robot("ur10e")
    return ExcitationProblem(
        robot=robot,
        period_s=10.0,
        harmonics=3,
        criterion=DOptimal(),
        limit_fraction=0.9,
        expected_noise_nm=np.array([joint.limits.torque for joint in robot.joints]),
        parameters=cad_parameters(design_model(robot), robot)[0],
        workspace=WORKSPACE,
    )


@pytest.mark.parametrize("criterion", [DOptimal(), Condition()], ids=["d-optimal", "condition"])
@pytest.mark.parametrize("size", [1.0, 8.0], ids=["within the limits", "beyond every limit"])
def test_the_problems_gradient_agrees_with_central_differences(problem, criterion, size) -> None:
    task = replace(problem, criterion=criterion)
    random = np.random.default_rng(3)
    x = size * task.start(1)
    shifts = task.next_shifts(0.9 * x, task.no_shifts())
    for _ in range(3):
        direction = random.normal(size=task.size)
        step = 1e-6
        up, down = (task.value(x + s * direction, 10.0, shifts)[0] for s in (step, -step))
        slope = task.value(x, 10.0, shifts)[1] @ direction
        assert slope == pytest.approx((up - down) / (2.0 * step), rel=1e-4)


def test_a_motion_within_every_limit_has_no_penalty(problem) -> None:
    x = 0.1 * problem.start(0)
    x.reshape(6, -1)[:, 0] *= 10.0  # keep the mean pose and reduce only the amplitudes
    none = problem.no_shifts()
    assert problem.value(x, 1e6, none)[0] == pytest.approx(problem.value(x, 0.0, none)[0])
    for shift in problem.next_shifts(x, none):
        assert not shift.any()


def test_an_exceeded_limit_is_shifted_by_its_violation(problem) -> None:
    x = problem.start(0).reshape(6, -1)
    x[:, 1:] = 0.0
    x[2, 1] = 1.5  # the first sine of the third joint alone, 1.5 times the planned amplitude
    q = problem.motion(x.ravel(), problem._fine)[0][:, 2]
    shifts = problem.next_shifts(x.ravel(), problem.no_shifts())
    limits = problem.robot.joints[2].limits
    half = (limits.position_max - limits.position_min) / 2.0
    middle = (limits.position_max + limits.position_min) / 2.0
    expected = np.maximum((q - middle) / half - problem.limit_fraction, 0.0)
    np.testing.assert_allclose(shifts[0][0][:, 2], expected, atol=1e-12)


def test_the_start_pose_is_free_of_collisions(problem) -> None:
    for seed in range(5):
        pose = problem.motion(problem.start(seed), problem._coarse)[0].mean(axis=0)
        distances = problem.clearances.nearest(pose[np.newaxis])
        assert (distances >= WORKSPACE.clearance_m).all()


def test_the_same_seed_gives_the_same_start(problem) -> None:
    np.testing.assert_array_equal(problem.start(7), problem.start(7))
    assert not np.array_equal(problem.start(7), problem.start(8))


def test_d_optimality_is_the_log_determinant(problem) -> None:
    x = problem.start(2)
    q, v, a = problem.motion(x, problem._coarse)
    rows = problem.base.columns(regressor(problem._smooth_model, q, v, a))
    rows = (rows / problem.expected_noise_nm[:, np.newaxis]).reshape(-1, len(problem.base))
    _, log_det = np.linalg.slogdet(rows.T @ rows / len(q))
    value = problem.value(x, 0.0, problem.no_shifts())[0]
    assert value == pytest.approx(-log_det / len(problem.base), rel=1e-6)


def test_the_information_of_earlier_runs_is_included(problem) -> None:
    b = len(problem.base)
    known = replace(problem, given=1e12 * np.eye(b))
    x = problem.start(2)
    none = problem.no_shifts()
    # If everything is known already, no motion adds information.
    slope, before = (np.abs(task.value(x, 0.0, none)[1]).max() for task in (known, problem))
    assert slope < 1e-6 * before


def test_terms_that_no_motion_can_determine_are_excluded() -> None:
    robot = load_robot("ur10e")
    first = robot.joints[0]
    joint = first.model_copy(
        update={"friction": (*first.friction, "temperature"), "efficiency": 0.8}
    )
    warm = robot.model_copy(update={"joints": (joint, *robot.joints[1:])})
    model = design_model(warm)
    assert model.parameter_names == design_model(robot).parameter_names
    assert model.nonlinear_names == ()


def test_a_motion_file_describes_the_same_motion(problem) -> None:
    x = problem.start(4)
    motion = problem.to_fourier(x, 16)
    q = problem.motion(x, problem._coarse)[0]
    first = motion.joints[0]
    assert first.offset + sum(first.cosine) == pytest.approx(q[0, 0], abs=1e-5)


@pytest.mark.slow
def test_a_robot_without_a_free_pose_is_refused_with_the_colliding_pair(problem) -> None:
    buried = Workspace(planes=(Plane(name="the ceiling", normal=(0.0, 0.0, -1.0), offset_m=0.5),))
    with raises_code(ConfigError, "RID-DESIGN-NONE", "the ceiling", "link 1", "-0.776 m"):
        replace(problem, workspace=buried).start(0)


@pytest.mark.parametrize(
    ("change", "code", "details"),
    [
        ({"harmonics": 0}, "RID-OPTION-RANGE", ("harmonics is 0",)),
        ({"limit_fraction": 1.5}, "RID-OPTION-RANGE", ("limit_fraction is 1.5",)),
        ({"expected_noise_nm": np.zeros(6)}, "RID-OPTION-RANGE", ("expected_noise_nm",)),
        ({"given": np.eye(3)}, "RID-ROBOT-OTHER", ("(3, 3)", "58")),
        ({"parameters": np.zeros(3)}, "RID-API-ARGUMENT", ("(3,)", "84 parameters")),
    ],
)
def test_an_invalid_problem_is_refused(problem, change, code, details) -> None:
    with raises_code(ConfigError, code, *details):
        replace(problem, **change)
