"""The robot is drawn where Pinocchio places it; a wrong sign, gravity or tool frame shows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin
import pytest
from playwright.sync_api import Browser, Page

from config.load import load_robot
from config.robot.robot import RobotDescription
from rid_daq.robot_view.scene import RobotScene
from tests.builders.browser_drawing import (
    changed_share,
    drawn_points,
    marker_place,
    open_scene,
    picture_of,
    show_pose,
    wait_for_picture,
)
from tests.rid_daq.conftest import PATIENCE_MS
from tests.rid_daq.robot_view.test_scene import ROBOTS, pinocchio_of, poses
from tests.rid_daq.service.conftest import ServedProcess

pytestmark = pytest.mark.slow

POSES = 50
WIDTH, HEIGHT = 1280, 900
BENT = (0.3, -0.6, 0.5, 0.4, 0.7, 0.2)
LEAST_SHARE = 0.01


@pytest.fixture(scope="module")
def page(browser: Browser, served_pages: ServedProcess) -> Iterator[Page]:
    """Open the page of a cell; the tests show other robots in its view."""
    context = browser.new_context(viewport={"width": WIDTH, "height": HEIGHT})
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(served_pages.url)
    wait_for_picture(page)
    page.evaluate("document.querySelector('footer').hidden = true")  # it would cover the picture
    yield page
    context.close()


def upright_points(robot: RobotDescription, scene: RobotScene, q: np.ndarray) -> np.ndarray:
    """Return the origins of base, links and tool by Pinocchio [m], in a frame with z up, (n + 2,
    3).
    """
    model, tool = pinocchio_of(robot)
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    places = [place.translation for place in data.oMi] + [(data.oMi[-1] * tool).translation]
    return np.array(places) @ scene.upright.T


@pytest.mark.parametrize("name", ROBOTS)
def test_each_joint_is_drawn_where_pinocchio_says(page: Page, name: str) -> None:
    robot = load_robot(name)
    scene = RobotScene.of(robot)
    drawn = poses(scene, POSES)
    open_scene(page, scene, drawn[0])
    for q, (points, camera) in zip(drawn, drawn_points(page, drawn), strict=True):
        wanted = camera.project(upright_points(robot, scene, q))
        assert np.abs(points - wanted).max() < 0.01  # the picture has no more exact pixels

    for link in (1, len(robot.joints), len(robot.joints) + 1):  # the pixels themselves
        show_pose(page, drawn[0])
        _, camera = drawn_points(page, drawn[:1])[0]
        wanted = camera.project(upright_points(robot, scene, drawn[0]))[link]
        assert np.linalg.norm(marker_place(page, link, 0.02) - wanted) < 1.0


def picture_of_robot(page: Page, robot: RobotDescription, q: np.ndarray) -> np.ndarray:
    open_scene(page, RobotScene.of(robot), q)
    return picture_of(page)


@pytest.mark.parametrize("name", ["kr15", "ir361"])
def test_a_wrong_sign_gravity_or_tool_frame_changes_the_picture(page: Page, name: str) -> None:
    robot = load_robot(name)
    q = np.array(BENT[: len(robot.joints)])
    right = picture_of_robot(page, robot, q)
    assert changed_share(right, picture_of_robot(page, robot, q)) == 0.0

    wrong_sign = q * np.where(np.arange(len(q)) == 1, -1.0, 1.0)
    assert changed_share(right, picture_of_robot(page, robot, wrong_sign)) > LEAST_SHARE
    x, y, z = robot.gravity_m_s2
    hanging = robot.model_copy(update={"gravity_m_s2": (-x, -y, -z)})
    assert changed_share(right, picture_of_robot(page, hanging, q)) > LEAST_SHARE
    turned = robot.model_copy(update={"tool_rpy_rad": (0.0, np.pi / 2, 0.0)})
    assert changed_share(right, picture_of_robot(page, turned, q)) > 0.1 * LEAST_SHARE
