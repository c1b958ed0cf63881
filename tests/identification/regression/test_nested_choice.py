"""Rules by which `--choose` adds a term to the model."""

from __future__ import annotations

import math

import numpy as np

from identification.regression.nested_choice import (
    DISTINCT_SIGMAS,
    Gain,
    deviations,
    joints_that_gain,
    simplest_model,
)

BLOCKS = np.array([1.0, 1.1, 0.9, 1.05, 0.95, 1.0])
NOISE = np.array([1.02, 0.98, 1.01, 0.99, 1.02, 0.98])


def test_a_gain_is_the_logarithm_of_the_ratio_of_rms_errors() -> None:
    gain = Gain.between(BLOCKS, BLOCKS / 1.21)
    assert math.isclose(gain.mean, math.log(1.1))
    assert gain.exceeds()


def test_a_gain_within_its_standard_error_is_ignored() -> None:
    assert not Gain.between(BLOCKS, BLOCKS * NOISE).exceeds()


def test_a_gain_of_too_few_blocks_is_ignored() -> None:
    assert not Gain.between(BLOCKS[:3], 0.5 * BLOCKS[:3]).exceeds()
    assert not Gain.between(np.full(6, np.nan), BLOCKS).exceeds()


def test_a_gain_below_the_minimum_is_ignored() -> None:
    assert not Gain.between(BLOCKS, BLOCKS / 1.004).exceeds()


def test_of_equally_good_models_the_simplest_is_chosen() -> None:
    assert simplest_model([BLOCKS, BLOCKS * NOISE]) == 0
    assert simplest_model([4.0 * BLOCKS, BLOCKS, BLOCKS * NOISE]) == 1


def test_each_joint_is_judged_separately() -> None:
    simpler, richer = (
        np.column_stack([BLOCKS, BLOCKS]),
        np.column_stack([BLOCKS * NOISE, 0.5 * BLOCKS]),
    )
    np.testing.assert_array_equal(joints_that_gain(simpler, richer), [False, True])


def test_few_blocks_increase_a_deviation() -> None:
    changes = np.tile([[1.0], [-1.0]], (10, 1))
    many = np.tile([[1.0], [-1.0]], (1000, 1))
    assert deviations(changes)[0] > 1.1 * math.sqrt(19.0)
    assert math.isclose(deviations(many)[0], math.sqrt(1999.0), rel_tol=0.01)
    assert DISTINCT_SIGMAS == 3.5
