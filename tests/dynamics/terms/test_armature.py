"""Armatures, compared with Pinocchio's."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from dynamics.model.inverse_dynamics import torque_derivatives
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, torque


def with_armatures(robot, which: tuple[bool, ...]):
    joints = tuple(
        joint.model_copy(update={"rotor": None, "armature": has, "friction": ()})
        for joint, has in zip(robot.joints, which, strict=True)
    )
    return robot.model_copy(update={"joints": joints})


def test_armatures_agree_with_pinocchio(random_arm, judge, random_links, random_motion) -> None:
    robot = with_armatures(random_arm(4, 2, "RRPR"), (True, False, True, True))
    links = random_links(4, 2)
    reference = judge(robot, links).model
    reference.armature = np.array([0.7, 0.0, 1.3, 0.2])
    model = RobotModel.from_description(robot)
    assert model.parameter_names[40:] == ("Ia1", "Ia3", "Ia4")
    assert model.parameter_units[40:] == ("kg m^2", "kg", "kg m^2")

    q, v, a = random_motion(4, 2)
    expected = [pin.rnea(reference, reference.createData(), *s) for s in zip(q, v, a, strict=True)]
    theta = np.array([*links.ravel(), 0.7, 1.3, 0.2])
    np.testing.assert_allclose(torque(model, q, v, a, theta), expected, atol=1e-10)


def test_with_a_coupling_armatures_belong_to_the_actuators(random_arm, random_motion) -> None:
    """The kinetic energy Ia alpha'^2 / 2 gives the torque Ia alpha'' at that actuator only."""
    matrix = np.array([[1.0, 0.3], [-0.2, 1.0]])
    robot = with_armatures(random_arm(2, 0, "RR"), (True, True))
    robot = robot.model_copy(update={"coupling": tuple(map(tuple, matrix.tolist()))})
    model = RobotModel.from_description(robot)
    theta = np.zeros(22)
    theta[20:] = inertia = np.array([0.5, 2.0])
    q, v, a = random_motion(2, 0)
    tau = torque(model, q, v, a, theta)
    np.testing.assert_allclose(tau, inertia * np.linalg.solve(matrix, a.T).T)
    by_q, by_v, by_a = torque_derivatives(model, q, v, a, theta)
    assert not by_q.any()
    assert not by_v.any()
    np.testing.assert_allclose(
        by_a, np.broadcast_to(np.diag(inertia) @ np.linalg.inv(matrix), (8, 2, 2))
    )


def test_armatures_have_no_effect_on_the_base(random_arm, random_motion) -> None:
    model = RobotModel.from_description(with_armatures(random_arm(2, 0), (True, True)))
    assert not base_wrench_regressor(model, *random_motion(2, 0))[:, :, 20:].any()
