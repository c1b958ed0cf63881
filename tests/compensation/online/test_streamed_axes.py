"""Simulated axes keep torque limits, hardly exceed others, and rest after any accepted stream."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.closed_loop import plant_at
from compensation.online.point_ring import PointRing
from compensation.online.point_source import PointSource
from config.errors import ConfigError, DriverError
from tests.builders.point_streams import (
    ACCELERATION,
    CELL,
    FORWARD,
    LIMITS,
    SPEED,
    Points,
    T,
    streams,
)

pytestmark = pytest.mark.slow

TORQUE = np.array([limit.torque for limit in LIMITS])
SETTLE_ROWS, REST_ROWS = 60, 150  # rows until the loops have settled, and rows at rest
FOLLOWING = 1.05  # factor on the velocity limit: a closed loop overshoots slightly
JERKING = 2.5  # factor on the acceleration limit: cogging and stick-slip add up to 0.5
AT_REST_RAD_S = 0.01
GAIN_PER_S = CELL.config.position_gain_per_s


@settings(max_examples=40)
@given(stream=streams(), prefill=st.integers(20, 300), seed=st.integers(0, 9))
def test_no_axis_leaves_its_limits_and_all_come_to_rest(
    stream: tuple[Points, list[int], bool, list[int]], prefill: int, seed: int
) -> None:
    path, pace, end, late = stream
    ring = PointRing.create(3, 400)
    sent = ring.write(path[:prefill])
    source = PointSource(FORWARD, ring, prefill_patience_s=0.0)
    try:
        source.prepare()
    except (ConfigError, DriverError):
        return  # nothing was moved
    pose = source.begin(False, np.zeros(3))
    assert CELL.plant is not None
    plant = plant_at(CELL, CELL.plant, pose)
    powered, free = np.ones(3, dtype=np.bool_), np.zeros(3, dtype=np.bool_)
    wanted, ahead = pose, np.zeros(3)
    before = now = newest = np.zeros(3)
    speeds, torques, resting, row = [], [], 0, -SETTLE_ROWS
    while resting < REST_ROWS:
        if row >= 0 and not resting:
            count = pace[row % len(pace)] if pace else 0
            sent += ring.write(path[sent : sent + count])
            if end and sent == len(path):
                ring.end()
            if row not in late:
                point = source.at(row)
                if point is None:
                    ahead = np.zeros(3)
                    resting = 1
                else:
                    wanted, ahead = np.array(point.position), np.array(point.feedforward)
        elif resting:
            resting += 1
        speed = GAIN_PER_S * (wanted - plant.position) + ahead
        before, now, newest = now, newest, speed
        plant.advance(T, before, now, powered, free)
        if row >= 0:
            speeds.append(plant.velocity)
            torques.append(plant.torque)
        row += 1
        assert row < 5000, "the axes did not come to rest"
    changes = np.abs(np.diff(speeds, axis=0)) / (ACCELERATION * T)
    assert (np.abs(speeds) / SPEED).max() <= FOLLOWING
    assert (np.abs(torques) / TORQUE).max() <= 1.0
    assert changes.max() <= JERKING
    assert np.abs(speeds[-1]).max() <= AT_REST_RAD_S
