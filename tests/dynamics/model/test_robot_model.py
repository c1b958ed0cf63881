from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from config.errors import EstimationError
from dynamics.model.robot_model import (
    RobotModel,
    base_wrench_regressor,
    regressor,
    regressor_blocks,
    torque,
)
from dynamics.terms.conditions import Conditions
from tests.builders.raised_codes import raises_code


@pytest.fixture
def model(ir361) -> RobotModel:
    return RobotModel.from_description(ir361)


def test_columns_are_ordered_by_term_with_links_first(model) -> None:
    assert model.joint_names == ("axis1", "axis2", "axis3")
    assert model.parameter_groups == {
        "rigid_body": slice(0, 30),
        "rotors": slice(30, 33),
        "friction": slice(33, 39),
        "spring": slice(39, 41),
    }
    assert len(model.parameter_names) == len(model.parameter_units) == 41
    assert model.parameter_names[30:34] == ("Im1", "Im2", "Im3", "fc_axis1")


@pytest.mark.parametrize(
    ("options", "groups"),
    [
        ({"rotors": False}, ["rigid_body", "friction", "spring"]),
        ({"friction": False, "spring": False}, ["rigid_body", "rotors"]),
        ({"rotors": False, "friction": False, "spring": False}, ["rigid_body"]),
    ],
)
def test_terms_can_be_omitted(options, groups, ir361, model, random_motion) -> None:
    """Omitting a term changes no other column."""
    part = RobotModel.from_description(ir361, **options)
    assert list(part.parameter_groups) == groups
    motion = random_motion(3, 0)
    kept = [model.parameter_names.index(name) for name in part.parameter_names]
    for function in (regressor, base_wrench_regressor):
        np.testing.assert_array_equal(function(part, *motion), function(model, *motion)[:, :, kept])


def test_a_robot_without_rotors_spring_and_friction_has_link_columns_only(ir361) -> None:
    bare = tuple(j.model_copy(update={"rotor": None, "friction": ()}) for j in ir361.joints)
    robot = ir361.model_copy(update={"joints": bare, "spring": None})
    assert list(RobotModel.from_description(robot).parameter_groups) == ["rigid_body"]


def test_torque_is_the_regressor_times_the_parameters(model, random_motion) -> None:
    q, v, a = random_motion(3, 5)
    theta = np.random.default_rng(5).standard_normal(41)
    expected = regressor(model, q, v, a) @ theta
    np.testing.assert_allclose(torque(model, q, v, a, theta), expected, rtol=0, atol=1e-9)


def test_parts_of_the_regressor_in_reused_memory_equal_the_whole(ir361) -> None:
    """Each block uses the temperatures and loads of its own samples."""
    joint = {"friction": ("viscous", "temperature"), "efficiency": 0.9}
    joints = tuple(j.model_copy(update=joint) for j in ir361.joints)
    model = RobotModel.from_description(ir361.model_copy(update={"joints": joints}), payload=True)
    rng = np.random.default_rng(3)
    q, v, a = rng.standard_normal((3, 50, 3))
    conditions = Conditions(rng.uniform(290.0, 320.0, (50, 3)), rng.standard_normal((50, 3)), True)
    expected = regressor(model, q, v, a, conditions)
    places = set()
    for samples, phi in regressor_blocks(model, q, v, a, conditions, block=16):
        np.testing.assert_array_equal(phi, expected[samples])
        expected[samples] = np.nan
        places.add(phi.__array_interface__["data"])
    assert np.isnan(expected).all()
    assert len(places) == 1


def test_every_sample_is_independent_of_the_others(model, random_motion) -> None:
    q, v, a = random_motion(3, 2)
    together = regressor(model, q, v, a)
    alone = [regressor(model, q[[s]], v[[s]], a[[s]])[0] for s in range(8)]
    np.testing.assert_array_equal(together, alone)


def test_arrays_may_be_read_only_strided_or_lists(model, random_motion) -> None:
    q, v, a = random_motion(3, 2)
    expected = regressor(model, q, v, a)
    q.setflags(write=False)
    np.testing.assert_array_equal(regressor(model, q, np.asfortranarray(v), a.tolist()), expected)


def test_no_samples_give_no_rows(model) -> None:
    none = np.zeros((0, 3))
    assert regressor(model, none, none, none).shape == (0, 3, 41)
    assert base_wrench_regressor(model, none, none, none).shape == (0, 6, 41)


@pytest.mark.parametrize(
    "shapes", [[(4, 2)] * 3, [(4, 3), (4, 3), (5, 3)], [(3,)] * 3, [(2, 4, 3)] * 3, [()] * 3]
)
def test_motions_of_another_shape_are_refused(shapes, model) -> None:
    q, v, a = map(np.zeros, shapes)
    for function in (regressor, base_wrench_regressor):
        with raises_code(EstimationError, "RID-API-ARGUMENT"):
            function(model, q, v, a)


def test_a_wrong_number_of_parameters_is_refused(model, random_motion) -> None:
    q, v, a = random_motion(3, 0)
    with raises_code(EstimationError, "RID-API-ARGUMENT", "41"):
        torque(model, q, v, a, np.zeros(40))


@dataclass(frozen=True)
class Damper:
    """A user-defined term: torque at the first joint, proportional to cos q1."""

    name = "damper"
    through_gears = False
    parameter_names = ("damping",)
    parameter_units = ("N m s/rad",)

    def fill_torque(self, motion, out) -> None:
        q, v, _ = motion.joint
        out[:, 0, 0] = v[:, 0] * np.cos(q[:, 0])

    def fill_base_wrench(self, motion, out) -> None:
        """Add nothing to the base wrench."""


def test_a_user_defined_term_adds_its_columns(model, random_motion) -> None:
    q, v, a = random_motion(3, 0)
    wider = replace(model, terms=(*model.terms, Damper()))
    phi = regressor(wider, q, v, a)
    np.testing.assert_array_equal(phi[:, :, :41], regressor(model, q, v, a))
    np.testing.assert_array_equal(phi[:, 0, 41], v[:, 0] * np.cos(q[:, 0]))


def test_two_terms_with_one_name_are_refused(model) -> None:
    with raises_code(EstimationError, "RID-API-ARGUMENT", "damping"):
        replace(model, terms=(*model.terms, Damper(), Damper()))
