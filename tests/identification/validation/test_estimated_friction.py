"""Friction curves of an estimate, and the conditions under which they apply."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.errors import ConfigError
from config.load import load_cell
from identification.estimation.estimate import Estimate
from identification.model.options import ModelOptions
from identification.validation.estimated_friction import EstimatedFriction
from tests.builders.known_model import known_estimate
from tests.builders.raised_codes import raises_code
from tests.builders.warm_model import by_temperature

CELL = load_cell("ir361")
SPEED = np.array([-1.0, 0.3, 2.0])


def with_load_friction(estimate: Estimate, joint: int) -> Estimate:
    """Return a model with load-dependent losses in the gear of one joint."""
    joints = list(estimate.robot.joints)
    joints[joint] = joints[joint].model_copy(update={"friction": (*joints[joint].friction, "load")})
    return replace(estimate, robot=estimate.robot.model_copy(update={"joints": tuple(joints)}))


def test_friction_equals_that_of_the_model() -> None:
    estimate = known_estimate(CELL, {})
    values = dict(zip(estimate.base.names, estimate.values, strict=True))
    found = EstimatedFriction(estimate).torque(1, SPEED)
    np.testing.assert_allclose(
        found, values["fc_axis2"] * np.sign(SPEED) + values["fv_axis2"] * SPEED
    )


@pytest.mark.parametrize("measured", [True, False])
def test_friction_is_without_warming_and_says_so(measured: bool) -> None:
    plain = EstimatedFriction(known_estimate(CELL, {}))
    warm = EstimatedFriction(by_temperature(CELL, measured=measured))
    np.testing.assert_allclose(warm.torque(0, SPEED), plain.torque(0, SPEED))
    assert plain.conditions_in_words(0) == ""
    assert warm.conditions_in_words(0) == (
        "at 25 °C" if measured else "for a joint after a long rest"
    )
    assert warm.conditions_in_words(2) == ""


def test_load_dependent_friction_is_omitted_and_that_is_stated() -> None:
    estimate = known_estimate(CELL, {})
    friction = EstimatedFriction(with_load_friction(estimate, 1))
    np.testing.assert_allclose(
        friction.torque(1, SPEED), EstimatedFriction(estimate).torque(1, SPEED)
    )
    words = "without load-dependent friction"
    assert [friction.conditions_in_words(j) for j in range(3)] == ["", words, ""]
    both = EstimatedFriction(with_load_friction(by_temperature(CELL, measured=True), 1))
    assert both.conditions_in_words(1) == "at 25 °C and without load-dependent friction"


def test_a_model_without_friction_is_refused() -> None:
    with raises_code(ConfigError, "RID-MODEL-NO-FRICTION"):
        EstimatedFriction(replace(known_estimate(CELL, {}), options=ModelOptions(friction=False)))
