"""A path with too little clearance is refused; the error names the two bodies and the time."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.collision import refuse_collision
from config.errors import PreflightError
from config.load import load_robot
from config.robot.bodies import Plane, Workspace
from dynamics.geometry.clearances import Clearances
from dynamics.geometry.kinematics import Chain, link_transforms
from tests.builders.raised_codes import raises_code

STEP_S = 0.01


@pytest.fixture(scope="module")
def swing() -> np.ndarray:
    """Joint positions (101 x 3, rad) of the bundled arm while axis 1 makes a quarter turn."""
    pose = np.zeros((101, 3))
    pose[:, 0] = np.linspace(0.0, np.pi / 2.0, 101)
    return pose


@pytest.fixture(scope="module")
def tool_x(swing: np.ndarray) -> np.ndarray:
    chain = Chain.from_description(load_robot("ir361"))
    links = link_transforms(chain, swing)[:, -1]
    return np.asarray(links[:, 0, :3] @ chain.tool_m + links[:, 0, 3])


def wall(at_x: float, side: float) -> Clearances:
    """Return the clearances to a wall at x = `at_x` m; the robot must stay 20 mm away from it."""
    plane = Plane(name="the wall", normal=(side, 0.0, 0.0), offset_m=side * at_x)
    return Clearances.of(load_robot("ir361"), Workspace(planes=(plane,), clearance_m=0.02))


def test_a_path_with_enough_clearance_is_accepted(swing: np.ndarray, tool_x: np.ndarray) -> None:
    refuse_collision(wall(tool_x.min() - 0.03, 1.0), swing, STEP_S, "the motion")
    refuse_collision(Clearances.of(load_robot("ir361")), swing, STEP_S, "the motion")


def test_a_path_with_too_little_clearance_is_refused_with_bodies_and_time(
    swing: np.ndarray, tool_x: np.ndarray
) -> None:
    place = float(tool_x[60])
    with pytest.raises(PreflightError) as caught:
        refuse_collision(wall(place, 1.0), swing, STEP_S, "the motion")
    first = int(np.argmax(tool_x - place < 0.02))
    text = str(caught.value)
    assert "the wall and the tool point" in text
    assert f"after {first * STEP_S:.2f} s" in text
    assert "Nothing was moved" in text


def test_a_robot_that_starts_too_close_may_move_away_but_not_closer(
    swing: np.ndarray, tool_x: np.ndarray
) -> None:
    near = wall(float(tool_x[0]) + 0.01, -1.0)
    refuse_collision(near, swing, STEP_S, "the way")
    with raises_code(PreflightError, "RID-MOTION-COLLISION"):
        refuse_collision(near, np.vstack([swing[30::-1], swing]), STEP_S, "the way")


def test_a_path_out_of_the_wall_is_refused(swing: np.ndarray, tool_x: np.ndarray) -> None:
    with raises_code(PreflightError, "RID-MOTION-COLLISION", "50"):
        refuse_collision(wall(float(tool_x[0]) - 0.05, -1.0), swing, STEP_S, "the way")


def test_the_check_calls_its_heartbeat_between_rows(swing: np.ndarray, tool_x: np.ndarray) -> None:
    calls: list[int] = []
    clear = wall(tool_x.min() - 0.03, 1.0)
    refuse_collision(clear, swing, STEP_S, "the way", meanwhile=lambda: calls.append(1))
    assert len(calls) == 6
