from __future__ import annotations

import numpy as np
import pytest

from config.errors import EstimationError
from dynamics.friction import Friction
from dynamics.robot_model import RobotModel, base_wrench_regressor, regressor

ALL_TERMS = ("coulomb", "viscous", "offset", "cubic", "cube_root")


@pytest.fixture
def robot(ir361):
    """Axis 1 with every term, axis 2 with one and sliding, axis 3 with none."""
    chosen = (ALL_TERMS, ("viscous",), ())
    kinds = ("revolute", "prismatic", "revolute")
    joints = tuple(
        joint.model_copy(update={"friction": terms, "type": kind})
        for joint, terms, kind in zip(ir361.joints, chosen, kinds, strict=True)
    )
    return ir361.model_copy(update={"joints": joints, "spring": None})


def columns(robot, v, **options):
    model = RobotModel.from_description(robot, **options)
    phi = regressor(model, np.zeros_like(v), v, np.zeros_like(v))
    return phi[:, :, model.parameter_groups["friction"]]


def test_each_joint_has_the_terms_it_chose(robot) -> None:
    friction = Friction.from_description(robot)
    assert friction.parameter_names == (
        "fc_axis1", "fv_axis1", "fo_axis1", "f3_axis1", "fcr_axis1", "fv_axis2",
    )  # fmt: skip
    assert friction.parameter_units == (
        "N m", "N m s/rad", "N m", "N m (s/rad)^3", "N m (s/rad)^(1/3)", "N s/m",
    )  # fmt: skip


def test_columns_are_the_terms_of_that_joints_speed(robot) -> None:
    v = np.array([[-8.0, 3.0, 1.0], [0.0, 0.0, 0.0], [0.125, -1.0, 2.0]])
    phi = columns(robot, v)
    np.testing.assert_allclose(
        phi[:, 0, :5],
        [[-1.0, -8.0, 1.0, -512.0, -2.0], [0, 0, 1, 0, 0], [1.0, 0.125, 1.0, 0.125**3, 0.5]],
    )
    np.testing.assert_array_equal(phi[:, 1, 5], v[:, 1])
    assert not phi[:, 0, 5].any()
    assert not phi[:, 1, :5].any()
    assert not phi[:, 2].any()


def test_a_smoothed_sign_is_a_sign_at_speed_and_linear_through_zero(robot) -> None:
    v = np.array([[-1.0, 0, 0], [-1e-4, 0, 0], [1e-4, 0, 0], [1.0, 0, 0]])
    coulomb = columns(robot, v, sign_smoothing_rad_s=0.01)[:, 0, 0]
    np.testing.assert_allclose(coulomb, [-1.0, -0.01, 0.01, 1.0], rtol=1e-4)


@pytest.mark.parametrize("smoothing", [-0.1, np.nan, np.inf])
def test_a_smoothing_that_cannot_be_meant_is_refused(robot, smoothing) -> None:
    with pytest.raises(EstimationError, match="sign_smoothing_rad_s"):
        RobotModel.from_description(robot, sign_smoothing_rad_s=smoothing)


def test_the_base_does_not_feel_friction(robot) -> None:
    model = RobotModel.from_description(robot)
    phi = base_wrench_regressor(model, *np.ones((3, 4, 3)))
    assert not phi[:, :, model.parameter_groups["friction"]].any()
