"""Optimal excitations: better than the heuristic, reproducible, verified before they are used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.bodies import Plane, Workspace
from config.load import load_robot
from identification.excitation_problem import ExcitationProblem
from identification.experiment_design import condition_number, design_two_harmonic
from identification.optimal_design import candidates, refine, verify

CYCLE_S = 0.008


@pytest.fixture(scope="module")
def problem() -> ExcitationProblem:
    robot = load_robot("ir361")
    return ExcitationProblem(
        robot=robot,
        period_s=10.0,
        harmonics=4,
        criterion="condition",
        limit_fraction=0.9,
        expected_noise_nm=np.array([joint.limits.torque for joint in robot.joints]),
    )


@pytest.fixture(scope="module")
def refined(problem):
    return refine(problem, 1, CYCLE_S, iterations=60)


def test_it_holds_every_limit_and_beats_the_heuristic(problem, refined) -> None:
    assert refined.broken == ()
    heuristic = design_two_harmonic(problem.robot, 10.0, CYCLE_S, highest_harmonic=4, tries=100)
    assert condition_number(problem.robot, refined.motion) < condition_number(
        problem.robot, heuristic
    )


def test_the_quoted_condition_number_is_that_of_the_motion(problem, refined) -> None:
    assert refined.condition_number == pytest.approx(
        condition_number(problem.robot, refined.motion), rel=0.05
    )


def test_the_same_seed_gives_the_same_motion_in_any_process(problem, refined) -> None:
    spread = {c.seed: c.motion for c in candidates(problem, [0, 1], CYCLE_S, iterations=60)}
    assert spread[1] == refined.motion


def test_a_caller_that_has_seen_enough_may_stop(problem) -> None:
    stream = candidates(problem, range(50), CYCLE_S, iterations=5, jobs=1)
    next(stream)
    stream.close()


def test_a_motion_through_the_floor_is_told(problem) -> None:
    robot = load_robot("ur10e")
    task = ExcitationProblem(
        robot=robot,
        period_s=10.0,
        harmonics=2,
        criterion="condition",
        limit_fraction=0.9,
        expected_noise_nm=np.ones(6),
        workspace=Workspace(planes=(Plane(name="floor", normal=(0.0, 0.0, 1.0), offset_m=0.0),)),
    )
    blind = replace(task, workspace=Workspace())
    motion = blind.to_fourier(3.0 * blind.start(0), 16, 1)
    broken = " ".join(verify(task, motion, 0.002).broken)
    assert "floor and link" in broken
    assert "is allowed" in broken


def test_the_next_experiment_serves_what_is_known_least(problem) -> None:
    b = len(problem.base)
    weak = problem.base.names.index("Im3")
    known = np.full(b, 1e6)
    known[weak] = 0.0
    task = replace(problem, criterion="d_optimal", given=np.diag(known))
    served = refine(task, 1, CYCLE_S, iterations=60)
    plain = refine(replace(problem, criterion="d_optimal"), 1, CYCLE_S, iterations=60)

    def information(motion) -> float:
        """What a motion adds about the weak parameter when all others are known."""
        alone = np.full(b, 1e12)
        alone[weak] = 0.0
        judge = replace(problem, criterion="d_optimal", given=np.diag(alone))
        return verify(judge, motion, CYCLE_S).log_det

    assert information(served.motion) > information(plain.motion)
