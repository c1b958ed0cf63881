"""A motion is compared with the positions of the identification."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.load import load_robot
from identification.accuracy.extrapolation import extrapolation_findings, repetition_findings
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed
from tests.builders.presliding_arm import motion, signals_of


@pytest.fixture(scope="module")
def fourier() -> Estimate:
    robot = load_robot("ir361")
    assert robot.spring is not None
    spring = robot.spring.model_copy(update={"form": "fourier"})
    q, v, a = motion(20.0, 1)
    tau = np.random.default_rng(0).normal(size=q.shape)
    signals = signals_of(q, v, a, tau)
    return fit_smoothed(robot.model_copy(update={"spring": spring}), [signals]).estimate()


def test_the_estimate_contains_its_range_of_positions(fourier: Estimate) -> None:
    q = motion(20.0, 1)[0]
    assert fourier.position_range is not None
    np.testing.assert_allclose(fourier.position_range, np.array([q.min(axis=0), q.max(axis=0)]).T)


def test_positions_inside_the_range_are_no_extrapolation(fourier: Estimate) -> None:
    assert extrapolation_findings(fourier, 0.9 * motion(20.0, 1)[0]) == ()


def test_positions_outside_the_range_are_reported_with_their_joint(fourier: Estimate) -> None:
    (finding,) = extrapolation_findings(fourier, 2.0 * motion(20.0, 1)[0])
    assert "axis2" in finding


def test_a_physical_spring_can_be_extrapolated(fourier: Estimate) -> None:
    robot = load_robot("ir361")
    physical = fit_smoothed(robot, [signals_of(*motion(20.0, 1), motion(20.0, 1)[0])]).estimate()
    assert extrapolation_findings(physical, 2.0 * motion(20.0, 1)[0]) == ()
    assert extrapolation_findings(replace(fourier, position_range=None), motion(20.0, 1)[0]) == ()


def test_a_repetition_of_the_identified_motion_is_reported(fourier: Estimate) -> None:
    """Noise and a way to the first pose change some of the ends of the ranges."""
    q = motion(20.0, 1)[0]
    noisy = q + np.random.default_rng(1).normal(size=q.shape, scale=2e-5)
    away = np.vstack([[0.0, 2.0, 0.0], noisy])
    assert len(repetition_findings(fourier, away)) == 1
    assert repetition_findings(replace(fourier, position_range=None), q) == ()


@pytest.mark.parametrize("seed", range(2, 22))
def test_another_motion_is_no_repetition(fourier: Estimate, seed: int) -> None:
    """All motions reach the same limits of the first joint."""
    q = motion(20.0, seed)[0]
    low, high = motion(20.0, 1)[0][:, 0].min(), motion(20.0, 1)[0][:, 0].max()
    q[:, 0] = low + (high - low) * (q[:, 0] - q[:, 0].min()) / np.ptp(q[:, 0])
    assert repetition_findings(fourier, q) == ()
