"""Regressor of the links, compared with Pinocchio on random arms."""

from __future__ import annotations

import numpy as np
import pytest

from config.errors import EstimationError
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, regressor, torque
from dynamics.terms.rigid_body import RigidBodies
from tests.builders.raised_codes import raises_code

ARMS: list[tuple[int, int, str | None]]
ARMS = [(n, seed, None) for n in range(1, 8) for seed in range(3)]
ARMS += [(1, 0, "P"), (3, 0, "PPP"), (4, 0, "RPRP"), (7, 0, "R" * 7), (7, 0, "P" * 7)]


def links_only(robot) -> RobotModel:
    return RobotModel.from_description(robot, rotors=False, friction=False, spring=False)


@pytest.mark.parametrize(("n", "seed", "kinds"), ARMS)
def test_the_regressor_agrees_with_pinocchio(
    n, seed, kinds, random_arm, judge, random_links, random_motion
) -> None:
    robot = random_arm(n, seed, kinds)
    reference = judge(robot, random_links(n, seed))
    q, v, a = random_motion(n, seed)
    expected = [reference.regressor(*sample) for sample in zip(q, v, a, strict=True)]
    np.testing.assert_allclose(regressor(links_only(robot), q, v, a), expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize(("n", "seed", "kinds"), ARMS)
def test_torque_and_base_wrench_agree_with_pinocchio(
    n, seed, kinds, random_arm, judge, random_links, random_motion
) -> None:
    robot = random_arm(n, seed, kinds)
    model, links = links_only(robot), random_links(n, seed)
    reference = judge(robot, links)
    q, v, a = random_motion(n, seed)
    samples = list(zip(q, v, a, strict=True))

    tau = torque(model, q, v, a, links.ravel())
    wrench = base_wrench_regressor(model, q, v, a) @ links.ravel()

    expected = np.array([reference.torque(*s) for s in samples])
    np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-10)
    expected = np.array([reference.base_wrench(*s) for s in samples])
    np.testing.assert_allclose(wrench, expected, rtol=0, atol=1e-10)


def test_at_rest_the_base_carries_the_weight(ir361, random_links) -> None:
    links = random_links(3, 0)
    rest = np.zeros((1, 3))
    force = base_wrench_regressor(links_only(ir361), rest, rest, rest)[0, :3] @ links.ravel()
    np.testing.assert_allclose(force, -links[:, 0].sum() * np.array(ir361.gravity_m_s2), atol=1e-12)


def test_a_link_has_an_effect_only_on_the_joints_before_it(ir361, random_motion) -> None:
    phi = regressor(links_only(ir361), *random_motion(3, 0)).reshape(-1, 3, 3, 10)
    joint, link = np.nonzero(np.abs(phi).max(axis=(0, 3)))
    assert set(zip(joint.tolist(), link.tolist(), strict=True)) == {
        (j, i) for i in range(3) for j in range(i + 1)
    }


def test_each_link_has_ten_parameters_with_names_and_units(ir361) -> None:
    model = links_only(ir361)
    assert " ".join(model.parameter_names[10:20]) == (
        "m2 sx2 sy2 sz2 Ixx2 Ixy2 Ixz2 Iyy2 Iyz2 Izz2"
    )
    assert model.parameter_units == ("kg", *["kg m"] * 3, *["kg m^2"] * 6) * 3


@pytest.mark.parametrize(
    "out",
    [np.zeros((8, 3, 20)), np.zeros((8, 3, 60))[:, :, ::2], np.zeros((8, 3, 30), np.float32)],
    ids=["shape", "gaps", "type"],
)
def test_memory_unsuitable_for_the_kernel_is_refused(out, ir361, random_motion) -> None:
    model = links_only(ir361)
    with raises_code(EstimationError, "RID-API-ARGUMENT"):
        RigidBodies(model.chain).fill_torque(model.motion(*random_motion(3, 0)), out)


def test_no_samples_give_no_rows_of_the_links(ir361) -> None:
    assert regressor(links_only(ir361), *np.zeros((3, 0, 3))).shape == (0, 3, 30)
