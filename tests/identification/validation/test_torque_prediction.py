from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from acquisition.motion.kinds.multipoint import MultipointMotion
from acquisition.motion.samples import MotionSamples
from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from config.errors import DataQualityError, EstimationError
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.validation.diagnosis import diagnose
from identification.validation.torque_prediction import Validation, validate_torques
from rid_daq.report.sections.validation import ValidationSection
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

Measure = Callable[..., Recording]
Run = Callable[[MotionSamples, int], Recording]


@pytest.fixture(scope="module")
def identified(arm: KnownArm, run: Run) -> Estimate:
    return fit_periodic(
        arm.robot, [average_periods(run(arm.motion.plan(arm.robot, 0.008), 0))]
    ).estimate()


@pytest.fixture(scope="module")
def other_run(arm: KnownArm, run: Run) -> Recording:
    motion = MultipointMotion(kind="multipoint", robot="ir361", points=6, seed=5)
    return run(motion.plan(arm.robot, 0.008), 7)


@pytest.fixture(scope="module")
def validation(identified: Estimate, other_run: Recording) -> Validation:
    return validate_torques(identified, other_run, limits_percent=(10.0, 10.0, 10.0))


def test_an_estimate_predicts_another_run_as_well_as_true_parameters(
    arm: KnownArm, identified: Estimate, other_run: Recording, validation: Validation
) -> None:
    truth = validate_torques(replace(identified, values=arm.base), other_run)
    assert (validation.rms_nm < 1.1 * truth.rms_nm).all()
    assert (validation.relative_percent < 3.0).all()
    assert validation.passed is True


def test_errors_are_those_of_moving_samples(validation: Validation) -> None:
    error = validation.measured_nm - validation.predicted_nm
    for joint in range(3):
        rows = validation.counted[:, joint]
        rms = np.sqrt(np.mean(error[rows, joint] ** 2))
        assert validation.rms_nm[joint] == pytest.approx(rms)
        measured = np.sqrt(np.mean(validation.measured_nm[rows, joint] ** 2))
        assert validation.relative_percent[joint] == pytest.approx(100.0 * rms / measured)
    assert (validation.counted_fraction > 0.5).all()
    # At standstill friction is stiction, which no model of sign(v) predicts.
    assert (validation.all_samples_percent > validation.relative_percent).all()


def test_an_exceeded_limit_fails_the_run(identified: Estimate, other_run: Recording) -> None:
    strict = validate_torques(identified, other_run, limits_percent=(10.0, 0.01, 10.0))
    assert strict.verdicts == (True, False, True)
    assert strict.passed is False
    assert validate_torques(identified, other_run).passed is None


def test_the_lag_of_the_anti_alias_filter_is_compensated(
    identified: Estimate, other_run: Recording, validation: Validation
) -> None:
    without_filter = validate_torques(identified, replace(other_run, torque_filter=None))
    assert (without_filter.rms_nm > 3.0 * validation.rms_nm).all()


def test_the_noise_floor_is_the_noise_within_the_band(
    identified: Estimate, other_run: Recording
) -> None:
    result = validate_torques(
        identified, other_run, cutoff_hz=10.0, noise_nm=np.array([1.0, 2.0, 3.0])
    )
    assert result.noise_nm is not None
    # the cut-off keeps 10 Hz of the 62.5 Hz of the white noise
    np.testing.assert_allclose(result.noise_nm, np.sqrt(0.16) * np.array([1.0, 2.0, 3.0]))


def test_a_joint_at_rest_has_no_error_and_no_verdict(
    arm: KnownArm, identified: Estimate, measure: Measure
) -> None:
    still = arm.motion.joints[1].model_copy(update={"sine": (0.0,), "cosine": (0.0,)})
    motion = arm.motion.model_copy(
        update={"joints": (arm.motion.joints[0], still, arm.motion.joints[2])}
    )
    result = validate_torques(identified, measure(motion=motion), limits_percent=(9.0, 9.0, 9.0))
    assert np.isnan(result.relative_percent[1])
    assert result.verdicts == (True, None, True)
    assert result.passed is True
    known_noise = replace(result, noise_nm=np.ones(3))
    section = ValidationSection.of(known_noise, arm.robot, "A joint rests.")
    assert section.axes[1].over_noise is None
    assert section.axes[0].over_noise == pytest.approx(result.rms_nm[0])
    assert len(diagnose(identified, known_noise)[1].sentence) > 0


def test_a_recording_at_rest_is_refused(identified: Estimate, other_run: Recording) -> None:
    rest = replace(other_run, position=np.zeros_like(other_run.position))
    with raises_code(DataQualityError, "RID-RUN-STILL"):
        validate_torques(identified, rest)


def test_another_robot_s_recording_is_refused(identified: Estimate, other_run: Recording) -> None:
    with raises_code(EstimationError, "RID-ROBOT-OTHER", "axis1"):
        validate_torques(identified, replace(other_run, joint_names=("a", "b", "c")))


def test_limits_for_other_joints_are_refused(identified: Estimate, other_run: Recording) -> None:
    with raises_code(EstimationError, "RID-OPTION-COUNT"):
        validate_torques(identified, other_run, limits_percent=(1.0, 2.0))
