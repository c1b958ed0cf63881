"""Stability margins of the cascade: compared with closed forms and with the simulated arm."""

from __future__ import annotations

import math
from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from acquisition.motion.samples import MotionSamples, Phase
from benchmarks.closed_loop import closed_loop
from compensation.loops.axis_mechanics import AxisMechanics, fit_axis_mechanics
from compensation.loops.cascade import Cascade, advise, margins
from compensation.loops.frequency_response import (
    controller_responses,
    mechanics_responses,
)
from compensation.loops.multisine_motion import MultisineOptions, multisine_motion
from compensation.loops.multisine_spectra import multisine_spectra
from compensation.loops.velocity_loop import VelocityLoop, fit_velocity_loop
from config.errors import EstimationError
from config.load import LoadedCell
from config.simulation.plant import PlantConfig
from tests.builders.raised_codes import raises_code

CYCLE_S = 0.008


def cascade(
    gain: float = 900.0,
    integral_s: float = 0.1,
    lag_s: float = 0.0005,
    inertia: float = 12.0,
    position_gain: float = 15.0,
    joint: str = "axis1",
    spread: float = 0.01,
) -> Cascade:
    covariance = np.diag([(spread * gain) ** 2, (spread * integral_s) ** 2])
    names = ("gain", "integral_time_s")
    loop = VelocityLoop(joint, gain, integral_s, 0.0, lag_s, names, covariance, 1.0, ())
    axis = AxisMechanics(joint, inertia, 30.0, np.diag([(spread * inertia) ** 2, 1.0]), 0.0, 0.0)
    return Cascade(loop, axis, position_gain, CYCLE_S)


def closed_form(one: Cascade, frequency_hz: np.ndarray) -> np.ndarray:
    """Return the open position loop from its formula, without python-control."""
    loop, axis, s = one.loop, one.mechanics, 2j * math.pi * frequency_hz
    controller = loop.gain * (1.0 + 1.0 / (loop.integral_time_s * s)) / (1.0 + loop.lag_s * s)
    opened = controller * np.exp(-s * loop.delay_s) / (axis.inertia * s + axis.damping)
    late = np.sinc(frequency_hz * CYCLE_S) ** 2 * np.exp(-s * 2.0 * CYCLE_S)
    return np.asarray(one.position_gain_per_s * late * opened / (1.0 + opened) / s)


def first_crossing(frequency_hz: np.ndarray, values: np.ndarray) -> float:
    """Return the frequency at which values on a fine grid first fall below zero."""
    k = int(np.flatnonzero(values < 0.0)[0])
    share = values[k - 1] / (values[k - 1] - values[k])
    return float(frequency_hz[k - 1] + share * (frequency_hz[k] - frequency_hz[k - 1]))


@settings(max_examples=40)
@given(
    st.floats(300.0, 3000.0),
    st.floats(0.05, 0.5),
    st.floats(0.0, 0.01),
    st.floats(2.0, 20.0),
    st.floats(2.0, 80.0),
)
def test_margins_are_those_of_the_closed_form(
    gain: float, integral_s: float, delay_s: float, inertia: float, position_gain: float
) -> None:
    one = cascade(gain, integral_s, 0.001, inertia, position_gain)
    one = replace(one, loop=replace(one.loop, delay_s=delay_s))
    f = np.geomspace(0.05, 62.5, 50_000)
    opened = closed_form(one, f)
    level, turns = np.log(np.abs(opened)), np.degrees(np.unwrap(np.angle(opened)))
    assume(
        bool((np.diff(level) < 0.0).all())
    )  # stable without resonance: the first crossing counts
    at_one, at_half = first_crossing(f, level), first_crossing(f, turns + 180.0)
    assume(at_one < at_half)
    found = one.position_margins
    assert found.gain == pytest.approx(math.exp(-np.interp(at_half, f, level)), rel=1e-3)
    assert found.phase_deg == pytest.approx(np.interp(at_one, f, turns) + 180.0, abs=0.02)
    assert found.phase_crossover_hz == pytest.approx(at_half, rel=1e-3)
    assert found.crossover_hz == pytest.approx(at_one, rel=1e-3)


def test_loops_are_products_of_their_parts() -> None:
    one = cascade()
    frequency_hz = np.array([0.3, 2.0, 11.0])
    s = 2j * np.pi * frequency_hz
    opened = 900.0 * (1.0 + 1.0 / (0.1 * s)) / (1.0 + 0.0005 * s) / (12.0 * s + 30.0)
    np.testing.assert_allclose(one.velocity_loop(frequency_hz), opened, rtol=1e-9)
    closed = opened / (1.0 + opened)
    np.testing.assert_allclose(one.closed_velocity_loop(frequency_hz), closed, rtol=1e-9)
    np.testing.assert_allclose(one.position_loop(frequency_hz), closed_form(one, frequency_hz))


def test_the_peak_is_the_largest_gain_of_the_closed_loop() -> None:
    one = cascade(position_gain=40.0)
    opened = closed_form(one, np.geomspace(0.05, 62.5, 20_000))
    assert one.peak == pytest.approx(float(np.abs(opened / (1.0 + opened)).max()), rel=1e-2)
    assert one.peak > 1.1


