from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from config.errors import EstimationError
from config.formats.urdf import rotation_of_rpy
from config.load import load_robot
from config.robot.kinematic_table import KinematicRow, Kinematics
from dynamics.geometry.kinematics import (
    Chain,
    flange_pose,
    forward,
    jacobian,
    link_transforms,
    point_jacobian,
)
from tests.builders.raised_codes import raises_code


@pytest.mark.parametrize("n", range(1, 8))
def test_link_frames_agree_with_pinocchio(n, random_arm, judge, random_links) -> None:
    robot = random_arm(n, seed=n)
    q = np.random.default_rng(n).uniform(-2.0, 2.0, (5, n))
    expected = [judge(robot, random_links(n, n)).frames(sample) for sample in q]
    np.testing.assert_allclose(
        link_transforms(Chain.from_description(robot), q), expected, rtol=0, atol=1e-12
    )


def test_link_frames_with_calibration_offsets_agree_with_pinocchio(
    random_arm, judge, random_links
) -> None:
    """Each row has offsets of all five constants, including Hayati's beta."""
    robot = random_arm(3, seed=4)
    offsets = np.random.default_rng(4).uniform(-0.01, 0.01, (3, 5))
    names = ("alpha_rad", "beta_rad", "theta_rad", "a_m", "d_m")
    table = robot.kinematics
    calibration = [KinematicRow(**dict(zip(names, row.tolist(), strict=True))) for row in offsets]
    moved = [
        KinematicRow(**{k: getattr(row, k) + d for k, d in zip(names, offset, strict=True)})
        for row, offset in zip(table.rows, offsets.tolist(), strict=True)
    ]
    by_hand = robot.model_copy(
        update={"kinematics": Kinematics(convention=table.convention, rows=tuple(moved))}
    )
    robot = robot.model_copy(
        update={"kinematics": table.model_copy(update={"calibration": tuple(calibration)})}
    )
    q = np.random.default_rng(4).uniform(-2.0, 2.0, (5, 3))
    expected = [judge(by_hand, random_links(3, 4)).frames(sample) for sample in q]
    np.testing.assert_allclose(
        link_transforms(Chain.from_description(robot), q), expected, rtol=0, atol=1e-12
    )


def test_the_tool_point_is_fixed_to_the_last_link(random_arm) -> None:
    robot = random_arm(4, seed=3)
    chain = Chain.from_description(robot)
    q = np.random.default_rng(0).uniform(-2.0, 2.0, (5, 4))
    tool = np.array([*robot.tool_offset_m, 1.0])
    expected = (link_transforms(chain, q)[:, -1] @ tool)[:, :3]
    np.testing.assert_allclose(forward(chain, q), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("n", range(1, 8))
def test_jacobians_agree_with_pinocchio(n, random_arm, judge, random_links) -> None:
    """Compare the Jacobians of the tool point, and of a point on every link and on the base."""
    robot = random_arm(n, seed=n)
    chain, model = Chain.from_description(robot), judge(robot, random_links(n, n)).model
    q = np.random.default_rng(n).uniform(-2.0, 2.0, (4, n))
    transforms = link_transforms(chain, q)
    for k, sample in enumerate(q):
        data = model.createData()
        pin.computeJointJacobians(model, data, sample)

        def expected(link: int, point: np.ndarray, data=data) -> np.ndarray:
            frame = pin.SE3(np.eye(3), point)
            world = pin.getJointJacobian(model, data, link, pin.ReferenceFrame.WORLD)
            return frame.toActionMatrixInverse() @ np.reshape(world, (6, n))

        tool = forward(chain, q)[k]
        ours = jacobian(chain, q)[k]
        np.testing.assert_allclose(ours, expected(n, tool), rtol=0, atol=1e-12)

        point = np.array([0.3, -0.2, 0.5])
        links = np.arange(n + 1)
        places, points = np.repeat(transforms[[k]], n + 1, axis=0), np.tile(point, (n + 1, 1))
        ours = point_jacobian(chain, places, links, points)
        np.testing.assert_array_equal(ours[0], 0.0)
        for link in links[1:]:
            theirs = expected(int(link), point)[:3]
            np.testing.assert_allclose(ours[link], theirs, rtol=0, atol=1e-12)


def test_a_standard_dh_table_includes_its_flange() -> None:
    """The part of the last row after the last axis belongs to the tool."""
    robot = load_robot("ur10e")
    assert robot.kinematics.convention == "standard_dh"
    last = robot.kinematics.rows[-1].model_copy(update={"a_m": 0.05, "alpha_rad": 0.7})
    kinematics = robot.kinematics.model_copy(update={"rows": (*robot.kinematics.rows[:-1], last)})
    tool_frame = {"tool_offset_m": (0.1, 0.2, 0.3), "tool_rpy_rad": (0.4, -0.5, 0.6)}
    robot = robot.model_copy(update={"kinematics": kinematics} | tool_frame)
    q = np.random.default_rng(1).uniform(-3.0, 3.0, 6)

    flange = np.eye(4)
    for row, angle in zip(kinematics.rows, q, strict=True):
        ct, st = np.cos(row.theta_rad + angle), np.sin(row.theta_rad + angle)
        ca, sa = np.cos(row.alpha_rad), np.sin(row.alpha_rad)
        flange = flange @ [
            [ct, -st * ca, st * sa, row.a_m * ct],
            [st, ct * ca, -ct * sa, row.a_m * st],
            [0.0, sa, ca, row.d_m],
            [0.0, 0.0, 0.0, 1.0],
        ]
    expected = (flange @ [0.1, 0.2, 0.3, 1.0])[:3]
    chain = Chain.from_description(robot)
    tool = forward(chain, q[None])[0]
    np.testing.assert_allclose(tool, expected, rtol=0, atol=1e-12)

    turned = flange[:3, :3] @ rotation_of_rpy(0.4, -0.5, 0.6)
    pose = link_transforms(chain, q[None])[0, -1] @ flange_pose(robot)
    np.testing.assert_allclose(pose[:3, :3], turned, rtol=0, atol=1e-12)
    np.testing.assert_allclose(pose[:3, 3], expected, rtol=0, atol=1e-12)


def test_the_ir361_at_zero_has_its_upper_arm_up_and_its_forearm_forward(ir361) -> None:
    tool = forward(Chain.from_description(ir361), np.zeros((1, 3)))[0]
    np.testing.assert_allclose(np.abs(tool), [0.765, 0.0, 1.020 + 0.480], atol=1e-9)


def test_a_chain_is_immutable(ir361) -> None:
    chain = Chain.from_description(ir361)
    for array in (chain.rows, chain.fixed_rotations, chain.gravity_m_s2):
        assert not array.flags.writeable


@pytest.mark.parametrize("shape", [(3,), (5, 2), (2, 5, 3)])
def test_positions_of_another_shape_are_refused(shape, ir361) -> None:
    with raises_code(EstimationError, "RID-API-ARGUMENT"):
        link_transforms(Chain.from_description(ir361), np.zeros(shape))


def test_a_chain_of_inconsistent_arrays_is_refused() -> None:
    with raises_code(EstimationError, "RID-API-ARGUMENT"):
        Chain(np.zeros((2, 5)), np.zeros(3, dtype=bool), np.zeros(3), np.zeros(3))
