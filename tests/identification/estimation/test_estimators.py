"""Simulate, then estimate: intervals cover the known parameters as often as stated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.processing.periods import average_periods
from acquisition.processing.smoothing import SmoothedSignals
from acquisition.recording.recording import Recording
from config.cell.torque_filter import ButterworthFilter
from config.errors import EstimationError
from dynamics.model.robot_model import torque
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.equations import time_domain as time_equations
from identification.estimation.estimate import Estimate, predict
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

Measure = Callable[..., Recording]
Run = Callable[..., Recording]
FILTER = ButterworthFilter(order=8, cutoff_hz=40.0)


def deviations(estimates: list[Estimate], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return errors divided by standard deviations from the measured noise, (estimates, b)."""
    found = []
    for estimate in estimates:
        assert estimate.sigma_noise is not None
        found.append((estimate.values - truth) / estimate.sigma_noise)
    return np.array(found)


class TestPeriodic:
    def test_without_noise_the_truth_is_recovered(self, arm: KnownArm, measure: Measure) -> None:
        recording = measure(noise_nm=0.0, encoder_step_rad=0.0, torque_filter=FILTER)
        estimate = fit_periodic(arm.robot, [average_periods(recording)]).estimate()
        scale = np.abs(arm.base) + 0.1
        np.testing.assert_allclose(estimate.values / scale, arm.base / scale, atol=2e-4)

    @pytest.mark.parametrize("standstill_rad_s", [0.0, 0.02])
    def test_two_sigma_cover_the_truth_with_filter_noise_and_rounding(
        self, arm: KnownArm, measure: Measure, standstill_rad_s: float
    ) -> None:
        """Friction changes sign between samples, and the 40 Hz filter delays it by 20 ms."""
        estimates = [
            fit_periodic(
                arm.robot,
                [average_periods(measure(seed, torque_filter=FILTER))],
                EstimationOptions(standstill_rad_s=standstill_rad_s),
            ).estimate()
            for seed in range(8)
        ]
        z = deviations(estimates, arm.base)
        assert np.mean(np.abs(z) < 2.0) >= 0.92
        assert 0.7 < np.sqrt(np.mean(z**2)) < 1.15  # neither too narrow nor too wide

    def test_residual_intervals_agree_with_noise_intervals_for_a_correct_model(
        self, arm: KnownArm, measure: Measure
    ) -> None:
        estimate = fit_periodic(
            arm.robot, [average_periods(measure(1, torque_filter=FILTER))]
        ).estimate()
        assert estimate.sigma_noise is not None
        assert estimate.noise_nm is not None
        ratio = estimate.sigma_residual / estimate.sigma_noise
        assert np.median(ratio) == pytest.approx(1.0, abs=0.25)
        np.testing.assert_allclose(estimate.residual_nm, estimate.noise_nm, rtol=0.3)

    def test_residual_intervals_are_wider_for_a_wrong_model(
        self, arm: KnownArm, measure: Measure
    ) -> None:
        """The model lacks the robot's spring: intervals from noise alone would be too narrow."""
        average = average_periods(measure(1))
        estimate = fit_periodic(
            arm.robot, [average], EstimationOptions(model=ModelOptions(spring=False))
        ).estimate()
        assert estimate.sigma_noise is not None
        assert np.median(estimate.sigma_residual / estimate.sigma_noise) > 2.0
        assert np.median(estimate.sigma / estimate.sigma_noise) > 10.0

    @pytest.mark.slow
    def test_two_sigma_cover_the_truth_of_a_robot_with_stiction_at_every_reversal(
        self, arm: KnownArm, run: Run
    ) -> None:
        """The simulated robot with its servo loops: Pinocchio's equations, stiction, encoders."""
        motion = design_two_harmonic(
            arm.robot,
            TwoHarmonicOptions(5.0, highest_harmonic=6, tries=50, seed=3, periods=8),
            0.008,
        )
        samples = motion.plan(arm.robot, 0.008)
        estimates = [
            fit_periodic(arm.robot, [average_periods(run(samples, seed))]).estimate()
            for seed in range(4)
        ]
        z = deviations(estimates, arm.base)
        assert np.mean(np.abs(z) < 2.0) >= 0.9
        for estimate in estimates:
            assert np.mean(np.abs(estimate.values - arm.base) < 2.0 * estimate.sigma) >= 0.9

    def test_using_sign_at_stiction_invalidates_the_intervals(
        self, arm: KnownArm, run: Run
    ) -> None:
        samples = arm.motion.plan(arm.robot, 0.008)
        average = average_periods(run(samples, 0))
        trusting, careful = (
            deviations(
                [
                    fit_periodic(
                        arm.robot, [average], EstimationOptions(standstill_rad_s=speed)
                    ).estimate()
                ],
                arm.base,
            )
            for speed in (0.0, 0.02)
        )
        assert np.sqrt(np.mean(trusting**2)) > 4.0 * np.sqrt(np.mean(careful**2))

    def test_two_runs_together_are_more_certain_than_one(
        self, arm: KnownArm, measure: Measure
    ) -> None:
        averages = [average_periods(measure(seed)) for seed in (1, 2)]
        one = fit_periodic(arm.robot, averages[:1]).estimate()
        both = fit_periodic(arm.robot, averages).estimate()
        assert both.sigma_noise is not None
        assert one.sigma_noise is not None
        assert np.median(both.sigma_noise / one.sigma_noise) == pytest.approx(
            np.sqrt(0.5), abs=0.08
        )
        assert both.periods == 2 * one.periods
        assert both.equations > 1.9 * one.equations

    def test_friction_drift_between_periods_widens_the_intervals(
        self, arm: KnownArm, measure: Measure
    ) -> None:
        steady = measure(1)
        drift = np.linspace(-1.0, 1.0, len(steady))[:, np.newaxis]
        velocity = np.gradient(steady.position, steady.time_s, axis=0)
        drifting = replace(steady, torque_nm=steady.torque_nm + 2.0 * drift * np.sign(velocity))
        sigma = {}
        for name, recording in (("steady", steady), ("drifting", drifting)):
            estimate = fit_periodic(arm.robot, [average_periods(recording)]).estimate()
            assert estimate.sigma_noise is not None
            sigma[name] = dict(zip(estimate.base.names, estimate.sigma_noise, strict=True))
        assert sigma["drifting"]["fc_axis2"] > 1.5 * sigma["steady"]["fc_axis2"]

    def test_an_axis_at_rest_loses_only_its_own_parameters(
        self, arm: KnownArm, measure: Measure
    ) -> None:
        still = arm.motion.joints[0].model_copy(
            update={"sine": (0.0,), "cosine": (0.0,), "offset": 0.1}
        )
        motion = FourierMotion(
            kind="fourier", robot="ir361", period_s=5.0, joints=(still, *arm.motion.joints[1:])
        )
        average = average_periods(measure(motion=motion))
        estimate = fit_periodic(arm.robot, [average]).estimate()
        assert [each.joint for each in estimate.still] == ["axis1"]
        assert "fc_axis1" in estimate.base.unseen
        assert "fc_axis2" in estimate.base.names


