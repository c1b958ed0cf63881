"""A model of the links from the motion of the motors, if the gears are elastic."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.processing.periods import PeriodAverage
from acquisition.recording.recording import Recording
from compensation.feedforward.motor_reference import motor_reference
from config.errors import EstimationError
from config.load import load_cell
from config.robot.robot import RobotDescription
from identification.elasticity import elastic_fit
from identification.elasticity.elastic_fit import fit_elastic, rigid_averages
from identification.elasticity.gear_torque import gear_torque
from identification.elasticity.transmitted_torque import transmitted_torque
from identification.estimation.estimate import Estimate
from identification.estimation.file import estimate_content, estimate_document
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from identification.payload.carried import carry_own, without_payload
from identification.payload.equations import Procedure
from identification.payload.periodic_runs import PeriodicRuns
from identification.payload.procedures import PayloadOptions, identify_payload
from identification.payload.rigid_runs import rigid_runs
from identification.validation.torque_prediction import pool_validations, validate_torques
from tests.builders.certified import MEDIUM
from tests.builders.known_model import known_estimate, with_payload_columns
from tests.builders.raised_codes import raises_code

CELL, STEP_S = load_cell("ir361"), 0.004
STIFFNESS, DAMPING, MOTORS = (5e4, 6e4, 2e4), (100.0, 110.0, 25.0), (7.0, 14.0, None)
SIZES = np.array([0.25, 0.1, 0.0, 0.06, 0.0, 0.03, 0.0, 0.02, 0.0, 0.02])
"""Largest sine and cosine coefficients of a joint, per harmonic [rad]."""

OPTIONS = EstimationOptions(model=ModelOptions(payload=True))


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    """Return ir361 with the stiffness of its gears."""
    joints = tuple(
        joint.model_copy(
            update={"stiffness_nm_rad": k, "damping_nm_s": d, "motor_inertia_kg_m2": inertia}
        )
        for joint, k, d, inertia in zip(CELL.robot.joints, STIFFNESS, DAMPING, MOTORS, strict=True)
    )
    return CELL.robot.model_copy(update={"joints": joints})


@pytest.fixture(scope="module")
def truth() -> Estimate:
    """Return the true parameters of the arm and of its payload."""
    return with_payload_columns(known_estimate(CELL, {}))


@pytest.fixture(scope="module")
def planned() -> MotionSamples:
    """Return an excitation of two periods."""
    random, joints = np.random.default_rng(2), []
    for name in CELL.robot.joint_names:
        sine, cosine = random.uniform(-1.0, 1.0, (2, 10)) * SIZES
        joints.append(FourierJoint(joint=name, offset=0.1, sine=tuple(sine), cosine=tuple(cosine)))
    motion = FourierMotion(
        kind="fourier", robot="ir361", period_s=5.0, periods=2, joints=tuple(joints)
    )
    return motion.plan(CELL.robot, STEP_S).whole()


@pytest.fixture(scope="module")
def averages(
    planned: MotionSamples, robot: RobotDescription, truth: Estimate
) -> list[PeriodAverage]:
    """Return the mean periods that the motors of the arm measure, without and with the payload."""
    rows = planned.samples_per_period
    assert rows is not None
    found = []
    for model in (without_payload(truth), carry_own(truth)):
        reference = motor_reference(planned, model, robot)
        last = np.flatnonzero(planned.phase == Phase.MAIN)[-rows:]
        noise = np.full((rows // 2 + 1, 3), 1e-4)
        found.append(
            PeriodAverage(
                joint_names=robot.joint_names,
                sample_period_s=STEP_S,
                position=reference.samples.position[last],
                torque_nm=reference.torque_nm[last],
                position_variance=np.full(3, 1e-14),
                torque_variance=np.full(3, 1e-2),
                position_bin_variance=1e-12 * noise,
                torque_bin_variance=noise,
                periods_kept=4,
            )
        )
    return found


def torque_error(fitted: Estimate, truth: Estimate, robot: RobotDescription) -> float:
    """Return the largest relative error (RMS) of the links' torque in other poses, loaded."""
    random = np.random.default_rng(5)
    motion = (
        random.uniform(-0.4, 0.4, (200, 3)),
        random.normal(size=(200, 3)),
        3.0 * random.normal(size=(200, 3)),
    )
    found, true = (
        transmitted_torque(each, robot, *motion, payload=True) for each in (fitted, truth)
    )
    return float(np.max(np.std(found - true, axis=0) / np.std(true, axis=0)))


def test_the_model_is_that_of_the_links(
    averages: list[PeriodAverage], robot: RobotDescription, truth: Estimate
) -> None:
    payload = (False, True)
    rigid = fit_elastic(CELL.robot, averages, OPTIONS, payload=payload).estimate()
    elastic = fit_elastic(robot, averages, OPTIONS, payload=payload).estimate()
    assert torque_error(rigid, truth, robot) > 0.03
    assert torque_error(elastic, truth, robot) < 0.01


