"""Rows of smoothed recordings: with fewer rows, the result is nearly the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals, low_pass
from config.load import load_robot
from dynamics.model.robot_model import RobotModel, torque
from identification.equations.segments import ROWS_PER_PERIOD, thin_rows
from identification.estimation.fitted_signals import fit_smoothed

STEP_S = 0.0005
CUTOFF_HZ = 10.0


def dense_recording() -> SmoothedSignals:
    """Return 30 s of the bundled arm at 2 kHz, with noise and torque below the cut-off."""
    robot = load_robot("ir361")
    model = RobotModel.from_description(robot)
    random = np.random.default_rng(2)
    time_s = STEP_S * np.arange(60_000, dtype=np.float64)
    omega = 2.0 * np.pi / 10.0 * np.arange(1, 8)
    sine, cosine = 0.2 * random.normal(size=(2, 7, 3))
    s, c = np.sin(np.outer(time_s, omega)), np.cos(np.outer(time_s, omega))
    q, v = s @ sine + c @ cosine, (c * omega) @ sine - (s * omega) @ cosine
    a = -(s * omega**2) @ sine - (c * omega**2) @ cosine
    values = random.uniform(0.5, 20.0, len(model.parameter_names))
    measured = torque(model, q, v, a, values) + 20.0 * random.normal(size=q.shape)
    return SmoothedSignals(
        joint_names=robot.joint_names,
        time_s=time_s,
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=low_pass(measured, STEP_S, CUTOFF_HZ),
        segment=np.zeros(len(q), dtype=np.int64),
        sample_period_s=STEP_S,
        cutoff_hz=CUTOFF_HZ,
    )


def test_thinning_very_dense_rows_hardly_changes_an_estimate() -> None:
    robot, signals = load_robot("ir361"), dense_recording()
    fewer = thin_rows(signals)
    assert len(signals) == 25 * len(fewer)
    every, few = (fit_smoothed(robot, [each]).estimate() for each in (signals, fewer))
    assert (
        np.max(np.abs(few.values - every.values) / every.sigma) < 0.5
    )  # at reversals the choice of rows matters
    np.testing.assert_allclose(few.sigma, every.sigma, rtol=0.2)
    np.testing.assert_allclose(few.residual_nm, every.residual_nm, rtol=0.02)


def test_each_segment_is_thinned_from_its_first_row() -> None:
    signals = dense_recording()
    segment = np.zeros(len(signals), dtype=np.int64)
    segment[1010:] = 1
    fewer = thin_rows(replace(signals, segment=segment))
    for number, first in enumerate((0, 1010)):
        rows = fewer.segment == number
        assert fewer.time_s[rows][0] == signals.time_s[first]
        np.testing.assert_allclose(np.diff(fewer.time_s[rows]), fewer.sample_period_s)
    assert 1.0 / (fewer.sample_period_s * CUTOFF_HZ) == ROWS_PER_PERIOD


def test_necessary_rows_are_kept() -> None:
    signals = replace(dense_recording(), cutoff_hz=130.0)
    assert thin_rows(signals) is signals
    assert (
        thin_rows(thin_rows(dense_recording())).sample_period_s
        == thin_rows(dense_recording()).sample_period_s
    )
