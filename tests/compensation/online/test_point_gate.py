"""Streamed points are refused at a collision, or if a stop would end beyond a limit."""

from __future__ import annotations

import numpy as np
import pytest

from compensation.online.point_feed import PointGate, feed
from compensation.online.point_ring import PointRing, PointsFailed
from config.load import load_cell
from config.robot.bodies import Plane, Workspace

LOADED = load_cell("ir361")
CELL, ROBOT = LOADED.config, LOADED.robot


def test_a_collision_is_refused_and_earlier_points_are_kept() -> None:
    workspace = Workspace(planes=(Plane(name="wall", normal=(-1.0, 0.0, 0.0), offset_m=-0.6),))
    ring = PointRing.create(3, 500)
    points = np.zeros((400, 3))
    points[:, 0] = np.linspace(1.5, 0.0, 400)  # towards the wall
    feed(ring, PointGate(CELL.model_copy(update={"workspace": workspace}), ROBOT), [points])
    assert ring.failed is PointsFailed.REFUSED
    assert "wall" in ring.failure
    assert 20 <= ring.written < 400


@pytest.mark.parametrize(("deceleration", "refused"), [(3.0, True), (20.0, False)])
def test_points_at_which_a_stop_would_end_beyond_a_limit_are_refused(
    deceleration: float, refused: bool
) -> None:
    """The path itself brakes before the limit, more strongly than a quick stop can."""
    safety = {"quick_stop_deceleration_rad_s2": deceleration}
    cell = CELL.model_copy(update={"drive_safety": CELL.drive_safety.model_copy(update=safety)})
    limits = ROBOT.joints[0].limits
    end = limits.position_max - 0.01
    points = np.zeros((500, 3))
    points[:, 0] = end - 0.5 * 8.0 * (0.008 * np.arange(499, -1, -1)) ** 2
    points = points[points[:, 0] > end - 0.4]
    ring = PointRing.create(3, 500)
    feed(ring, PointGate(cell, ROBOT), [points])
    assert (ring.failed is PointsFailed.REFUSED) is refused
    assert ("axis1" in ring.failure) is refused


@pytest.mark.parametrize("wrong", [10.0, 2.0])
def test_points_beyond_the_limits_are_left_to_the_path_which_names_their_number(
    wrong: float,
) -> None:
    """The sixth point jumps, to a position beyond the limit (10 rad) or within it (2 rad)."""
    points = np.zeros((10, 3))
    points[5:, 0] = wrong
    ring = PointRing.create(3, 50)
    feed(ring, PointGate(CELL, ROBOT), [points])
    assert ring.failed is PointsFailed.NO
