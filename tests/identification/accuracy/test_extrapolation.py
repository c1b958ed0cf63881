"""Fourier series of a spring: valid only within the positions of its identification."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.load import load_robot
from identification.accuracy.extrapolation import extrapolation_findings
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
