"""Diagnosis of a prediction error: the missing effect is named."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_robot
from dynamics.model.robot_model import RobotModel
from identification.estimation.estimate import Estimate
from identification.model.base_parameters import base_parameters
from identification.model.options import ModelOptions
from identification.validation.diagnosis import JointDiagnosis, diagnose, ljung_box
from identification.validation.torque_prediction import Validation
from tests.builders.console_blocks import assert_shown

SAMPLES = 4000
STEP_S = 0.01


@pytest.fixture(scope="module")
def estimate() -> Estimate:
    robot = load_robot("ir361")
    base = base_parameters(RobotModel.from_description(robot))
    b = len(base)
    return Estimate(
        robot=robot,
        options=ModelOptions(),
        base=base,
        values=np.zeros(b),
        covariance_noise=None,
        covariance_residual=np.eye(b),
        covariance_jackknife=np.eye(b),
        condition_number=1.0,
        equations=100,
        residual_nm=np.ones(3),
        noise_nm=None,
        left_out_fraction=np.zeros(3),
        method="smoothed",
        band_hz=10.0,
        standstill_rad_s=0.02,
    )


def validation(error: np.ndarray, noise: float | None = None) -> Validation:
    """Return a validation with white noise of 1 N m on each axis; `error` [N m] is added on the
    first.
    """
    time_s = STEP_S * np.arange(SAMPLES, dtype=np.float64)
    random = np.random.default_rng(0)
    phase = np.outer(time_s, [1.1, 1.7, 0.9]) * 2.0 * np.pi / 10.0
    q, v, a = np.sin(phase), np.cos(phase), -np.sin(phase)
    predicted = 50.0 * np.sin(phase + 1.0)
    off = random.normal(size=q.shape)
    off[:, 0] += error
    moving = np.abs(v) >= 0.02
    rms = np.sqrt(np.sum(off**2 * moving, axis=0) / moving.sum(axis=0))
    return Validation(
        joint_names=("axis1", "axis2", "axis3"),
        time_s=time_s,
        measured_nm=predicted + off,
        predicted_nm=predicted,
        position=q,
        velocity=v,
        acceleration=a,
        moving=moving,
        known=np.ones_like(moving),
        rms_nm=rms,
        relative_percent=rms,
        all_samples_percent=rms,
        noise_nm=None if noise is None else np.full(3, noise),
        cutoff_hz=50.0,
        standstill_rad_s=0.02,
    )


def test_each_missing_effect_is_named(estimate: Estimate) -> None:
    probe = validation(np.zeros(SAMPLES))
    v, load = probe.velocity[:, 0], probe.predicted_nm[:, 0]
    for shape, words, remedy in (
        (5.0 * np.sign(v), "the direction of motion", "the model has this term"),
        (0.2 * np.sign(v) * np.abs(load), "friction that grows with the load", "term load would"),
        (8.0 * np.sin(probe.position[:, 0]), "the sine of its angle", "a spring would"),
        (np.full(SAMPLES, 4.0), "a constant", "term offset would"),
    ):
        first, second, _ = diagnose(estimate, validation(shape))
        assert first.suspect == words
        assert first.suspect_share > 0.5
        assert remedy in first.sentence
        assert second.suspect == ""
    slow = diagnose(estimate, validation(5.0 * np.sign(v) * np.exp(-np.abs(v) / 0.1)))[0]
    command = "rid-daq validate model.json latest"
    assert_shown("identify-a-robot", command, slow.sentence, same_numbers=False)


def test_noise_is_diagnosed_as_noise(estimate: Estimate) -> None:
    for found in diagnose(estimate, validation(np.zeros(SAMPLES))):
        assert found.white_p > 0.001
        assert found.sentence.endswith("the residual looks like noise.")


def test_an_error_at_the_noise_floor_has_no_suspect(estimate: Estimate) -> None:
    first = diagnose(estimate, validation(np.zeros(SAMPLES), noise=1.0))[0]
    assert first.over_noise == pytest.approx(1.0, abs=0.1)
    assert first.sentence.endswith("down to the noise.")


def test_a_slow_unknown_error_is_not_noise(estimate: Estimate) -> None:
    time_s = STEP_S * np.arange(SAMPLES, dtype=np.float64)
    first = diagnose(estimate, validation(6.0 * np.sin(23.0 * time_s)))[0]
    assert first.suspect == ""
    assert first.white_p < 1e-6
    assert "is not noise" in first.sentence


def test_a_joint_at_rest_is_not_judged() -> None:
    still = JointDiagnosis("axis1", math.nan, None, math.nan, "", 0.0, "")
    assert "does not move" in still.sentence


class TestLjungBox:
    def test_ljung_box_rejects_white_residuals_as_often_as_stated(self) -> None:
        random = np.random.default_rng(2)
        rejected = [ljung_box(random.normal(size=300)) < 0.05 for _ in range(400)]
        assert 0.02 < np.mean(rejected) < 0.09

    def test_ljung_box_rejects_coloured_residuals(self) -> None:
        random = np.random.default_rng(2)
        assert ljung_box(np.cumsum(random.normal(size=300))) < 1e-12

    def test_ljung_box_gives_no_result_for_too_few_residuals(self) -> None:
        assert math.isnan(ljung_box(np.ones(10)))
        assert ljung_box(np.ones(100)) == 1.0
