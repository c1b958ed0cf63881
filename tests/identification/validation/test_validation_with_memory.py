"""Samples whose presliding state depends on the unknown motion before a recording are skipped."""

from __future__ import annotations

import numpy as np
import pytest

from config.arrays import FloatArray
from config.errors import DataQualityError
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed
from identification.validation.diagnosis import diagnose
from identification.validation.torque_prediction import (
    Validation,
    common_relative_errors,
    validate_torques,
)
from rid_daq.report.sections.curves import TorqueCurves
from rid_daq.report.sections.validation import AxisError, ValidationSection
from tests.builders.presliding_arm import (
    CUTOFF_HZ,
    STEP_S,
    arm,
    iwan,
    measured,
    motion,
    recording,
    with_presliding,
)
from tests.builders.raised_codes import raises_code

DISTANCE = 0.02
SPREAD = round(1.0 / (CUTOFF_HZ * STEP_S))
"""Rows in one period of the cut-off frequency."""


BEGIN = 400
"""Row long after the start, when all axes slide steadily."""


def way_of(seconds: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q, v, a of axes that move steadily for 4 s and then oscillate."""
    t = STEP_S * np.arange(round(seconds / STEP_S), dtype=np.float64)[:, np.newaxis]
    speed, omega, turns = np.array([0.2, 0.3, 0.25]), 2.0 * np.pi * 0.2, np.maximum(t - 4.0, 0.0)
    q = speed * (np.minimum(t, 4.0) + np.sin(omega * turns) / omega)
    return q, speed * np.cos(omega * turns), -speed * omega * np.sin(omega * turns)


WAY = way_of(20.0)


def directions(q: FloatArray) -> dict[int, FloatArray]:
    return {1: iwan(q[:, 1], DISTANCE)}


@pytest.fixture(scope="module")
def identified() -> Estimate:
    """Estimate of an arm with presliding in the second axis."""
    way = motion(40.0, 1)
    return fit_smoothed(
        with_presliding([1], DISTANCE), [recording(directions(way[0]), way)]
    ).estimate()


@pytest.fixture(scope="module")
def whole(identified: Estimate) -> Validation:
    return validate_torques(identified, measured(directions(WAY[0]), WAY), cutoff_hz=CUTOFF_HZ)


@pytest.fixture(scope="module")
def begun_in_motion(identified: Estimate) -> Validation:
    """The recording `whole` without its beginning: the new recording starts while the second axis
    slides.
    """
    later = measured(directions(WAY[0]), WAY, rows=slice(BEGIN, None))
    return validate_torques(identified, later, cutoff_hz=CUTOFF_HZ)


def error(validation: Validation) -> FloatArray:
    return validation.measured_nm - validation.predicted_nm


def test_a_recording_that_starts_in_motion_is_judged_after_the_state_is_known(
    whole: Validation, begun_in_motion: Validation
) -> None:
    residual, rows = error(begun_in_motion)[:, 1], len(begun_in_motion.time_s)
    truly = error(whole)[-rows:, 1]
    counted = begun_in_motion.counted[:, 1]
    assert not counted[:2].any()
    assert np.abs(residual - truly)[counted].max() < 0.1
    np.testing.assert_allclose(
        begun_in_motion.rms_nm[1], np.sqrt(np.mean(truly[counted] ** 2)), rtol=0.05
    )


def test_the_error_of_all_samples_uses_all_known_samples(begun_in_motion: Validation) -> None:
    known = begun_in_motion.known[:, 1]
    residual, torque = error(begun_in_motion)[known, 1], begun_in_motion.measured_nm[known, 1]
    assert begun_in_motion.all_samples_percent[1] == pytest.approx(
        100.0 * np.sqrt(np.mean(residual**2) / np.mean(torque**2))
    )
    assert 0 < np.count_nonzero(~known) < len(known) / 10
    assert known[-1]


def test_joints_without_presliding_are_judged_on_all_moving_samples(
    begun_in_motion: Validation,
) -> None:
    for joint in (0, 2):
        assert begun_in_motion.known[:, joint].all()
        assert (begun_in_motion.counted == begun_in_motion.moving)[:, joint].all()


def test_unknown_samples_extend_by_the_length_of_the_low_pass(begun_in_motion: Validation) -> None:
    first = reached_from(BEGIN)
    known_s = begun_in_motion.time_s[np.argmax(begun_in_motion.known[:, 1])]
    assert known_s == pytest.approx(STEP_S * (first + SPREAD), abs=2.0 * STEP_S)


def reached_from(start: int) -> int:
    """Return the number of rows from `start` until axis 2 has moved by twice `DISTANCE`."""
    position = WAY[0][start:, 1]
    reached = np.maximum.accumulate(position) - np.minimum.accumulate(position)
    return int(np.argmax(reached >= 2.0 * DISTANCE))


def test_after_a_gap_the_state_is_unknown_again(identified: Estimate) -> None:
    recorded = measured(directions(WAY[0]), WAY)
    valid = recorded.valid.copy()
    valid[BEGIN - 100 : BEGIN] = False
    gapped = type(recorded)(**{**vars(recorded), "valid": valid})
    result = validate_torques(identified, gapped, cutoff_hz=CUTOFF_HZ)
    after = int(np.argmax(np.diff(result.time_s) > 5.0 * STEP_S)) + 1
    known = result.known[:, 1]
    assert known[after - 1]
    again_s = STEP_S * (BEGIN + reached_from(BEGIN) + SPREAD)
    beyond = slice(after, after + 200)
    assert not known[beyond][result.time_s[beyond] < again_s - 2.0 * STEP_S].any()
    assert known[beyond][result.time_s[beyond] > again_s + 2.0 * STEP_S].all()
    assert result.time_s[after] < again_s - 2.0 * STEP_S
    assert np.abs(error(result)[beyond][result.counted[beyond, 1], 1]).max() < 3.0


def test_two_models_are_compared_on_samples_that_count_for_both(
    identified: Estimate, begun_in_motion: Validation
) -> None:
    way = motion(40.0, 1)
    plain = fit_smoothed(arm(), [recording(directions(way[0]), way)]).estimate()
    later = measured(directions(WAY[0]), WAY, rows=slice(BEGIN, None))
    sliding = validate_torques(plain, later, cutoff_hz=5.0)
    assert sliding.known.all()
    both = common_relative_errors(sliding, begun_in_motion)
    assert (both == common_relative_errors(begun_in_motion, sliding)[::-1]).all()
    times = begun_in_motion.time_s[begun_in_motion.counted[:, 1]]
    rows = np.isin(sliding.time_s, times) & sliding.moving[:, 1]
    rms = np.sqrt(np.mean(error(sliding)[rows, 1] ** 2))
    torque = np.sqrt(np.mean(sliding.measured_nm[rows, 1] ** 2))
    assert both[0, 1] == pytest.approx(100.0 * rms / torque)


def test_report_and_curves_state_the_number_of_skipped_samples(
    identified: Estimate, begun_in_motion: Validation
) -> None:
    section = ValidationSection.of(begun_in_motion, arm(), "Another run.")
    count = int(np.count_nonzero(~begun_in_motion.known[:, 1]))
    assert [axis.unknown_samples for axis in section.axes] == [None, count, None]
    name = arm().joint_names[1]
    assert (
        f"Samples that were left out for this reason: {count} of {name} ({count * STEP_S:.2g} s)."
        in (section.sentence)
    )
    assert section.axes[1].samples == np.count_nonzero(begun_in_motion.counted[:, 1])
    curves = TorqueCurves.of(begun_in_motion, arm())
    assert "friction is not known yet" in curves.sentence
    assert curves.axes[1].counted[0] == 0
    assert curves.axes[0].counted[0] == int(begun_in_motion.moving[0, 0])
    found = diagnose(identified, begun_in_motion)[1]
    assert found.relative_percent == begun_in_motion.relative_percent[1]


def test_an_earlier_result_without_the_number_of_skipped_samples_is_unchanged() -> None:
    earlier = {
        "joint": "axis1", "unit": "N m", "rms_torque": 9.0, "rms_error": 1.0,
        "relative_error_percent": 11.0, "all_samples_percent": 12.0, "noise": None,
        "floor": None, "error_over_floor": None, "limit_percent": None, "passed": None,
        "samples": 7,
    }  # fmt: skip
    axis = AxisError.model_validate(earlier)
    assert axis.unknown_samples is None
    assert axis.model_dump() == earlier


def test_a_recording_without_known_friction_is_refused(identified: Estimate) -> None:
    q, v, a = (values.copy() for values in WAY)
    q[:, 0], q[:, 2] = 0.0, 0.0
    turns = 0.4 * DISTANCE
    time_s = STEP_S * np.arange(len(q))
    q[:, 1] = turns * np.sin(2.0 * np.pi * 2.0 * time_s)
    recorded = measured({}, (q, 0.0 * v, 0.0 * a))
    with raises_code(DataQualityError, "RID-RUN-STILL"):
        validate_torques(identified, recorded, cutoff_hz=CUTOFF_HZ)
