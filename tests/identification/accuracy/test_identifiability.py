"""Poorly determined parameters, and the motion that would determine them."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.processing.smoothing import SmoothedSignals
from config.load import load_robot
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, torque
from identification.accuracy.identifiability import unseen_findings, weak_parameters
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed
from rid_daq.report.sections.estimate import EstimateSection
from tests.builders.presliding_arm import iwan, motion, recording, with_presliding


def estimate_from_sines(
    amplitude: tuple[float, float, float],
    robot: RobotDescription | None = None,
    true: dict[str, float] | None = None,
) -> Estimate:
    """Return an arm's estimate from sines with the given amplitude of each joint."""
    robot = robot or load_robot("ir361")
    model = RobotModel.from_description(robot)
    random = np.random.default_rng(0)
    time_s = 0.01 * np.arange(3000, dtype=np.float64)
    omega = 2.0 * np.pi / 10.0 * np.arange(1, 6)
    sine, cosine = random.normal(size=(2, 5, 3)) * np.array(amplitude)
    s, c = np.sin(np.outer(time_s, omega)), np.cos(np.outer(time_s, omega))
    q, v = s @ sine + c @ cosine, (c * omega) @ sine - (s * omega) @ cosine
    a = -(s * omega**2) @ sine - (c * omega**2) @ cosine
    values = random.uniform(0.5, 1.0, len(model.parameter_names))
    for name, value in (true or {}).items():
        values[model.parameter_names.index(name)] = value
    signals = SmoothedSignals(
        joint_names=robot.joint_names,
        time_s=time_s,
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=torque(model, q, v, a, values) + 20.0 * random.normal(size=q.shape),
        segment=np.zeros(len(q), dtype=np.int64),
        sample_period_s=0.01,
        cutoff_hz=10.0,
    )
    return fit_smoothed(robot, [signals]).estimate()


@pytest.fixture(scope="module")
def estimate_of_small_motion() -> Estimate:
    """Estimate from a motion in which the third axis hardly moves."""
    return estimate_from_sines((0.3, 0.3, 0.02))


def test_weak_parameters_name_the_joint_that_hardly_moved(
    estimate_of_small_motion: Estimate,
) -> None:
    found = weak_parameters(estimate_of_small_motion)
    assert found
    of_link_3 = [weak for weak in found if weak.expression.split()[0].endswith("3")]
    assert of_link_3
    assert all("axis3" in weak.motion for weak in of_link_3)
    assert max(weak.gain for weak in found) > 2.0


def test_weak_parameters_are_not_distinguishable_from_zero(
    estimate_of_small_motion: Estimate,
) -> None:
    for weak in weak_parameters(estimate_of_small_motion, most=100):
        assert abs(weak.value) < 2.0 * weak.sigma
        assert weak.expression in estimate_of_small_motion.base.expressions


def test_the_sentence_names_the_motion_to_add(estimate_of_small_motion: Estimate) -> None:
    weak = next(weak for weak in weak_parameters(estimate_of_small_motion) if weak.motion)
    assert weak.motion in weak.sentence
    assert "poorly determined" in weak.sentence


def test_a_motion_of_all_joints_leaves_fewer_weak_parameters(
    estimate_of_small_motion: Estimate,
) -> None:
    lively = estimate_from_sines((0.4, 0.4, 0.4))
    assert len(weak_parameters(lively, most=100)) < len(
        weak_parameters(estimate_of_small_motion, most=100)
    )


def test_a_presliding_share_at_its_bound_is_reported_with_the_term_to_remove() -> None:
    """The finding names `presliding` if the data show no presliding, and `presliding_share`
    otherwise.
    """
    way = motion(20.0, 1)
    for gives_way, term in ((False, "presliding"), (True, "presliding_share")):
        directions = {1: iwan(way[0][:, 1], 0.01)} if gives_way else {}
        estimate = fit_smoothed(
            with_presliding((1,), 0.01, share=0.5), [recording(directions, way)]
        ).estimate()
        found = [each for each in unseen_findings(estimate) if each.startswith("sp_axis2")]
        assert [f"Leave `{term}` of axis2 out" in each for each in found] == [True]


def stribeck(start_rad_s: float) -> RobotDescription:
    """Return an arm whose robot file has Stribeck friction in the second joint."""
    robot = load_robot("ir361")
    terms = {"friction": ("coulomb", "viscous", "stribeck"), "stribeck_velocity": start_rad_s}
    joints = [
        joint.model_copy(update=terms) if joint.name == "axis2" else joint for joint in robot.joints
    ]
    return robot.model_copy(update={"joints": tuple(joints)})


@pytest.mark.parametrize("start_rad_s", [0.1, 0.4, 10.0])
def test_a_start_value_that_the_data_do_not_change_is_not_an_estimate(start_rad_s: float) -> None:
    # The arm has no Stribeck friction: the data do not determine the Stribeck speed.
    estimate = estimate_from_sines((0.4, 0.4, 0.4), stribeck(start_rad_s), {"fs_axis2": 0.0})
    assert estimate.nonlinear_unseen == ("vs_axis2",)
    assert [each.split()[0] for each in unseen_findings(estimate)] == ["vs_axis2"]
    entry = next(e for e in EstimateSection.of(estimate).parameters if e.name == "vs_axis2")
    assert entry.not_shown


def test_a_stribeck_speed_determined_by_the_data_is_an_estimate() -> None:
    estimate = estimate_from_sines((0.4, 0.4, 0.4), stribeck(0.1), {"fs_axis2": 300.0})
    assert estimate.nonlinear_unseen == ()
    assert unseen_findings(estimate) == ()
    (speed,), (sigma,) = estimate.model.nonlinear_values, estimate.nonlinear_sigma
    assert abs(speed - 0.1) < 3.0 * sigma
    assert sigma < 0.03
