"""Optimal excitations reach the closed form, are better than the heuristic, and are
reproducible.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from dask.distributed import LocalCluster

from config.errors import ConfigError
from config.load import load_robot
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from dynamics.model.cad import cad_parameters
from identification.design.criteria import Condition, DOptimal, Goals
from identification.design.model import design_model
from identification.design.problem import ExcitationProblem
from identification.design.search import candidates, refine_start
from identification.design.two_harmonic import (
    TwoHarmonicOptions,
    condition_number,
    design_two_harmonic,
)
from identification.design.verification import check_motion
from tests.builders.raised_codes import raises_code

CYCLE_S = 0.008


@pytest.fixture(scope="module")
def problem() -> ExcitationProblem:
    robot = load_robot("ir361")
    return ExcitationProblem(
        robot=robot,
        period_s=10.0,
        harmonics=5,
        criterion=Condition(),
        limit_fraction=0.9,
        expected_noise_nm=np.array([joint.limits.torque for joint in robot.joints]),
    )


@pytest.fixture(scope="module")
def refined(problem):
    return refine_start(problem, 1, CYCLE_S)


@pytest.mark.parametrize("acceleration", [100.0, 2.0], ids=["by range", "by acceleration"])
def test_one_axis_and_one_harmonic_reach_the_closed_form(acceleration: float) -> None:
    """For a turntable with viscous friction, only the mean a^2 and v^2 of the sine matter."""
    limits = JointLimits(
        position_min=-1.0, position_max=1.0, velocity=50.0, acceleration=acceleration, torque=10.0
    )
    turntable = RobotDescription(
        name="turntable",
        kinematics=Kinematics(convention="modified_dh", rows=(KinematicRow(),)),
        joints=(Joint(name="axis", limits=limits, friction=("viscous",)),),
    )
    task = ExcitationProblem(
        robot=turntable,
        period_s=4.0,
        harmonics=1,
        criterion=DOptimal(),
        limit_fraction=0.9,
        expected_noise_nm=np.array([0.5]),
    )
    found = refine_start(task, 0, 0.004)
    omega = 2.0 * np.pi / 4.0
    largest = min(1.0, acceleration / omega**2)

    def worth(share: float) -> float:
        amplitude = share * largest
        information = np.array([amplitude * omega**2, amplitude * omega]) ** 2 / 2.0 / 0.5**2
        return float(-np.mean(np.log(information)))

    assert found.check.broken == ()
    assert worth(0.95) < found.check.objective < worth(0.9) + 1e-3


def test_the_design_keeps_every_limit_and_beats_the_heuristic(problem, refined) -> None:
    assert refined.check.broken == ()
    heuristic = design_two_harmonic(
        problem.robot, TwoHarmonicOptions(10.0, highest_harmonic=5, tries=200), CYCLE_S
    )
    assert condition_number(problem.robot, refined.motion) < 0.9 * condition_number(
        problem.robot, heuristic
    )


def test_limits_are_kept_between_the_samples(problem, refined) -> None:
    times = np.linspace(0.0, 10.0, 20_000)
    path = refined.motion.trajectory(problem.robot, CYCLE_S)
    q, v, a = path.position(times), path.velocity(times), path.acceleration(times)
    for j, joint in enumerate(problem.robot.joints):
        limits = joint.limits
        assert limits.position_min < q[:, j].min() < q[:, j].max() < limits.position_max
        assert np.abs(v[:, j]).max() < limits.velocity
        assert np.abs(a[:, j]).max() < limits.acceleration


def test_torque_and_self_collision_limit_the_motion(pinocchio_arm) -> None:
    robot = load_robot("ur10e")
    task = ExcitationProblem(
        robot=robot,
        period_s=10.0,
        harmonics=2,
        criterion=DOptimal(),
        limit_fraction=0.9,
        expected_noise_nm=np.array([joint.limits.torque for joint in robot.joints]),
        parameters=cad_parameters(design_model(robot), robot)[0],
    )
    found = refine_start(task, 4, 0.002, iterations=60)
    assert found.check.broken == ()
    path = found.motion.trajectory(robot, 0.01)
    times = path.sample_times_s
    data = pinocchio_arm.model.createData()
    for q, v, a in zip(
        path.position(times), path.velocity(times), path.acceleration(times), strict=True
    ):
        tau = pin.rnea(pinocchio_arm.model, data, q, v, a)
        assert (np.abs(tau) < [joint.limits.torque for joint in robot.joints]).all()
        assert pinocchio_arm.distances(q).min() > task.workspace.clearance_m - 1e-6


def test_the_same_seeds_give_the_same_motions_in_any_process(problem) -> None:
    first = {c.seed: c.motion for c in candidates(problem, [0, 1], CYCLE_S, iterations=60, jobs=2)}
    again = {c.seed: c.motion for c in candidates(problem, [1, 0], CYCLE_S, iterations=60, jobs=2)}
    assert again == first
    assert first[0] != first[1]


def test_a_dask_cluster_computes_the_candidates(problem) -> None:
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        found = list(candidates(problem, [0, 1], CYCLE_S, iterations=5, scheduler=address))
    assert sorted(candidate.seed for candidate in found) == [0, 1]


def test_a_caller_can_end_the_search_early(problem) -> None:
    stream = candidates(problem, range(50), CYCLE_S, iterations=5, jobs=1)
    assert next(stream).seed == 0
    stream.close()
    assert next(stream, None) is None


def test_a_scheduler_that_does_not_answer_is_an_error(problem, monkeypatch) -> None:
    monkeypatch.setattr("identification.design.search.SCHEDULER_TIMEOUT_S", 0.5)
    with raises_code(ConfigError, "RID-DESIGN-SCHEDULER", "tcp://127.0.0.1:9"):
        next(candidates(problem, [0], CYCLE_S, scheduler="tcp://127.0.0.1:9"))


def test_the_next_experiment_improves_the_least_known_parameters(problem) -> None:
    weak = [problem.base.names.index(name) for name in ("Im3", "Izz3")]
    known = np.full(len(problem.base), 1e6)
    known[weak] = 0.0
    dopt = replace(problem, criterion=DOptimal())
    served = refine_start(replace(dopt, given=np.diag(known)), 1, CYCLE_S)
    plain = refine_start(dopt, 1, CYCLE_S)
    judge = replace(problem, criterion=Goals(np.eye(len(known))[weak]), given=np.diag(known))
    deviations = [
        np.exp(check_motion(judge, each.motion, CYCLE_S).objective) for each in (served, plain)
    ]
    assert deviations[0] < 0.95 * deviations[1]


def test_a_design_for_one_parameter_improves_its_deviation(problem) -> None:
    chosen = Goals(np.eye(len(problem.base))[[problem.base.names.index("Ixz2")]])
    task = replace(problem, criterion=chosen)
    plain = refine_start(replace(problem, criterion=DOptimal()), 1, CYCLE_S)
    served = refine_start(task, 1, CYCLE_S)
    assert served.check.broken == ()
    deviation = np.exp(served.check.objective - check_motion(task, plain.motion, CYCLE_S).objective)
    assert deviation < 0.9