def test_the_standard_deviation_of_a_linear_result_follows_from_its_covariance() -> None:
    names = ("gain", "integral_time_s")
    root = np.array([[20.0, 0.0], [-0.001, 0.002]])
    one = cascade()
    one = replace(one, loop=replace(one.loop, names=names, covariance=root @ root.T))
    one = replace(one, mechanics=replace(one.mechanics, covariance=np.diag([0.04, 4.0])))
    weight = np.array([2.0, -3e3, 5.0, 0.5])
    values = np.array(
        [
            weight @ [e.loop.gain, e.loop.integral_time_s, e.mechanics.inertia, e.mechanics.damping]
            for e in one.spread()
        ]
    )
    variance = weight[:2] @ root @ root.T @ weight[:2] + 25.0 * 0.04 + 0.25 * 4.0
    half = 0.5 * (values[0::2] - values[1::2])
    assert half @ half == pytest.approx(variance)


@settings(max_examples=30)
@given(st.floats(200.0, 3000.0), st.floats(0.03, 0.5), st.floats(2.0, 60.0))
def test_the_largest_gain_just_meets_both_margins(
    gain: float, integral_s: float, inertia: float
) -> None:
    one = cascade(gain, integral_s, inertia=inertia)
    largest = one.largest_position_gain_per_s
    at_edge = replace(one, position_gain_per_s=largest).position_margins
    assert at_edge.gain is not None
    assert at_edge.phase_deg is not None
    assert at_edge.gain >= 2.0 * (1.0 - 1e-3)
    assert at_edge.phase_deg >= 60.0 - 0.2
    assert at_edge.gain < 2.01 or at_edge.phase_deg < 60.2


def test_a_loop_without_a_crossing_has_no_margin() -> None:
    frequency_hz = np.geomspace(0.1, 100.0, 200)
    response = np.asarray(0.5 / (1.0 + 0.1j * frequency_hz), dtype=np.complex128)
    never = margins(control.FRD(response, 2.0 * math.pi * frequency_hz))
    assert never.gain is None
    assert never.phase_deg is None
    assert never.gain_db is None


def test_advice_names_the_limiting_axis_and_includes_uncertainty() -> None:
    strong, weak = cascade(), cascade(inertia=40.0, joint="axis2")
    advice = advise([strong, weak])
    assert advice.joint_name == "axis2"
    assert advice.largest_per_s < weak.largest_position_gain_per_s
    assert advise([cascade(inertia=40.0, spread=0.05)]).largest_per_s < advice.largest_per_s
    assert advice.largest_per_s < advice.present_per_s
    raised = advise([cascade(position_gain=5.0)])
    assert raised.largest_per_s > raised.present_per_s


def test_an_uncertain_loop_gets_no_negative_gain() -> None:
    advice = advise([cascade(spread=0.8)])
    assert advice.largest_per_s == 0.0
    assert "too uncertain" in advice.sentence


def test_advice_says_if_only_the_uncertainty_exceeds_the_margins() -> None:
    certain = cascade(inertia=40.0)
    limit = certain.largest_position_gain_per_s
    assert "leaves axis1 less" in advise([certain]).sentence
    near = cascade(inertia=40.0, position_gain=0.99 * limit, spread=0.05)
    assert "may leave axis1 less" in advise([near]).sentence


def test_loops_of_different_joints_are_refused() -> None:
    axis = replace(cascade().mechanics, joint_name="axis2")
    with raises_code(EstimationError, "RID-INTERNAL-ERROR", "axis2"):
        Cascade(cascade().loop, axis, 15.0, CYCLE_S)


@pytest.fixture(scope="module")
def smooth(cell: LoadedCell) -> PlantConfig:
    """The arm without Coulomb friction, which would hide an unstable loop."""
    assert cell.plant is not None
    plain = cell.plant.without_unmodelled()
    axes = tuple(axis.model_copy(update={"coulomb_nm": 0.0}) for axis in plain.axes)
    return plain.model_copy(update={"axes": axes})


@pytest.fixture(scope="module")
def measured(cell: LoadedCell, smooth: PlantConfig) -> list[Cascade]:
    options = MultisineOptions(period_s=4.0, periods=2, realisations=2, seed=3)
    motion = multisine_motion(cell.robot, cell.config, options)
    samples = motion.plan(cell.robot, CYCLE_S)
    spectra = multisine_spectra(closed_loop(cell, smooth, samples, 3), motion, cell.robot)
    return [
        Cascade(fit_velocity_loop(g), fit_axis_mechanics(p), 15.0, CYCLE_S)
        for g, p in zip(controller_responses(spectra), mechanics_responses(spectra), strict=True)
    ]


@pytest.mark.parametrize(("share", "grows"), [(0.85, False), (1.2, True)])
def test_the_arm_oscillates_beyond_its_gain_margin_and_not_below(
    cell: LoadedCell, smooth: PlantConfig, measured: list[Cascade], share: float, grows: bool
) -> None:
    """The arm sags because its integrators start at zero; then it settles or oscillates."""
    edges = [one.position_margins.gain for one in measured]
    edge = min(gain for gain in edges if gain is not None)
    assert 2.0 < edge < 10.0
    pose = np.tile([0.0, -0.2, 0.5], (500, 1))
    still = MotionSamples(
        cell.robot.joint_names,
        CYCLE_S,
        pose,
        np.zeros_like(pose),
        np.zeros_like(pose),
        np.full(len(pose), Phase.HOLD, dtype=np.uint8),
    )
    config = cell.config.model_copy(update={"position_gain_per_s": 15.0 * share * edge})
    moved = closed_loop(replace(cell, config=config), smooth, still, 0).position
    early, late = (
        float(np.ptp(moved[rows], axis=0).max()) for rows in (slice(125), slice(-125, None))
    )
    assert (late > early) == grows
    assert all(one.mechanics.misfit < 0.1 for one in measured)
