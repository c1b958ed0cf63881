"""Still pictures: overlaps, outlines, equal bytes, and effects of a wrong robot file."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from config.load import load_cell, load_robot
from config.meshes.mesh import Mesh
from rid_daq.robot_view.rasterizer import BACKGROUND, OUTLINE, Canvas
from rid_daq.robot_view.scene import RobotScene
from rid_daq.robot_view.sharp_edges import split_at_edges
from rid_daq.robot_view.solids import box_mesh, capsule_mesh
from rid_daq.robot_view.still_picture import VIEWS, Still, rest_pose, still_views

RED, BLUE = (200.0, 0.0, 0.0), (0.0, 0.0, 200.0)
LARGEST_BYTES = 150_000  # of four pictures; in a report they are 200,000 bytes


def drawn(*parts: tuple[Mesh, tuple[float, float, float], bool]) -> np.ndarray:
    canvas = Canvas(100, 80)
    for mesh, colour, in_front in parts:
        canvas.draw(*split_at_edges(mesh), np.array(colour), in_front=in_front)
    return canvas.pixels().astype(int)


def count(picture: np.ndarray, channel: int) -> int:
    """Return the number of pixels of one colour: 0 red, 2 blue."""
    other = 2 - channel
    return int(((picture[..., channel] > 60) & (picture[..., other] == 0)).sum())


def pixels(still: Still) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(still.png)).convert("RGB")).astype(int)


def ball(depth: float) -> Mesh:
    return capsule_mesh((50, 40, depth), (50, 40, depth), 15, 32)


BOX = box_mesh((30, 20, -5), (70, 60, 5))


@pytest.mark.parametrize("order", [1, -1])
def test_a_sphere_behind_a_box_is_hidden_whatever_is_drawn_first(order: int) -> None:
    behind, before = [
        drawn(*[(ball(depth), RED, False), (BOX, BLUE, False)][::order]) for depth in (-30, 30)
    ]
    assert count(behind, 0) == 0
    assert count(behind, 2) > 1_300
    assert count(before, 0) == pytest.approx(np.pi * 15**2, rel=0.15)  # without the outline


def test_a_sphere_that_is_half_in_a_box_shows_its_outer_half() -> None:
    picture = drawn(
        (capsule_mesh((30, 40, 0), (30, 40, 0), 15, 32), RED, False), (BOX, BLUE, False)
    )
    left, inside = picture[40, 18:29], picture[40, 50]
    assert (left[1:, 0] > 60).all()
    assert inside[2] > 60
    assert inside[0] == 0


def test_a_part_in_front_is_visible_through_others() -> None:
    assert count(drawn((ball(-30), RED, True), (BOX, BLUE, False)), 0) > 500


def test_parts_have_outlines_and_the_background_is_bright() -> None:
    picture = drawn((BOX, BLUE, False))
    assert picture[2, 2].tolist() == [BACKGROUND] * 3
    row = picture[40]
    for column in (30, 70):  # the edge's samples are half of the pixel, or all of it
        near = row[column - 1 : column + 1]
        assert np.abs(near - OUTLINE).sum(axis=1).min() < 350
    assert (row[33:67, 2] > 60).all()


def test_parts_outside_the_picture_are_cut_off() -> None:
    far = box_mesh((-500, -500, -5), (600, 600, 5))
    assert count(drawn((far, BLUE, False)), 2) == 100 * 80
    assert count(drawn((BOX.placed(moved(200.0)), BLUE, False)), 2) == 0


def moved(x: float) -> np.ndarray:
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


@pytest.fixture(scope="module")
def scene() -> RobotScene:
    return RobotScene.of(load_robot("kr15"), payload_centre_m=(0.02, 0.03, -0.15))


@pytest.fixture(scope="module")
def views(scene: RobotScene) -> tuple[Still, ...]:
    return still_views(scene, rest_pose(scene))


def test_equal_scenes_give_equal_bytes(scene: RobotScene, views: tuple[Still, ...]) -> None:
    again = still_views(RobotScene.of(load_robot("kr15"), None, (0.02, 0.03, -0.15)), np.zeros(6))
    assert [still.png for still in again] == [still.png for still in views]


@pytest.mark.parametrize("name", ["kr15", "ur10e", "ir361", "exercise"])
def test_four_views_are_small_enough_for_a_report(name: str) -> None:
    plate = load_cell(name).config.plate if name == "ir361" else None
    scene = RobotScene.of(load_robot(name), plate, (0.0, 0.0, 0.1))
    stills = still_views(scene, rest_pose(scene))
    assert [still.title for still in stills] == list(VIEWS)
    assert sum(len(still.png) for still in stills) < LARGEST_BYTES
    for still in stills:
        assert pixels(still).shape == (still.height, still.width, 3)


def changed(one: tuple[Still, ...], other: tuple[Still, ...]) -> int:
    """Return the number of changed pixels in the view that changed most; a change of size counts as
    10^6.
    """
    pairs = zip(one, other, strict=True)
    return max(
        int((pixels(a) != pixels(b)).any(axis=2).sum()) if a.height == b.height else 10**6
        for a, b in pairs
    )


def test_a_wrong_sign_of_a_joint_is_visible(scene: RobotScene, views: tuple[Still, ...]) -> None:
    joints = list(scene.joints)
    joints[2] = replace(joints[2], axis=-joints[2].axis)
    wrong = replace(scene, joints=tuple(joints))
    assert changed(views, still_views(wrong, np.zeros(6))) > 1_000
    pose = np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0])
    assert changed(still_views(scene, pose), still_views(wrong, pose)) > 5_000


def test_wrong_gravity_is_visible(views: tuple[Still, ...]) -> None:
    robot = load_robot("kr15")
    hanging = robot.model_copy(update={"gravity_m_s2": (0.0, 0.0, 9.81)})
    scene = RobotScene.of(hanging, None, (0.02, 0.03, -0.15))
    assert changed(views, still_views(scene, np.zeros(6))) > 20_000


def test_a_wrong_tool_frame_is_visible(views: tuple[Still, ...]) -> None:
    robot = load_robot("kr15").model_copy(update={"tool_rpy_rad": (3.14, 0.0, 0.0)})
    wrong = RobotScene.of(robot, None, (0.02, 0.03, -0.15))
    assert changed(views, still_views(wrong, np.zeros(6))) > 1_000


def test_the_shown_pose_is_zero_or_the_nearest_limit() -> None:
    robot = load_robot("kr15")
    first = robot.joints[0]
    limits = first.limits.model_copy(update={"position_min": 0.4})
    joints = (first.model_copy(update={"limits": limits}), *robot.joints[1:])
    scene = RobotScene.of(robot.model_copy(update={"joints": joints}))
    assert rest_pose(scene).tolist() == [0.4, 0.0, 0.0, 0.0, 0.0, 0.0]
