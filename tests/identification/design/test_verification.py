"""Check of a designed motion, compared with Pinocchio and with the motion file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from acquisition.motion.kinds.fourier import FourierMotion
from config.load import load_robot
from config.robot.bodies import Plane, Workspace
from dynamics.model.cad import cad_parameters
from identification.design.criteria import Condition
from identification.design.model import design_model
from identification.design.problem import ExcitationProblem
from identification.design.two_harmonic import condition_number
from identification.design.verification import MotionCheck, check_motion

CYCLE_S = 0.004
FLOOR = Workspace(planes=(Plane(name="floor", normal=(0.0, 0.0, 1.0), offset_m=-0.3),))


@pytest.fixture(scope="module")
def problem() -> ExcitationProblem:
    robot = load_robot("ur10e")
    return ExcitationProblem(
        robot=robot,
        period_s=10.0,
        harmonics=2,
        criterion=Condition(),
        limit_fraction=0.9,
        expected_noise_nm=np.array([joint.limits.torque for joint in robot.joints]),
        parameters=cad_parameters(design_model(robot), robot)[0],
        workspace=FLOOR,
    )


@pytest.fixture(scope="module")
def motion(problem) -> FourierMotion:
    return problem.to_fourier(2.0 * problem.start(5), 16)


def values_over_period(motion: FourierMotion, derivative: int) -> np.ndarray:
    """Return q, v or a (`derivative` 0, 1 or 2) over a period, from the numbers in the file alone.

    Shape: (1500, joints).
    """
    t = np.linspace(0.0, motion.period_s, 1500)
    columns = []
    for joint in motion.joints:
        total = np.full(t.shape, joint.offset if derivative == 0 else 0.0)
        for k, (a, b) in enumerate(zip(joint.sine, joint.cosine, strict=True), start=1):
            w = 2.0 * np.pi * k / motion.period_s
            turn = derivative * np.pi / 2.0
            total += w**derivative * (a * np.sin(w * t + turn) + b * np.cos(w * t + turn))
        columns.append(total)
    return np.array(columns).T


def used_shares(check: MotionCheck, what: str) -> list[float]:
    return [use.used for use in check.uses if use.what.startswith(what)]


def test_the_used_shares_of_the_limits_match_the_motion_file(problem, motion) -> None:
    check = check_motion(problem, motion, CYCLE_S)
    limits = [joint.limits for joint in problem.robot.joints]
    middle = np.array([(x.position_max + x.position_min) / 2.0 for x in limits])
    for what, derivative, centre in (("range", 0, middle), ("speed", 1, 0.0)):
        largest = np.abs(values_over_period(motion, derivative) - centre).max(axis=0)
        np.testing.assert_allclose(used_shares(check, what), largest, rtol=2e-3)


def test_torques_agree_with_pinocchio(problem, motion, pinocchio_arm) -> None:
    q, v, a = (values_over_period(motion, k) for k in range(3))
    data = pinocchio_arm.model.createData()
    tau = [pin.rnea(pinocchio_arm.model, data, *row) for row in zip(q, v, a, strict=True)]
    check = check_motion(problem, motion, CYCLE_S)
    largest = np.abs(tau).max(axis=0)
    np.testing.assert_allclose(used_shares(check, "torque"), largest, rtol=5e-3, atol=1e-3)


def test_distances_agree_with_pinocchio(problem, motion, pinocchio_arm) -> None:
    nearest = np.min([pinocchio_arm.distances(q) for q in values_over_period(motion, 0)], axis=0)
    check = check_motion(problem, motion, CYCLE_S)
    ours = np.array(used_shares(check, "distance")[: len(nearest)])
    apart = nearest > 0.0  # the penetration depth is less accurate
    assert apart.any()
    np.testing.assert_allclose(ours[apart], nearest[apart], atol=2e-4)
    assert (ours[~apart] < 0.0).all()


def test_a_motion_through_the_floor_is_reported(problem, motion) -> None:
    broken = " ".join(check_motion(problem, motion, CYCLE_S).broken)
    assert "floor and link" in broken
    assert "but the limit is" in broken


def test_each_exceeded_limit_is_reported(problem, motion) -> None:
    wild = motion.model_copy(
        update={
            "joints": tuple(
                joint.model_copy(update={"sine": tuple(9.0 * value for value in joint.sine)})
                for joint in motion.joints
            )
        }
    )
    check = check_motion(problem, wild, CYCLE_S)
    words = " ".join(check.broken)
    assert "position of joint 'joint3'" in words
    assert "torque of joint" in words
    held = {use.what: use.is_met for use in check.uses}
    assert not held["range of joint3"]


def test_torque_without_a_prior_is_not_judged(problem, motion) -> None:
    check = check_motion(replace(problem, parameters=None), motion, CYCLE_S)
    assert used_shares(check, "torque") == []


def test_the_condition_number_is_that_of_the_motion(problem, motion) -> None:
    check = check_motion(problem, motion, CYCLE_S)
    assert check.objective == check.condition_number
    assert check.condition_number == pytest.approx(
        condition_number(problem.robot, motion), rel=0.05
    )


def test_a_joint_at_rest_makes_the_criterion_infinite(problem, motion) -> None:
    still = motion.joints[0].model_copy(update={"sine": (0.0, 0.0), "cosine": (0.0, 0.0)})
    stopped = motion.model_copy(update={"joints": (still, *motion.joints[1:])})
    assert check_motion(problem, stopped, CYCLE_S).objective == np.inf
