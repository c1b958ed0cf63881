"""Identification on recordings of a real robot (UR10e) without simulated data."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap, RowRange
from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.recording.recording import Recording
from config.load import load_bundled_or_path, load_robot
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed
from identification.validation.torque_prediction import validate_torques

CUTOFF_HZ = 9.4
LIMITS_PERCENT = (9.6, 3.8, 4.0, 4.4, 7.0, 7.0)

Read = Callable[[str, int, int], Recording]


@pytest.fixture(scope="module")
def read(real_robot: Path) -> Read:
    layout = load_bundled_or_path("ur10e_31", "maps", ImportMap)

    def of(name: str, first: int, last: int) -> Recording:
        rows = layout.model_copy(update={"rows": RowRange(first=first, last=last)})
        return import_csv(real_robot / f"ur-{name}.csv", rows)[0]

    return of


@pytest.fixture(scope="module")
def long_run(read: Read) -> Estimate:
    recording = read("20_02_12-50sec_12harm", 355, 5090)
    return fit_smoothed(load_robot("ur10e"), [smooth_nonperiodic(recording, CUTOFF_HZ)]).estimate()


@pytest.fixture(scope="module")
def short_run(read: Read) -> Estimate:
    recording = read("20_02_10-30sec_12harm", 635, 3510)
    return fit_smoothed(load_robot("ur10e"), [smooth_nonperiodic(recording, CUTOFF_HZ)]).estimate()


def test_a_model_of_one_motion_predicts_another(long_run: Estimate, read: Read) -> None:
    other = read("20_01_17-ptp_10_points", 700, 4200)
    result = validate_torques(long_run, other, cutoff_hz=CUTOFF_HZ, limits_percent=LIMITS_PERCENT)
    assert result.passed, result.relative_percent
    # Joint 6 is at rest in stiction for half of the time; this error is not counted.
    assert result.counted_fraction[5] < 0.6
    assert result.all_samples_percent[5] > 30.0


def test_two_motions_agree_within_their_intervals(long_run: Estimate, short_run: Estimate) -> None:
    rigid = np.array(long_run.base.rigid_body)
    assert rigid.sum() == 36
    z = (long_run.values - short_run.values) / np.hypot(long_run.sigma, short_run.sigma)
    assert np.mean(np.abs(z[rigid]) < 2.0) >= 0.9


def test_presliding_hysteresis_predicts_the_holding_torque_at_rest(
    long_run: Estimate, read: Read
) -> None:
    """Friction holds the last wrist joint at rest for half of the validation motion."""
    robot = load_robot("ur10e")
    friction = ("coulomb", "viscous", "offset", "presliding")
    partly = {"friction": friction, "presliding_distance": 1e-3, "presliding_share": 0.5}
    wrist = [joint.model_copy(update=partly) for joint in robot.joints[3:]]
    with_memory = robot.model_copy(update={"joints": (*robot.joints[:3], *wrist)})
    recording = read("20_02_12-50sec_12harm", 355, 5090)
    estimate = fit_smoothed(with_memory, [smooth_nonperiodic(recording, CUTOFF_HZ)]).estimate()
    found, sigma = estimate.model.nonlinear_values, estimate.nonlinear_sigma
    distances, shares = np.split(found, 2)
    assert np.all((distances > 7e-4) & (distances < 2.5e-3)), distances
    assert np.all((shares > 0.3) & (shares < 0.6)), "half of the friction is rigid"
    assert np.all(found > 5.0 * sigma)
    assert np.all(estimate.left_out_fraction[3:] < 0.06), (
        "more than the middle of each pause is left out"
    )
    # This residual includes rest and reversals; that of `long_run` does not.
    assert np.all(estimate.residual_nm[3:] < 1.25 * long_run.residual_nm[3:])
    other = read("20_01_17-ptp_10_points", 700, 4200)
    result = validate_torques(estimate, other, cutoff_hz=CUTOFF_HZ, limits_percent=LIMITS_PERCENT)
    assert result.passed, result.relative_percent
    assert result.all_samples_percent[4] < 10.0
    assert result.all_samples_percent[5] < 18.0
