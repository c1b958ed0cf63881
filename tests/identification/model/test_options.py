"""Selection of the terms of an estimate's model."""

from __future__ import annotations

import numpy as np
import pytest

from config.errors import EstimationError
from config.load import load_robot
from dynamics.model.robot_model import RobotModel
from identification.model.options import ModelOptions
from tests.builders.raised_codes import raises_code


@pytest.fixture
def robot():
    return load_robot("ir361")


def test_by_default_the_terms_of_the_robot_file_are_used(robot) -> None:
    model = ModelOptions().build(robot)
    assert model.parameter_names == RobotModel.from_description(robot).parameter_names


def test_friction_terms_replace_those_of_every_joint(robot) -> None:
    model = ModelOptions(friction_terms=("asymmetric", "stribeck")).build(robot)
    names = model.parameter_names[model.parameter_groups["friction"]]
    assert names == tuple(f"{symbol}_axis{j}" for j in (1, 2, 3) for symbol in ("fcp", "fcn", "fs"))
    assert model.nonlinear_names == ("vs_axis1", "vs_axis2", "vs_axis3")
    assert robot.joints[0].friction == ("coulomb", "viscous")


def test_an_empty_list_of_friction_terms_means_no_friction(robot) -> None:
    assert "friction" not in ModelOptions(friction_terms=()).build(robot).parameter_groups


def test_the_payload_parameters_are_the_last(robot) -> None:
    model = ModelOptions(payload=True).build(robot)
    assert model.parameter_groups["payload"].stop == len(model.parameter_names)


def test_options_set_the_nonlinear_parameters(robot) -> None:
    options = ModelOptions(friction_terms=("stribeck",), nonlinear=(0.1, 0.2, 0.3))
    np.testing.assert_array_equal(options.build(robot).nonlinear_values, [0.1, 0.2, 0.3])
    with raises_code(EstimationError, "RID-API-ARGUMENT", "vs_axis1", "vs_axis2", "vs_axis3"):
        ModelOptions(friction_terms=("stribeck",), nonlinear=(0.1,)).build(robot)


def test_contradictory_terms_are_refused(robot) -> None:
    with raises_code(EstimationError, "RID-OPTION-NAME"):
        ModelOptions(friction_terms=("asymmetric", "coulomb")).build(robot)
