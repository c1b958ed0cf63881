"""Frequency response of recorded commands: a delay, or the transform of a delayed pulse."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.maps.command_timing import CommandTiming

STEP_S = 0.01
FREQUENCY_HZ = np.array([0.0, 3.0, 20.0, 49.0])


def test_set_points_of_the_controller_have_only_a_delay() -> None:
    late = CommandTiming(delay_s=0.002).response(FREQUENCY_HZ, STEP_S)
    assert late == pytest.approx(np.exp(-2j * np.pi * FREQUENCY_HZ * 0.002))
    assert CommandTiming().response(FREQUENCY_HZ, STEP_S) == pytest.approx(np.ones(4))


@pytest.mark.parametrize("interpolation", ["step", "linear"])
def test_pulses_have_the_response_of_their_shape(interpolation: str) -> None:
    """The expected response is the numerical integral of the pulse times exp(-2 pi i f t)."""
    timing = CommandTiming.model_validate({"interpolation": interpolation, "delay_s": 0.004})
    edges = np.linspace(0.0, 2.0 * STEP_S, 20001)
    t = (edges[1:] + edges[:-1]) / 2.0
    step = (t < STEP_S) / STEP_S
    triangle = np.maximum(0.0, 1.0 - np.abs(t / STEP_S - 1.0)) / STEP_S
    pulse = step if interpolation == "step" else triangle
    waves = np.exp(-2j * np.pi * np.outer(FREQUENCY_HZ, t + 0.004))
    expected = waves @ pulse * (edges[1] - edges[0])
    assert timing.response(FREQUENCY_HZ, STEP_S) == pytest.approx(expected, abs=1e-6)
