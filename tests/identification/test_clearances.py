"""Distances between bodies and surroundings, compared with Pinocchio and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from config.load import load_robot
from config.robot.bodies import Box, Hull, Plane, Workspace
from dynamics.geometry.clearances import Clearances, _line_distance
from dynamics.geometry.kinematics import Chain, link_transforms
from tests.builders.raised_codes import raises_invalid


@pytest.fixture(scope="module")
def robot():
    return load_robot("ur10e")


@pytest.fixture(scope="module")
def poses(robot) -> np.ndarray:
    return np.random.default_rng(5).uniform(-2.5, 2.5, (20, 6))


def test_distances_of_all_pairs_agree_with_pinocchio(robot, poses, pinocchio_arm) -> None:
    clearances = Clearances.of(robot)
    theirs = [pinocchio_arm.distances(q) for q in poses]
    for q, expected in zip(poses, theirs, strict=True):
        np.testing.assert_allclose(clearances.nearest(q[np.newaxis]), expected, atol=1e-9)
    np.testing.assert_allclose(clearances.nearest(poses), np.min(theirs, axis=0), atol=1e-9)


def test_the_gradient_of_distances_agrees_with_central_differences(robot, poses) -> None:
    workspace = Workspace(
        planes=(Plane(name="floor", normal=(0.0, 0.0, 1.0), offset_m=0.0),),
        boxes=(
            Box(name="post", keep="out", min_m=(0.4, -0.2, 0.0), max_m=(0.6, 0.2, 1.0)),
            Box(name="cage", keep="in", min_m=(-0.9, -0.9, -0.5), max_m=(0.9, 0.9, 1.5)),
        ),
    )
    clearances = Clearances.of(robot, workspace)
    squares, gradient = clearances.shortfall(poses)
    lacking = [
        np.maximum(clearances.margin_m - clearances.nearest(q[np.newaxis]), 0.0) for q in poses
    ]
    assert squares == pytest.approx(np.sum(np.square(lacking)))
    assert squares > 0.0
    step = 1e-6
    for sample, joint in np.ndindex(poses.shape):
        shift = np.zeros_like(poses)
        shift[sample, joint] = step
        up, down = (clearances.shortfall(poses + s * shift)[0] for s in (1, -1))
        assert gradient[sample, joint] == pytest.approx((up - down) / (2.0 * step), abs=1e-5)


def test_a_pose_is_free_if_every_pair_keeps_its_clearance(robot) -> None:
    floor = Plane(name="floor", normal=(0.0, 0.0, 1.0), offset_m=-1.2)
    clearances = Clearances.of(robot, Workspace(planes=(floor,)))
    poses = np.random.default_rng(7).uniform(-2.5, 2.5, (60, 6))
    far = [bool((clearances.nearest(q[np.newaxis]) >= clearances.margin_m).all()) for q in poses]
    assert [clearances.is_clear(q[np.newaxis]) for q in poses] == far
    assert 5 < sum(far) < 55
    nothing = Clearances.of(robot.model_copy(update={"bodies": ()}))
    assert len(nothing) == 0
    assert nothing.is_clear(poses)
    assert nothing.shortfall(poses)[0] == 0.0


def test_the_height_of_a_tool_point_above_a_floor_is_computed(robot) -> None:
    bare = robot.model_copy(update={"bodies": ()})
    floor = Workspace(planes=(Plane(name="floor", normal=(0.0, 0.0, 1.0), offset_m=0.0),))
    clearances = Clearances.of(bare, floor)
    assert clearances.names == ("floor and the tool point",)
    stretched = clearances.nearest(np.zeros((1, 6)))[0]
    # Arm level: shoulder height minus the offset of the wrist (d1 - d5 of the data sheet).
    assert stretched == pytest.approx(0.1807 - 0.11985, abs=1e-3)


def test_neighbouring_links_are_not_compared(robot) -> None:
    assert not any("link 1's" in name and "link 2's" in name for name in Clearances.of(robot).names)


def test_a_hull_has_the_distance_of_its_box(robot) -> None:
    corners = [(x, y, z) for x in (-0.05, 0.05) for y in (-0.04, 0.04) for z in (0.0, 0.1)]
    block = Hull(kind="hull", link=6, points_m=tuple(corners))
    floor = Workspace(planes=(Plane(name="floor", normal=(0.0, 0.0, 1.0), offset_m=-2.0),))
    clearances = Clearances.of(robot.model_copy(update={"bodies": (block,)}), floor)
    q = np.zeros((1, 6))
    last = link_transforms(Chain.from_description(robot), q)[0, -1]
    lowest = min((last @ (*corner, 1.0))[2] for corner in corners)
    assert clearances.nearest(q)[0] == pytest.approx(lowest + 2.0, abs=1e-9)


def test_the_margin_of_a_hull_reduces_its_distance_and_keeps_the_gradient(robot, poses) -> None:
    corners = [(x, y, z) for x in (-0.05, 0.05) for y in (-0.04, 0.04) for z in (0.0, 0.1)]
    long = [(x, y, z) for x in (-0.1, 0.7) for y in (-0.04, 0.04) for z in (0.0, 0.1)]
    pairs = [
        [
            Hull(kind="hull", link=1, points_m=tuple(long), radius_m=one),
            Hull(kind="hull", link=6, points_m=tuple(corners), radius_m=other),
        ]
        for one, other in ((0.0, 0.0), (0.05, 0.03))
    ]
    bare, padded = (
        Clearances.of(robot.model_copy(update={"bodies": tuple(pair)}), Workspace(clearance_m=0.5))
        for pair in pairs
    )
    for q in poses:
        apart = bare.nearest(q[np.newaxis])
        np.testing.assert_allclose(padded.nearest(q[np.newaxis]), apart - 0.08, atol=1e-9)
    assert padded.nearest(poses) == pytest.approx(
        min(padded.nearest(q[np.newaxis])[0] for q in poses)
    )
    gradient = padded.shortfall(poses)[1]
    step = 1e-6
    for sample, joint in ((k, j) for k in range(len(poses)) for j in (1, 4)):
        shift = np.zeros_like(poses)
        shift[sample, joint] = step
        up, down = (padded.shortfall(poses + s * shift)[0] for s in (1, -1))
        assert gradient[sample, joint] == pytest.approx((up - down) / (2.0 * step), abs=2e-4)


def test_a_flat_hull_is_refused() -> None:
    with raises_invalid("", "points_m", "plane"):
        Hull(kind="hull", link=1, points_m=((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)))


@pytest.mark.parametrize("seed", range(5))
def test_distances_of_line_segments_agree_with_scipy(seed: int) -> None:
    random = np.random.default_rng(seed)
    p, d, q, e = random.normal(size=(4, 1, 3))
    if seed == 3:
        e = 2.0 * d  # parallel
    if seed == 4:
        d = np.zeros((1, 3))  # a point

    def apart(x: np.ndarray) -> float:
        return float(np.sum((p + x[0] * d - q - x[1] * e) ** 2))

    found = minimize(apart, [0.1, -0.1], bounds=[(-1.0, 1.0)] * 2, options={"ftol": 1e-15})
    assert _line_distance(p, d, q, e)[0] == pytest.approx(np.sqrt(found.fun), abs=1e-6)


def test_quick_bounds_never_exceed_the_distances(robot, poses) -> None:
    corners = np.random.default_rng(8).uniform(-0.1, 0.1, (12, 3))
    corners *= (1.0, 1.0, 4.0)
    lump = Hull(kind="hull", link=6, points_m=tuple(map(tuple, corners.tolist())), radius_m=0.02)
    workspace = Workspace(
        planes=(Plane(name="floor", normal=(0.0, 0.6, 0.8), offset_m=-1.0),),
        boxes=(Box(name="post", keep="out", min_m=(0.4, -0.2, 0.0), max_m=(0.6, 0.2, 1.0)),),
    )
    bodies = (*robot.bodies, lump)
    clearances = Clearances.of(robot.model_copy(update={"bodies": bodies}), workspace)
    bounds = clearances.lower_bounds(link_transforms(clearances.chain, poses))
    for q, bound in zip(poses, bounds, strict=True):
        distance = clearances.nearest(q[np.newaxis])
        # for overlapping solids coal gives a depth, and not a distance of axes
        apart = distance > 0.0
        assert (bound[apart] <= distance[apart] + 1e-9).all()
        assert (bound[~apart] <= 0.0).all()
