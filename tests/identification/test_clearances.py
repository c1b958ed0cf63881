"""Distances between bodies and surroundings, judged by Pinocchio's geometry and closed forms."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest
from pydantic import ValidationError

from config.bodies import Box, Hull, Plane, Workspace
from config.load import load_robot
from identification.clearances import Clearances


@pytest.fixture(scope="module")
def robot():
    return load_robot("ur10e")


@pytest.fixture(scope="module")
def poses(robot) -> np.ndarray:
    return np.random.default_rng(5).uniform(-2.5, 2.5, (20, 6))


def test_distances_are_those_of_pinocchio(robot, poses) -> None:
    model = pin.Model()
    geometry = pin.GeometryModel()
    parent = 0
    frames = []
    for number, row in enumerate(robot.kinematics.modified_rows(), start=1):
        x = pin.SE3(pin.utils.rotate("x", row.alpha_rad), np.array([row.a_m, 0.0, 0.0]))
        z = pin.SE3(pin.utils.rotate("z", row.theta_rad), np.array([0.0, 0.0, row.d_m]))
        parent = model.addJoint(parent, pin.JointModelRZ(), x * z, f"j{number}")
        frames.append(parent)
    for number, body in enumerate(robot.bodies):
        start, end = np.array(body.start_m), np.array(body.end_m)
        along = end - start
        rotation = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).matrix()
        shape = coal.Capsule(body.radius_m, float(np.linalg.norm(along)))
        place = pin.SE3(rotation, (start + end) / 2.0)
        joint = frames[body.link - 1] if body.link else 0
        geometry.addGeometryObject(pin.GeometryObject(f"b{number}", joint, place, shape))
    for i, first in enumerate(robot.bodies):
        for k in range(i + 1, len(robot.bodies)):
            if abs(first.link - robot.bodies[k].link) > 1:
                geometry.addCollisionPair(pin.CollisionPair(i, k))
    ours = Clearances.of(robot).distances(poses)
    data, places = model.createData(), geometry.createData()
    for q, distances in zip(poses, ours, strict=True):
        pin.computeDistances(model, data, geometry, places, q)
        theirs = [result.min_distance for result in places.distanceResults]
        np.testing.assert_allclose(distances, theirs, atol=1e-9)


def test_the_gradient_is_that_of_central_differences(robot, poses) -> None:
    workspace = Workspace(
        planes=(Plane(name="floor", normal=(0.0, 0.0, 1.0), offset_m=0.0),),
        boxes=(
            Box(name="post", keep="out", min_m=(0.4, -0.2, 0.0), max_m=(0.6, 0.2, 1.0)),
            Box(name="cage", keep="in", min_m=(-0.9, -0.9, -0.5), max_m=(0.9, 0.9, 1.5)),
        ),
    )
    clearances = Clearances.of(robot, workspace)
    short, gradient = clearances.shortfall(poses)
    assert (short > 0.0).any()
    step = 1e-6
    for joint in range(6):
        shift = step * np.eye(6)[joint]
        up, down = (
            0.5 * np.sum(clearances.shortfall(poses + s * shift)[0] ** 2, axis=1) for s in (1, -1)
        )
        np.testing.assert_allclose(gradient[:, joint], (up - down) / (2.0 * step), atol=1e-7)


def test_a_tool_point_above_a_floor(robot) -> None:
    bare = robot.model_copy(update={"bodies": ()})
    floor = Workspace(planes=(Plane(name="floor", normal=(0.0, 0.0, 1.0), offset_m=0.0),))
    clearances = Clearances.of(bare, floor)
    assert clearances.names == ("floor and the tool point",)
    stretched = clearances.distances(np.zeros((1, 6)))[0, 0]
    # Arm level: shoulder height less the wrist's drop (d1 - d5 of the manufacturer's table).
    assert stretched == pytest.approx(0.1807 - 0.11985, abs=1e-3)


def test_neighbouring_links_may_touch(robot) -> None:
    assert not any("link 1's" in name and "link 2's" in name for name in Clearances.of(robot).names)


def test_a_hull_is_as_far_as_the_box_that_it_is(robot) -> None:
    corners = [(x, y, z) for x in (-0.05, 0.05) for y in (-0.04, 0.04) for z in (0.0, 0.1)]
    block = Hull(kind="hull", link=6, points_m=tuple(corners))
    floor = Workspace(planes=(Plane(name="floor", normal=(0.0, 0.0, 1.0), offset_m=-2.0),))
    clearances = Clearances.of(robot.model_copy(update={"bodies": (block,)}), floor)
    q = np.zeros((1, 6))
    from dynamics.kinematics import Chain, link_transforms

    last = link_transforms(Chain.from_description(robot), q)[0, -1]
    lowest = min((last @ (*corner, 1.0))[2] for corner in corners)
    assert clearances.distances(q)[0, 0] == pytest.approx(lowest + 2.0, abs=1e-9)


def test_a_flat_hull_is_refused() -> None:
    with pytest.raises(ValidationError, match="lie in one plane"):
        Hull(kind="hull", link=1, points_m=((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)))