class TestSmoothed:
    @pytest.fixture
    def signals(self, arm: KnownArm) -> SmoothedSignals:
        trajectory = arm.motion.trajectory(arm.robot, 0.01)
        times = np.arange(3000, dtype=np.float64) * 0.01
        q, v, a = (
            f(times) for f in (trajectory.position, trajectory.velocity, trajectory.acceleration)
        )
        noise = np.random.default_rng(0).normal(size=q.shape) * np.array([1.0, 2.0, 0.3])
        return SmoothedSignals(
            joint_names=arm.robot.joint_names,
            time_s=times,
            position=q,
            velocity=v,
            acceleration=a,
            torque_nm=torque(arm.model, q, v, a, arm.standard) + noise,
            segment=np.zeros(len(times), dtype=np.int64),
            sample_period_s=0.01,
            cutoff_hz=50.0,
        )

    def test_the_truth_is_within_the_intervals(
        self, arm: KnownArm, signals: SmoothedSignals
    ) -> None:
        estimate = fit_smoothed(arm.robot, [signals]).estimate()
        z = (estimate.values - arm.base) / estimate.sigma
        assert np.mean(np.abs(z) < 2.5) >= 0.9
        assert estimate.covariance_noise is None
        np.testing.assert_allclose(estimate.residual_nm, [1.0, 2.0, 0.3], rtol=0.05)

    def test_slow_samples_are_excluded_and_counted(
        self, arm: KnownArm, signals: SmoothedSignals
    ) -> None:
        """Samples below 0.05 rad/s must not affect the estimate."""
        slow = np.abs(signals.velocity) < 0.05
        spoilt = replace(signals, torque_nm=np.where(slow, 1000.0, signals.torque_nm))
        clean, other = (
            fit_smoothed(arm.robot, [s], EstimationOptions(standstill_rad_s=0.05)).estimate()
            for s in (signals, spoilt)
        )
        np.testing.assert_array_equal(clean.values, other.values)
        np.testing.assert_allclose(clean.left_out_fraction, slow.mean(axis=0))

    def test_small_blocks_give_the_same_estimate(
        self, arm: KnownArm, signals: SmoothedSignals, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        whole = fit_smoothed(arm.robot, [signals, signals]).estimate()
        monkeypatch.setattr(time_equations, "BLOCK_ROWS", 137)
        blocks = fit_smoothed(arm.robot, [signals, signals]).estimate()
        np.testing.assert_allclose(blocks.values, whole.values, rtol=1e-7)
        np.testing.assert_allclose(blocks.sigma_residual, whole.sigma_residual, rtol=1e-7)

    def test_another_robot_s_recording_is_refused(
        self, arm: KnownArm, signals: SmoothedSignals
    ) -> None:
        renamed = replace(signals, joint_names=("a", "b", "c"))
        with raises_code(EstimationError, "RID-ROBOT-OTHER"):
            fit_smoothed(arm.robot, [renamed]).estimate()


def test_a_prediction_is_the_torque_of_the_model(arm: KnownArm, measure: Measure) -> None:
    estimate = fit_periodic(arm.robot, [average_periods(measure())]).estimate()
    exact = replace(estimate, values=arm.base)
    q, v, a = np.random.default_rng(0).normal(size=(3, 5000, 3))  # more rows than one block
    np.testing.assert_allclose(
        predict(exact, q, v, a), torque(arm.model, q, v, a, arm.standard), atol=1e-8
    )


def test_an_estimate_with_the_wrong_number_of_values_is_refused(
    arm: KnownArm, measure: Measure
) -> None:
    estimate = fit_periodic(arm.robot, [average_periods(measure())]).estimate()
    with raises_code(EstimationError, "RID-API-ARGUMENT", "estimate values", "(3,)"):
        replace(estimate, values=np.zeros(3))
