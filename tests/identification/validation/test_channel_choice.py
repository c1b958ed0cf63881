"""Torque channel of single joints: values within bounds, and a decision by majority."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.processing.torque_channel import TorqueChannel
from benchmarks.honest_choice import BAND_HZ, DURATION_S, FRICTIONS, Case, recording
from benchmarks.known_arms import ARMS, drive
from identification.equations.block_grams import PLAIN, Grams
from identification.equations.candidate_equations import CandidateEquations, Reach
from identification.equations.friction_columns import FLEXIBLE
from identification.estimation.options import EstimationOptions
from identification.model.base_parameters import base_parameters
from identification.validation.channel_choice import (
    AFTER_STANDSTILL_S,
    JointChannel,
    JointEquations,
    accepted_channel,
    fit_joint,
)

TRUE_LAG_S = 1.0 / (16.0 * np.pi)  # a first-order filter at 8 Hz
BLOCKS = 20


@cache
def equations(standstill_rad_s: float) -> CandidateEquations:
    case, robot = Case("three", "load", "lag8", 201), ARMS["three"].description()
    options = EstimationOptions()
    runs = [
        recording(case, drive("three", "points", 2010 + k, FRICTIONS["load"], DURATION_S), k, robot)
        for k in range(2)
    ]
    signals = [smooth_nonperiodic(run, BAND_HZ) for run, _ in runs]
    plain = replace(options.model, friction=False, friction_terms=None, nonlinear=None)
    model = plain.build(robot)
    return CandidateEquations.of(model, base_parameters(model), signals, standstill_rad_s)


@pytest.fixture(scope="module")
def sticking() -> JointEquations:
    """A heavily loaded joint with a lag, for which a negative delay would fit best."""
    plain = equations(EstimationOptions().standstill_rad_s)
    grams = Grams.of(plain, TorqueChannel.none(3), 2.0)
    load = np.zeros(len(plain.base))
    load[grams.rigid] = grams.fit([PLAIN] * 3).values[: len(grams.rigid)]
    load[[name.startswith("Im") for name in plain.base.names]] = 0.0
    loaded = plain.with_gear_load(load)
    return JointEquations(loaded, 1, FLEXIBLE, Reach(0.0, AFTER_STANDSTILL_S), 2.0)


def test_a_joint_that_reverses_between_two_rows_counts_as_slow() -> None:
    piece = equations(1e-6).pieces[0]
    turns = piece.speed[1:] * piece.speed[:-1] < 0.0
    assert np.count_nonzero(turns) > 20
    assert piece.slow[1:][turns].all()
    assert piece.slow[:-1][turns].all()


def test_with_the_delay_at_its_bound_the_lag_equals_that_without_a_delay(
    sticking: JointEquations,
) -> None:
    alone = fit_joint(sticking, {"lag": 0.02})
    both = fit_joint(sticking, {"delay": 0.0, "lag": 0.02})
    assert both.values_s["delay"] == 0.0
    assert both.values_s["lag"] == pytest.approx(alone.values_s["lag"], abs=1e-5)
    assert both.sigma_s["lag"] == pytest.approx(alone.sigma_s["lag"], rel=0.01)
    np.testing.assert_allclose(both.errors, alone.errors, rtol=0.01)
    assert abs(alone.values_s["lag"] - TRUE_LAG_S) < 3.0 * alone.sigma_s["lag"]


def test_a_value_at_its_lower_bound_is_not_distinct_from_zero(sticking: JointEquations) -> None:
    both = fit_joint(sticking, {"delay": 0.0, "lag": 0.02})
    assert both.sigma_s["delay"] == np.inf


def lag_channel(lag_s: float, moving_error: float) -> JointChannel:
    return JointChannel({"lag": lag_s}, {"lag": 1e-4}, np.ones(BLOCKS), moving_error)


def width_channel(width_s: float, moving_error: float) -> JointChannel:
    return JointChannel({"width": width_s}, {"width": 1e-4}, np.ones(BLOCKS), moving_error)


NONE = [JointChannel({}, {}, np.ones(BLOCKS), 1.0)] * 3


def test_a_joint_with_stiction_gets_its_lag_if_most_joints_show_one() -> None:
    found = accepted_channel(
        [lag_channel(0.02, 0.1), lag_channel(0.021, 0.6), lag_channel(0.02, 1.2)], NONE
    )
    assert found.lag_s.tolist() == [0.02, 0.021, 0.02]


def test_a_lag_that_few_joints_show_away_from_reversals_is_rejected() -> None:
    found = accepted_channel(
        [lag_channel(0.02, 0.1), lag_channel(0.02, 1.1), lag_channel(0.02, 1.2)], NONE
    )
    assert not found.changes


@pytest.mark.parametrize("value_s", [0.05, -0.05, 0.0495])
def test_a_delay_at_the_end_of_its_range_is_a_bound(value_s: float) -> None:
    better = [0.25 * np.ones(BLOCKS), np.ones(BLOCKS)]
    fits = [JointChannel({"delay": value_s}, {"delay": 1e-4}, each, 0.1) for each in better]
    found = accepted_channel(fits, NONE[:2])
    assert found.delay_s.tolist() == [value_s, 0.0], "the second joint's error does not fall"
    assert found.delay_sigma_s.tolist() == [abs(value_s), 0.0]


def test_a_lag_at_the_end_of_its_range_is_a_bound() -> None:
    fit = JointChannel({"lag": 0.08}, {"lag": 1e-4}, 0.25 * np.ones(BLOCKS), 0.1)
    found = accepted_channel([fit] * 3, NONE)
    assert found.lag_sigma_s.tolist() == found.lag_s.tolist() == [0.08] * 3


def test_a_zero_phase_filter_needs_evidence_away_from_reversals_on_each_joint() -> None:
    found = accepted_channel(
        [width_channel(0.02, 0.1), width_channel(0.02, 0.1), width_channel(0.02, 1.2)], NONE
    )
    assert found.width_s.tolist() == [0.02, 0.02, 0.0]
