from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from config.cell.torque_filter import ButterworthFilter
from config.errors import DataQualityError, EstimationError
from dynamics.model.true_parameters import true_parameters
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from identification.validation.base_wrench_validation import validate_base_wrench
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

Weigh = Callable[..., Recording]
FILTER = ButterworthFilter(order=8, cutoff_hz=40.0)


@pytest.fixture(scope="module")
def estimate(arm: KnownArm, weigh: Weigh) -> Estimate:
    average = average_periods(weigh(0, torque_filter=FILTER))
    return fit_periodic(
        arm.robot, [average], EstimationOptions(model=ModelOptions(kind="combined"))
    ).estimate()


@pytest.fixture(scope="module")
def other(arm: KnownArm, weigh: Weigh) -> Recording:
    """Return another motion on a plate with offset, drift and a delay."""
    motion = design_two_harmonic(
        arm.robot, TwoHarmonicOptions(7.0, highest_harmonic=5, tries=50, seed=5, periods=4), 0.008
    )
    plate = {"offset_n": 20.0, "drift_n_s": 0.05, "delay_s": 0.002}
    return weigh(3, torque_filter=FILTER, periods=4, motion=motion, plate=plate)


def test_the_reaction_is_predicted_as_well_as_with_true_parameters(
    cell: Any, estimate: Estimate, other: Recording
) -> None:
    """The error is at most 1.3 times that with the true parameters, and 1.3 times the noise."""
    found = validate_base_wrench(estimate, other)
    truth = estimate.base.from_standard(true_parameters(estimate.model, cell.robot, cell.plant))
    floor = validate_base_wrench(replace(estimate, values=truth), other)
    assert (found.rms <= 1.3 * floor.rms).all()
    assert found.noise is not None
    assert (found.rms <= 1.3 * found.noise).all()
    assert (found.relative_percent < 1.0).all()
    assert found.delay_s == pytest.approx(0.002, abs=100e-6)
    assert "2.0" in found.sentence


def test_a_wrong_model_fails_the_validation(estimate: Estimate, other: Recording) -> None:
    wrong = estimate.values.copy()
    wrong[estimate.base.names.index("sx2")] *= 1.05
    found = validate_base_wrench(replace(estimate, values=wrong), other)
    right = validate_base_wrench(estimate, other)
    assert found.rms[4] > 3.0 * right.rms[4]


def test_overloaded_samples_are_ignored(estimate: Estimate, other: Recording) -> None:
    reaction = other.reaction
    assert reaction is not None
    valid, channels = reaction.valid.copy(), reaction.channels_n.copy()
    valid[1000:1100, 2], channels[1000:1100, 2] = False, 9999.0
    holed = replace(reaction, valid=valid, channels_n=channels)
    found = validate_base_wrench(estimate, replace(other, reaction=holed))
    plain = validate_base_wrench(estimate, other)
    assert 0.8 < found.counted.mean() < 1.0
    np.testing.assert_allclose(found.rms, plain.rms, rtol=0.1)


def test_a_plate_that_was_mostly_overloaded_is_refused(
    estimate: Estimate, other: Recording
) -> None:
    reaction = other.reaction
    assert reaction is not None
    valid = reaction.valid.copy()
    valid[:, 5] = False
    with raises_code(DataQualityError, "RID-PLATE-CHANNEL", "fz2"):
        validate_base_wrench(estimate, replace(other, reaction=replace(reaction, valid=valid)))


def test_a_plate_and_a_combined_model_are_required(
    arm: KnownArm, estimate: Estimate, other: Recording
) -> None:
    with raises_code(DataQualityError, "RID-PLATE-MISSING"):
        validate_base_wrench(estimate, replace(other, reaction=None))
    internal = fit_periodic(arm.robot, [average_periods(other)]).estimate()
    with raises_code(EstimationError, "RID-MODEL-NOT-COMBINED"):
        validate_base_wrench(internal, other)
