"""On-line compensation with presliding hysteresis: on the path, at rest, and during the
approach.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compensation.feedforward.inverse import feedforward
from compensation.online.online_kernel import PRESLIDING
from compensation.online.point_ring import PointRing
from compensation.online.point_source import PointSource
from dynamics.kernels.presliding import DIRECTION
from dynamics.model.memory import presliding_of_model
from dynamics.model.robot_model import torque
from dynamics.terms.conditions import Conditions
from dynamics.terms.memory import Memory
from tests.builders.point_streams import (
    CELL,
    DISTANCES,
    REMEMBERING,
    Points,
    T,
    answers_at,
    arrays,
    drive,
    held_limits,
    loops_of,
    planned,
    remembering,
    source_of,
    waves,
)

START = planned().position[0]
REST_ROWS = 40
AT_ONCE = slice(20, -5)  # rows in which the feedforward has its full strength


def source_after_approach(points: Points, approach: Points) -> PointSource:
    """Return a source that received the robot's positions during the approach."""
    ring = PointRing.create(3, len(points))
    ring.write(points)
    ring.end()
    source = PointSource(REMEMBERING, ring, prefill_patience_s=0.0)
    source.prepare()
    source.begin(False, approach[0])
    for position in approach:
        source.watch(answers_at(position))
    return source


def path_with_rests() -> tuple[Points, Points, Points]:
    """Return q, v, a of a path that rests before its start and once in the middle."""
    samples = planned()
    still = np.zeros((REST_ROWS, 3))
    first = np.tile(samples.position[0], (REST_ROWS, 1))
    last = np.tile(samples.position[-1], (REST_ROWS, 1))
    back = slice(None, None, -1)
    q = np.concatenate([first, samples.position, last, samples.position[back]])
    v = np.concatenate([still, samples.velocity, still, -samples.velocity[back]])
    a = np.concatenate([still, samples.acceleration, still, samples.acceleration[back]])
    return q, v, a


def expected(q: Points, v: Points, a: Points, approach: Points) -> Points:
    """Return the feedforward for friction whose state follows the approach and then the path."""
    model, parameters = remembering()
    memory = Memory.along(
        presliding_of_model(model), np.concatenate([approach, q + (approach[-1] - q[0])])
    )
    conditions = Conditions(memory=memory.part(slice(len(approach), None)))
    return feedforward(loops_of(CELL), v, torque(model, q, v, a, parameters, conditions), T)


@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_the_speeds_match_friction_along_approach_and_path(way: float) -> None:
    """A pause on the path does not change the hysteresis state."""
    q, v, a = path_with_rests()
    approach = START + way * np.linspace(0.02, 0.0, 30)[:, np.newaxis] * [1.0, -1.0, 1.0]
    found = arrays(drive(source_after_approach(q, approach)))[2][1 : len(q) + 1]
    difference = np.abs(found - expected(q, v, a, approach))[AT_ONCE]
    assert np.median(difference) < 1e-5
    assert difference.max() < 2e-3
    other = np.abs(found - expected(q, v, a, 2.0 * START - approach))[AT_ONCE]
    assert other.max() > 0.02, "an approach from the other side must give another feedforward"


def test_without_earlier_positions_the_hysteresis_starts_unloaded() -> None:
    q, v, a = path_with_rests()
    found = arrays(drive(source_of(REMEMBERING, q)))[2][1 : len(q) + 1]
    difference = np.abs(found - expected(q, v, a, START[np.newaxis]))[AT_ONCE]
    assert difference.max() < 2e-3


def test_joints_that_settle_before_the_path_change_the_state_and_get_no_torque() -> None:
    """The joints reverse while they settle at the start of the path."""
    q, v, a = path_with_rests()
    approach = START + np.linspace(0.02, 0.0, 30)[:, np.newaxis] * [1.0, 1.0, 1.0]
    settling = START - np.outer(np.linspace(0.0, 1.0, 20), DISTANCES)
    leaves = int(np.argmax((q != q[0]).any(axis=1)))
    source, points = source_after_approach(q, approach), []
    for row, position in enumerate(settling):
        points.append(source.at(row))
        source.watch(answers_at(position))
    assert max(abs(x) for p in points if p is not None for x in p.feedforward) < 1e-9
    for row in range(len(settling), len(q)):
        if row >= leaves:
            source.watch(
                answers_at(START + 1.0)
            )  # positions are ignored after the start of the path
        points.append(source.at(row))
    found = np.array([p.feedforward for p in points if p is not None])[1:]
    whole = np.concatenate([approach, settling])
    wanted = expected(q, v, a, whole)[: len(found)]
    assert np.abs(found - wanted)[25:-5].max() < 2e-3


def test_a_flickering_last_digit_does_not_reverse_a_joint() -> None:
    """Presliding is so short that one count of a coarse encoder changes the friction."""
    axes = REMEMBERING.axes.copy()
    axes[PRESLIDING + 1] = 0.5
    forward, count = replace(REMEMBERING, axes=axes), 2e-5
    ring = PointRing.create(3, len(path_with_rests()[0]))
    ring.write(path_with_rests()[0])
    ring.end()
    source = PointSource(forward, ring, prefill_patience_s=0.0)
    source.prepare()
    source.begin(False, START - 0.02)
    count_sequence = [*range(-1000, 1), *([-1, 0] * 5), -1]
    for counts in count_sequence:
        answers = answers_at(START + count * counts)
        answers.position_counts[:] = counts
        source.watch(answers)
        slides = source._found[:, DIRECTION].copy()
    np.testing.assert_allclose(slides, 1.0, atol=1e-3)


def test_after_a_stop_the_hysteresis_state_follows_the_actual_positions() -> None:
    """During the stop the robot brakes between the points of the path.

    The friction state follows the measured positions.
    """
    source = source_of(REMEMBERING, waves(3, 320), end=False)
    points = drive(source)
    held_limits(points)
    assert source.stop is not None
    memory = Memory.along(presliding_of_model(remembering()[0]), arrays(points)[0])
    assert 0.1 < abs(memory.direction[-1, 1]) < 0.9, (
        "joints 2 and 3 should be in presliding after a reversal"
    )
    assert 0.1 < abs(memory.direction[-1, 2]) < 0.9
    np.testing.assert_allclose(source._found[:, DIRECTION], memory.direction[-1], atol=1e-9)


def test_a_model_without_presliding_ignores_positions() -> None:
    forward = replace(REMEMBERING, axes=REMEMBERING.axes.copy())
    forward.axes[PRESLIDING] = 0.0
    forward.axes.setflags(write=False)
    q = path_with_rests()[0]
    ring = PointRing.create(3, len(q))
    ring.write(q)
    ring.end()
    source = PointSource(forward, ring, prefill_patience_s=0.0)
    source.prepare()
    source.begin(False, START)
    before = source._memory.copy()
    source.watch(answers_at(START + 0.1))
    np.testing.assert_array_equal(source._memory, before)
