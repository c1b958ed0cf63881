"""Closest approach in each interval of a motion, compared with the distances in all samples."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from config.load import load_robot
from config.robot.bodies import Box, Capsule, Hull, Plane, Workspace
from config.robot.robot import RobotDescription
from dynamics.geometry import closest_approach
from dynamics.geometry.clearances import Clearances
from dynamics.geometry.closest_approach import closest_approaches

WORKSPACE = Workspace(
    planes=(Plane(name="floor", normal=(0.0, 0.0, 1.0), offset_m=-0.5),),
    boxes=(
        Box(name="post", keep="out", min_m=(0.4, -0.2, 0.0), max_m=(0.6, 0.2, 1.0)),
        Box(name="cage", keep="in", min_m=(-1.5, -1.5, -1.5), max_m=(1.5, 1.5, 1.5)),
    ),
)


def hull_around(body: Capsule, random: np.random.Generator) -> Hull:
    """Return a hull of random points inside a capsule; its enclosing capsule is not tight."""
    outward = random.normal(size=(24, 3))
    outward *= body.radius_m / np.linalg.norm(outward, axis=1, keepdims=True)
    points = random.choice((body.start_m, body.end_m), 24) + outward * (0.5, 1.0, 0.7)
    return Hull(kind="hull", link=body.link, points_m=tuple(map(tuple, points.tolist())))


def arm(bodies: str, slides: bool) -> RobotDescription:
    """Return a six-axis robot with capsules or hulls; its third joint can slide."""
    robot = load_robot("ur10e")
    if bodies == "hulls":
        random = np.random.default_rng(3)
        hulls = [hull_around(body, random) for body in robot.bodies if isinstance(body, Capsule)]
        robot = robot.model_copy(update={"bodies": tuple(hulls)})
    if slides:
        joints = list(robot.joints)
        joints[2] = joints[2].model_copy(update={"type": "prismatic"})
        robot = robot.model_copy(update={"joints": tuple(joints)})
    return robot


@pytest.mark.parametrize("slides", [False, True], ids=["revolute", "prismatic"])
@pytest.mark.parametrize("bodies", ["capsules", "hulls"])
def test_the_smallest_distance_of_each_interval_is_that_of_all_its_samples(
    bodies: str, slides: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(closest_approach, "ROWS_AT_ONCE", 50)  # several parts
    clearances = Clearances.of(arm(bodies, slides), WORKSPACE)
    random = np.random.default_rng(7)
    time_s = np.linspace(0.0, 3.0, 160)[:, np.newaxis]
    speed, start = random.uniform(0.5, 3.0, (2, 6))
    q = np.sin(speed * time_s + start) * (2.0, 1.2, 0.6 if slides else 1.5, 2.0, 2.0, 2.0)
    edges = np.array([0, 1, 30, 31, 70, 141, 159])
    found = closest_approaches(clearances, q, edges)
    for number, (first, last) in enumerate(pairwise(edges)):
        each = np.array([clearances.nearest(pose[np.newaxis]) for pose in q[first : last + 1]])
        assert found.distance_m[number] == pytest.approx(each.min(), abs=1e-9)
        there = each[found.row[number] - first, found.pair[number]]
        assert there == pytest.approx(each.min(), abs=1e-9)