@pytest.mark.parametrize("loaded", [False, True])
def test_a_model_of_the_links_predicts_the_torques_of_the_motors(
    planned: MotionSamples, robot: RobotDescription, truth: Estimate, loaded: bool
) -> None:
    links = replace(truth, robot=robot, gear_torque_nm=np.ones(3))
    links = carry_own(links) if loaded else without_payload(links)
    reference = motor_reference(planned, links, robot)
    recording = Recording(
        joint_names=robot.joint_names,
        time_s=STEP_S * np.arange(len(planned), dtype=np.float64),
        position=reference.samples.position,
        torque_nm=reference.torque_nm,
        valid=np.full(len(planned), True),
        phase=planned.phase,
        sample_index=np.arange(len(planned)),
        source="cell",
        sample_period_s=STEP_S,
    )
    elastic = validate_torques(links, recording)
    rigid = validate_torques(replace(links, gear_torque_nm=None), recording)
    assert rigid.gear_torque_nm is None
    assert elastic.gear_torque_nm == pytest.approx(rigid.rms_nm, rel=0.1)
    assert (rigid.rms_nm > 0.05).all()
    assert (elastic.rms_nm < 0.1 * rigid.rms_nm).all()
    pooled = pool_validations([elastic, elastic], None)
    assert pooled.gear_torque_nm == pytest.approx(elastic.gear_torque_nm)


def test_a_model_file_states_that_the_model_is_that_of_the_links(
    averages: list[PeriodAverage], robot: RobotDescription
) -> None:
    rigid, elastic = (fit_elastic(each, averages[:1]).estimate() for each in (CELL.robot, robot))
    assert rigid.gear_torque_nm is None
    assert elastic.gear_torque_nm is not None
    assert (elastic.gear_torque_nm > 0.05).all()
    data = estimate_document(elastic).model_dump_json().encode()
    again = estimate_content(data, Path("model.json"))
    np.testing.assert_array_equal(again.gear_torque_nm, elastic.gear_torque_nm)


def test_with_the_torques_of_rigid_gears_a_rigid_fit_gives_the_model_of_the_links(
    averages: list[PeriodAverage], robot: RobotDescription
) -> None:
    payload = [False, True]
    links = fit_elastic(robot, averages, OPTIONS, payload=payload).estimate()
    rigid = rigid_averages(links, averages, payload=payload)
    again = fit_periodic(CELL.robot, rigid, OPTIONS, payload=payload).estimate()
    motors = fit_periodic(CELL.robot, averages, OPTIONS, payload=payload).estimate()
    far, near = (np.abs(each.values - links.values) / links.sigma for each in (motors, again))
    assert near.max() < 0.05 * far.max()
    assert rigid_averages(motors, averages) == averages


@pytest.mark.parametrize("procedure", ["together", "model", "apart"])
def test_a_payload_on_elastic_gears_is_that_on_rigid_ones(
    averages: list[PeriodAverage], robot: RobotDescription, procedure: Procedure
) -> None:
    links = fit_elastic(robot, averages[:1]).estimate()
    how = PayloadOptions(procedure, robot=links if procedure == "model" else None)
    measured = PeriodicRuns(tuple(averages), (False, True), 10.0, 0.02)
    if procedure == "model":
        measured = measured.part([1])
    converted = rigid_runs(robot, measured, how)
    as_rigid, found = (
        identify_payload(robot, runs, how).reported - MEDIUM.reported
        for runs in (measured, converted)
    )
    centre, inertia = slice(1, 4), slice(4, 10)
    assert np.linalg.norm(found[centre]) < 0.3 * np.linalg.norm(as_rigid[centre])
    assert np.linalg.norm(found[inertia]) < 0.2 * np.linalg.norm(as_rigid[inertia])


def test_runs_of_rigid_gears_are_not_changed(
    averages: list[PeriodAverage], robot: RobotDescription
) -> None:
    runs = PeriodicRuns(tuple(averages), (False, True), 10.0, 0.02)
    assert rigid_runs(CELL.robot, runs, PayloadOptions()) is runs
    motors = fit_elastic(CELL.robot, averages[:1]).estimate()
    assert rigid_runs(robot, runs, PayloadOptions(robot=motors)) is runs


def test_one_elastic_gear_is_enough(averages: list[PeriodAverage], robot: RobotDescription) -> None:
    joints = (*CELL.robot.joints[:2], robot.joints[2])
    one = CELL.robot.model_copy(update={"joints": joints})
    fits = [fit_elastic(each, averages[:1]).estimate() for each in (CELL.robot, one)]
    assert np.isfinite(fits[1].values).all()
    assert np.abs(fits[1].values - fits[0].values).max() > 1e-4


def test_fits_that_have_not_converged_are_refused(
    averages: list[PeriodAverage], robot: RobotDescription, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(elastic_fit, "MOST_FITS", 1)
    with raises_code(EstimationError, "RID-STIFFNESS-UNSETTLED"):
        fit_elastic(robot, averages[:1])


def test_a_deflection_that_does_not_converge_is_refused(
    planned: MotionSamples, robot: RobotDescription, truth: Estimate
) -> None:
    """A stiffness of 100 N m/rad is too small for the weight of the arm."""
    joints = [joint.model_copy(update={"stiffness_nm_rad": 100.0}) for joint in robot.joints]
    soft = robot.model_copy(update={"joints": tuple(joints)})
    links = without_payload(replace(truth, robot=soft, gear_torque_nm=np.ones(3)))
    with raises_code(EstimationError, "RID-STIFFNESS-UNSETTLED"):
        gear_torque(links, np.asarray(planned.position), STEP_S)
