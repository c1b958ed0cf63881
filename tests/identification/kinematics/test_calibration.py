"""Kinematic calibration of arms that Pinocchio simulates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.measured_arm import MeasuredArm
from config.errors import DataQualityError
from config.load import load_robot
from dynamics.geometry.kinematics import Chain, forward
from identification.kinematics.calibration import Calibration, calibrate, probe_positions
from identification.kinematics.corrected import changed_keys, corrected_robot
from identification.kinematics.gravity import Gravity
from identification.kinematics.held_out import distinct_poses
from tests.builders.raised_codes import raises_code
from tests.identification.kinematics.conftest import NOISE_M, Experiment

Calibrated = Callable[[str], Calibration]
ROBOTS = pytest.mark.parametrize(("name", "rank"), [("ir361", 15), ("kr15", 27)])


@pytest.fixture(params=["ir361", "kr15"])
def experiment(
    request: pytest.FixtureRequest, three_axes: Experiment, six_axes: Experiment
) -> Experiment:
    return three_axes if request.param == "ir361" else six_axes


@ROBOTS
def test_the_rank_of_a_revolute_arm_is_4_r_plus_3(
    calibrated: Calibrated, name: str, rank: int
) -> None:
    found = calibrated(name)
    assert found.rank == rank
    assert found.rank + len(found.fixed) == 9 + 5 * len(found.robot.joints)
    assert found.hidden == ("axis1",)  # its axis is vertical


def test_points_that_were_not_measured_are_predicted_to_20_micrometres(
    calibrated: Calibrated, experiment: Experiment
) -> None:
    found = calibrated(experiment.arm.robot.name)
    probes = probe_positions(experiment.arm.robot, 300)[-100:]
    true = experiment.arm.points(probes, np.zeros(100))
    error = np.linalg.norm(found.fit.arm.points(probes, np.zeros(100)) - true, axis=1)
    assert error.mean() < NOISE_M
    assert found.fit.scale == pytest.approx(NOISE_M, rel=0.2)
    assert found.after.rms_m == pytest.approx(np.sqrt(3.0) * NOISE_M, rel=0.4)
    assert found.before.rms_m > 20.0 * found.after.rms_m
    assert found.rigid is not None
    assert found.rigid.rms_m > 5.0 * found.after.rms_m
    assert not found.suspicious.any()


def test_intervals_hold_the_true_compliances(
    calibrated: Calibrated, experiment: Experiment
) -> None:
    found = calibrated(experiment.arm.robot.name)
    for each, value, sigma in zip(found.fit.parameters, found.values, found.sigmas, strict=True):
        if each.kind == "compliance":
            true = experiment.arm.compliance[each.joint]
            assert abs(value - true) < 3.0 * sigma + 0.015 * true  # bodies are 1 % wrong


def test_the_corrected_robot_file_predicts_the_points(
    calibrated: Calibrated, experiment: Experiment
) -> None:
    found = calibrated(experiment.arm.robot.name)
    corrected = corrected_robot(found, is_tool=True)
    probes = probe_positions(corrected, 20)
    arm = found.fit.arm
    links, _ = experiment.gravity.link_positions(
        probes,
        np.zeros(20),
        np.array([1.0 / (joint.stiffness_nm_rad or np.inf) for joint in corrected.joints]),
    )
    here = forward(Chain.from_description(corrected), links)
    np.testing.assert_allclose(
        here @ arm.rotation.T + arm.origin_m, arm.points(probes, np.zeros(20)), atol=1e-9
    )
    keys = [key for key, _, _ in changed_keys(found.robot, corrected)]
    assert all(key.startswith(("kinematics.calibration", "joints", "tool")) for key in keys)


def test_a_standard_table_is_corrected_in_the_modified_convention(
    calibrated: Calibrated,
) -> None:
    found, robot = calibrated("kr15"), load_robot("ur10e")
    assert robot.kinematics.convention == "standard_dh"
    chain = Chain.from_description(robot)
    still = replace(
        found.fit,
        arm=replace(found.fit.arm, chain=replace(chain, tool_m=np.array([0.01, 0.02, 0.03]))),
        parameters=(),
        covariance=np.zeros((0, 0)),
    )
    corrected = corrected_robot(replace(found, robot=robot, fit=still), is_tool=False)
    probes = probe_positions(robot, 20)
    np.testing.assert_allclose(
        forward(Chain.from_description(corrected), probes), forward(chain, probes), atol=1e-12
    )


def test_a_separate_check_judges_the_result(three_axes: Experiment) -> None:
    probes = probe_positions(three_axes.arm.robot, 60)
    poses = three_axes.measured(probes[:40], np.zeros(40))
    check = three_axes.measured(probes[40:], np.zeros(20))
    found = calibrate(three_axes.arm.robot, poses, three_axes.gravity, three_axes.point_m, check)
    assert found.check is check
    assert found.holds
    assert len(found.after.error_m) == 20
    assert found.after.excess == pytest.approx(1.0, abs=0.3)


def test_a_wrong_point_is_listed_and_the_intervals_are_widened(three_axes: Experiment) -> None:
    poses = three_axes.measured(probe_positions(three_axes.arm.robot, 30), np.zeros(30))
    points = poses.point_m.copy()
    points[7] += [0.002, 0.0, 0.0]
    wrong = replace(poses, point_m=points, sigma_m=np.full(30, NOISE_M))
    found = calibrate(three_axes.arm.robot, wrong, three_axes.gravity, three_axes.point_m)
    assert found.suspicious.nonzero()[0].tolist() == [7]
    assert found.improves
    assert not found.holds
    assert found.fit.scale > 5.0
    sound = replace(poses, sigma_m=np.full(30, NOISE_M))
    other = calibrate(three_axes.arm.robot, sound, three_axes.gravity, three_axes.point_m)
    assert other.fit.scale == pytest.approx(1.0, abs=0.2)
    shared = {each.name for each in found.fit.parameters}
    for each, sigma in zip(other.fit.parameters, other.sigmas, strict=True):
        if each.name in shared:
            names = [parameter.name for parameter in found.fit.parameters]
            assert found.sigmas[names.index(each.name)] > 5.0 * sigma


@pytest.mark.parametrize("rows", [slice(3, 4), slice(None)])
def test_a_check_contradicts_a_calibration(three_axes: Experiment, rows: slice) -> None:
    """One wrong pose, or an instrument that was moved by 0.5 mm."""
    probes = probe_positions(three_axes.arm.robot, 60)
    poses = three_axes.measured(probes[:40], np.zeros(40))
    check = three_axes.measured(probes[40:], np.zeros(20))
    points = check.point_m.copy()
    points[rows] += [0.0005, 0.0, 0.0]
    wrong = replace(check, point_m=points)
    found = calibrate(three_axes.arm.robot, poses, three_axes.gravity, three_axes.point_m, wrong)
    assert found.improves
    assert not found.holds


@pytest.mark.parametrize("seed", [3, 10])
def test_gears_that_count_as_rigid_contradict_nothing(seed: int) -> None:
    """Deflection causes errors with a long tail: a lonely large error can be correct."""
    point = np.array([0.765, 0.0, 0.0])
    arm = MeasuredArm.of(load_robot("ir361"), point, (5e4, 6e4, 2e4), seed)
    three_axes = Experiment(arm, point, Gravity.of_cad(arm.robot, point))
    poses = three_axes.measured(probe_positions(arm.robot, 40), np.where(np.arange(40) % 2, 8.0, 0))
    assert calibrate(arm.robot, poses, None, point).holds


def test_rigid_gears_are_calibrated_without_gravity(three_axes: Experiment) -> None:
    poses = three_axes.measured(probe_positions(three_axes.arm.robot, 30), np.zeros(30))
    found = calibrate(three_axes.arm.robot, poses, None, three_axes.point_m)
    assert found.rank == 15
    assert found.rigid is None
    assert found.hidden == found.robot.joint_names
    assert found.improves


@pytest.mark.parametrize("count", [4, 8])
def test_too_few_poses_are_refused(three_axes: Experiment, count: int) -> None:
    with raises_code(DataQualityError, "RID-KINEMATICS-FEW", str(count)):
        three_axes.calibration(count)


def test_poses_that_do_not_move_a_joint_are_refused(three_axes: Experiment) -> None:
    probes = probe_positions(three_axes.arm.robot, 30)
    probes[:, 2] = 0.3
    poses = three_axes.measured(probes, np.zeros(30))
    with raises_code(DataQualityError, "RID-KINEMATICS-POSES", "axis3"):
        calibrate(three_axes.arm.robot, poses, three_axes.gravity, three_axes.point_m)


def test_poses_in_a_corner_are_refused(three_axes: Experiment) -> None:
    probes = 0.1 * probe_positions(three_axes.arm.robot, 30)
    poses = three_axes.measured(probes, np.zeros(30))
    with raises_code(DataQualityError, "RID-KINEMATICS-POSES"):
        calibrate(three_axes.arm.robot, poses, three_axes.gravity, three_axes.point_m)


def test_points_in_another_order_are_refused(three_axes: Experiment) -> None:
    poses = three_axes.measured(probe_positions(three_axes.arm.robot, 30), np.zeros(30))
    mixed = replace(poses, point_m=poses.point_m[::-1])
    with raises_code(DataQualityError, "RID-KINEMATICS-POSES", "poses.csv"):
        calibrate(three_axes.arm.robot, mixed, three_axes.gravity, three_axes.point_m)


def test_repetitions_of_a_pose_are_held_out_together(three_axes: Experiment) -> None:
    random = np.random.default_rng(1)
    probes = probe_positions(three_axes.arm.robot, 14)
    once = three_axes.arm.points(probes, np.zeros(14)) + 3e-4 * random.normal(size=(14, 3))
    rows = np.repeat(np.arange(14), 3)
    position = probes[rows] + 1e-4 * random.normal(size=(42, 3))
    points = once[rows] + 1e-5 * random.normal(size=(42, 3))
    poses = replace(three_axes.measured(position, np.zeros(42)), point_m=points)
    assert distinct_poses(position).tolist() == rows.tolist()
    found = calibrate(three_axes.arm.robot, poses, None, three_axes.point_m)
    fresh = probe_positions(three_axes.arm.robot, 300)[100:]
    off = found.fit.arm.points(fresh, np.zeros(200)) - three_axes.arm.points(fresh, np.zeros(200))
    real = np.sqrt(np.mean(np.sum(off**2, axis=1)) + 3.0 * 3e-4**2)
    assert found.after.rms_m == pytest.approx(real, rel=0.5)


def test_repetitions_do_not_count_as_poses(three_axes: Experiment) -> None:
    probes = np.repeat(probe_positions(three_axes.arm.robot, 6), 5, axis=0)
    poses = three_axes.measured(probes, np.zeros(30))
    with raises_code(DataQualityError, "RID-KINEMATICS-FEW", "6"):
        calibrate(three_axes.arm.robot, poses, three_axes.gravity, three_axes.point_m)


@pytest.mark.filterwarnings("error")
def test_a_table_without_a_valid_row_is_refused(three_axes: Experiment) -> None:
    none = three_axes.measured(np.zeros((1, 3)), np.zeros(1)).keep(np.zeros(1, dtype=np.bool_))
    with raises_code(DataQualityError, "RID-KINEMATICS-FEW", "0"):
        calibrate(three_axes.arm.robot, none, three_axes.gravity, three_axes.point_m)


def test_an_imprecise_stiffness_does_not_replace_that_of_the_robot_file(
    calibrated: Calibrated,
) -> None:
    found = calibrated("ir361")
    joints = tuple(
        joint.model_copy(update={"stiffness_nm_rad": 1.5e5}) for joint in found.robot.joints
    )
    stated = found.robot.model_copy(update={"joints": joints})
    assert found.imprecise == ()
    wide = replace(found.fit, covariance=1e6 * found.fit.covariance)
    weak = replace(found, robot=stated, fit=wide)
    assert weak.imprecise == (1, 2)
    corrected = corrected_robot(weak, is_tool=True)
    assert [joint.stiffness_nm_rad for joint in corrected.joints] == [1.5e5] * 3
