"""Interpolation of coarse positions: between encoder steps, the recorded velocity is integrated."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.imports.between_steps import (
    position_steps,
    refine_between_steps,
    unrefined_steps,
)
from acquisition.imports.columns import ImportRows
from config.arrays import FloatArray
from dynamics.kernels.taut_string import pull_taut

STEP = 1e-4


def rows(time_s: FloatArray, position: FloatArray, velocity: FloatArray) -> ImportRows:
    return ImportRows(
        row=np.arange(len(time_s)),
        time_s=time_s,
        position=position[:, np.newaxis],
        velocity=velocity[:, np.newaxis],
        torque=np.zeros((len(time_s), 1)),
        temperature=np.zeros((len(time_s), 0)),
        command=np.zeros((len(time_s), 0)),
    )


def creeping_joint() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time (s), position (rad) and velocity (rad/s) of a joint that creeps to and fro."""
    time_s = np.arange(0.0, 10.0, 0.008)
    position = 3e-4 * np.sin(0.8 * time_s) + 1e-4 * np.sin(3.0 * time_s)
    velocity = 2.4e-4 * np.cos(0.8 * time_s) + 3e-4 * np.cos(3.0 * time_s)
    return time_s, position, velocity


def round_to_steps(values: FloatArray, step: float, seed: int = 1) -> FloatArray:
    """Return the values rounded to multiples of `step` after adding noise of 0.1 `step` (RMS)."""
    noise = np.random.default_rng(seed).normal(0.0, 0.1 * step, len(values))
    return np.asarray(step * np.round((values + noise) / step), dtype=np.float64)


def test_the_step_of_a_position_is_found_in_any_unit() -> None:
    time_s, position, velocity = creeping_joint()
    for factor in (1.0, np.pi / 180.0, 1.0 / 121.0):
        samples = rows(time_s, factor * round_to_steps(position, STEP), velocity)
        assert position_steps(samples) == pytest.approx((factor * STEP,))


@pytest.mark.parametrize("offset", [0.0, 0.3, -123.4])
def test_a_creeping_joint_reverses_where_it_did_and_not_where_its_position_flickers(
    offset: float,
) -> None:
    time_s, position, velocity = creeping_joint()
    samples = rows(time_s, round_to_steps(position, STEP) + offset, round_to_steps(velocity, STEP))
    found = refine_between_steps(samples, position_steps(samples))[:, 0] - offset
    assert np.std(found - position) < 0.4 * np.std(samples.position[:, 0] - offset - position)
    true, recorded, refined = (
        np.count_nonzero(np.diff(np.sign(np.diff(path))))
        for path in (position, samples.position[:, 0], found)
    )
    assert recorded > 10 * true
    assert refined <= true + 4


def test_a_joint_at_rest_that_flickers_between_two_steps_does_not_move() -> None:
    time_s = np.arange(0.0, 4.0, 0.01)
    flicker = STEP * np.random.default_rng(3).integers(0, 2, len(time_s)).astype(float)
    samples = rows(time_s, 0.5 + flicker, np.zeros(len(time_s)))
    found = refine_between_steps(samples, position_steps(samples))[50:-50, 0]
    assert np.ptp(found) < 0.02 * STEP


def test_a_joint_at_rest_before_and_after_a_gap_does_not_move() -> None:
    time_s, position, velocity = creeping_joint()
    rest_s = time_s[-1] + 0.008 * np.arange(1, 501)
    moving = round_to_steps(position, STEP)
    samples = rows(
        np.concatenate([time_s, rest_s, rest_s + 10.0]),
        np.concatenate([moving, np.full(500, moving[-1]), np.full(500, moving[-1] + 0.2)]),
        np.concatenate([velocity, np.zeros(1000)]),
    )
    found = refine_between_steps(samples, position_steps(samples))[:, 0]
    assert np.ptp(found[-900:-500]) < 0.02 * STEP
    assert np.ptp(found[-500:]) < 0.02 * STEP


@pytest.mark.parametrize(("counts", "digits"), [(2**16, 6), (2**17, 6), (2**18, 7), (20_000, 5)])
def test_the_steps_of_an_encoder_are_found_in_rounded_numbers(counts: int, digits: int) -> None:
    step = 2.0 * np.pi / counts
    time_s = np.arange(0.0, 20.0, 0.008)
    position = round_to_steps(0.8 * np.sin(0.6 * time_s), step)
    samples = rows(time_s, np.round(position, digits), 0.48 * np.cos(0.6 * time_s))
    assert position_steps(samples) == pytest.approx((step,), rel=0.01)


def test_a_steady_speed_and_a_jump_are_not_steps() -> None:
    time_s = np.arange(0.0, 8.0, 0.004)
    triangle = 0.2 * np.abs((time_s + 2.0) % 4.0 - 2.0)
    jump = np.where(time_s < 3.0, 0.0, 0.2)
    for position in (triangle, jump):
        assert position_steps(rows(time_s, position, np.zeros(len(time_s)))) == (None,)


def test_a_wrong_velocity_moves_no_position_by_more_than_a_step() -> None:
    time_s, position, velocity = creeping_joint()
    samples = rows(time_s, round_to_steps(position, STEP), -3.0 * velocity)
    found = refine_between_steps(samples, position_steps(samples))
    assert np.abs(found - samples.position).max() <= STEP * (1.0 + 1e-9)


def test_positions_without_steps_or_velocity_are_unchanged() -> None:
    time_s, position, velocity = creeping_joint()
    smooth = rows(time_s, position, velocity)
    assert position_steps(smooth) == (None,)
    np.testing.assert_array_equal(refine_between_steps(smooth, (None,)), smooth.position)
    alone = rows(time_s, round_to_steps(position, STEP), np.full(len(time_s), np.nan))
    np.testing.assert_array_equal(
        refine_between_steps(alone, position_steps(alone)), alone.position
    )


@given(
    st.lists(st.tuples(st.floats(-5.0, 5.0), st.floats(0.0, 2.0)), min_size=2, max_size=60),
    st.integers(0, 1000),
)
def test_a_taut_string_stays_within_its_bounds_and_is_the_shortest(
    bounds: list[tuple[float, float]], seed: int
) -> None:
    random = np.random.default_rng(seed)
    time_s = np.cumsum(random.uniform(0.1, 1.0, len(bounds)))
    middle, width = np.array(bounds).T
    low, high = middle - width, middle + width
    path = np.empty(len(bounds))
    pull_taut(time_s, low, high, path)
    assert np.all(path >= low - 1e-9)
    assert np.all(path <= high + 1e-9)
    shortest = length(time_s, path)
    for share in random.uniform(-1.0, 1.0, (20, len(bounds))):
        other = middle + share * width
        other[[0, -1]] = path[[0, -1]]
        assert shortest <= length(time_s, other) + 1e-9
        between = path + random.uniform(0.0, 0.2) * (other - path)
        assert shortest <= length(time_s, between) + 1e-9


def length(time_s: FloatArray, path: FloatArray) -> float:
    return float(np.hypot(np.diff(time_s), np.diff(path)).sum())


def test_steps_remain_in_positions_without_velocities() -> None:
    left = unrefined_steps([STEP, 2.0 * STEP, None], [False, True, False], None)
    assert left == (STEP, None, None)
    coupling = np.array([[1.0, 0.0], [3.0, 4.0]])
    assert unrefined_steps([STEP, STEP], [False, False], coupling) == pytest.approx(
        (STEP, 5.0 * STEP)
    )
