"""Friction functions of a motor: presliding by Dahl's model, over a known motion."""

from __future__ import annotations

import numpy as np
import pytest

from identification.elasticity.friction_shapes import (
    DISTANCES,
    friction_shapes,
    presliding_friction,
)

TURN = np.linspace(0.0, 2.0 * np.pi, 2000, endpoint=False)


def test_presliding_friction_grows_over_its_distance_and_keeps_its_direction() -> None:
    position = 0.1 * np.sin(TURN)[:, np.newaxis]
    step = np.roll(position, -1, axis=0) - position
    friction = presliding_friction(step, np.array([1e-3]))[:, 0, 0]
    assert friction[1990] == pytest.approx(1.0)
    assert friction[1010] == pytest.approx(-1.0)
    # After the reversal at a quarter of the turn: 1 - 2 (1 - exp(-distance / 1e-3)).
    for row in (520, 540, 560):
        way = 0.1 - position[row + 1, 0]
        assert friction[row] == pytest.approx(2.0 * np.exp(-way / 1e-3) - 1.0, abs=0.01)


def test_small_motions_stay_presliding_and_need_hardly_any_torque() -> None:
    position = 1e-6 * np.sin(TURN)[:, np.newaxis]
    step = np.roll(position, -1, axis=0) - position
    assert np.ptp(presliding_friction(step, np.array([1e-3]))) < 3e-3


def test_there_is_one_function_per_distance_and_three_more() -> None:
    position = np.tile(np.sin(TURN)[:, np.newaxis], (1, 2))
    velocity, torque = np.gradient(position, axis=0), np.ones_like(position)
    assert friction_shapes(position, velocity, torque).shape == (2000, 2, len(DISTANCES) + 3)
