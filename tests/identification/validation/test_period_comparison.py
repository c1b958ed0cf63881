from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from acquisition.signals.bins import from_bins, to_bins
from config.cell.torque_filter import ButterworthFilter
from identification.equations.segments import period_signals
from identification.estimation.estimate import predict
from identification.estimation.fitted_periods import fit_periodic
from identification.validation.period_comparison import compare_period
from rid_daq.report.sections.curves import TorqueCurves

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm


def test_a_true_model_leaves_only_noise(arm: KnownArm, measure: Callable[..., Recording]) -> None:
    average = average_periods(measure(torque_filter=ButterworthFilter(order=8, cutoff_hz=40.0)))
    comparison = compare_period(fit_periodic(arm.robot, [average]).estimate(), average)
    samples, bins = average.samples_per_period, len(comparison.frequency_hz)
    assert comparison.frequency_hz[-1] == 10.0
    assert comparison.measured_nm.shape == comparison.predicted_nm.shape == (samples, 3)
    assert comparison.residual_spectrum_nm.shape == (bins, 3)

    error = comparison.measured_nm - comparison.predicted_nm
    # Parseval: the spectrum has the same energy as the signal.
    for signal, spectrum in (
        (error, comparison.residual_spectrum_nm),
        (comparison.measured_nm, comparison.measured_spectrum_nm),
    ):
        np.testing.assert_allclose(
            np.mean(signal**2, axis=0), np.sum(spectrum**2, axis=0), rtol=1e-9
        )
    residual, noise, measured = (
        np.sqrt(np.sum(spectrum**2, axis=0))
        for spectrum in (
            comparison.residual_spectrum_nm,
            comparison.noise_spectrum_nm,
            comparison.measured_spectrum_nm,
        )
    )
    assert (residual < 1.2 * noise).all()
    assert (residual > 0.6 * noise).all()
    assert (measured > 30.0 * noise).all()


def test_the_prediction_includes_gear_losses(
    arm: KnownArm, measure: Callable[..., Recording]
) -> None:
    joints = tuple(
        joint.model_copy(update={"friction": (*joint.friction, "load")})
        for joint in arm.robot.joints
    )
    average = average_periods(measure())
    estimate = fit_periodic(arm.robot.model_copy(update={"joints": joints}), [average]).estimate()
    lossy = replace(estimate, options=replace(estimate.options, nonlinear=(0.2, 0.2, 0.2)))
    drawn = compare_period(lossy, average).predicted_nm
    signals = period_signals(average, 10.0)
    motion = (signals.position, signals.velocity, signals.acceleration)
    rows = slice(0, average.samples_per_period)
    lossy_torque, lossless_torque = (
        from_bins(to_bins(predict(each, *motion)[rows], 50), len(drawn))
        for each in (lossy, estimate)
    )
    assert np.std(drawn - lossy_torque) < 0.1 * np.std(lossy_torque - lossless_torque)


def test_the_fitted_torque_leaves_the_residual_of_the_estimate(
    arm: KnownArm, measure: Callable[..., Recording]
) -> None:
    average = average_periods(measure())
    estimate = fit_periodic(arm.robot, [average]).estimate()
    comparison = compare_period(estimate, average)
    left = comparison.measured_nm - comparison.fitted_nm
    np.testing.assert_allclose(np.sqrt(np.mean(left**2, axis=0)), estimate.residual_nm, rtol=1e-3)
    np.testing.assert_allclose(
        1.0 - comparison.counted.mean(axis=0), estimate.left_out_fraction, atol=0.01
    )
    assert (estimate.left_out_fraction > 0.0).any()
    resting = np.where(comparison.counted, 0.0, left)
    assert np.sum(resting**2) < 0.1 * np.sum(left**2)  # the fit leaves the torque free at rest


def test_the_figure_states_the_rms_of_its_counted_samples(
    arm: KnownArm, measure: Callable[..., Recording]
) -> None:
    average = average_periods(measure())
    estimate = fit_periodic(arm.robot, [average]).estimate()
    curves = TorqueCurves.of_period(estimate, compare_period(estimate, average), 4)
    for axis, residual in zip(curves.axes, estimate.residual_nm, strict=True):
        counted = np.array(axis.counted, dtype=bool)
        left = (np.array(axis.measured) - axis.predicted)[counted]
        rms = float(np.sqrt(np.mean(left**2)))
        matched = re.match(r"RMS residual \(counted\) (\S+) N m$", axis.caption)
        assert matched is not None
        assert float(matched[1]) == pytest.approx(rms, rel=0.01)
        share = float(counted.mean())
        assert rms == pytest.approx(residual / math.sqrt(share), rel=0.02)
