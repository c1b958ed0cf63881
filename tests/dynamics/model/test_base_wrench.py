from __future__ import annotations

import numpy as np
import pytest

from config.errors import EstimationError
from config.load import load_robot
from dynamics.model.base_wrench import base_wrench, base_wrench_gradient
from dynamics.model.robot_model import RobotModel
from tests.builders.raised_codes import raises_code


@pytest.mark.parametrize("name", ["ir361", "ur10e"])
def test_the_gradient_agrees_with_central_differences(name: str) -> None:
    model = RobotModel.from_description(load_robot(name))
    random = np.random.default_rng(0)
    n = model.chain.n
    q, v, a = random.normal(size=(3, 5, n))
    theta = random.normal(size=len(model.parameter_names))
    weights = random.normal(size=(5, 6))
    gradient = base_wrench_gradient(model, q, v, a, theta, weights)
    direction = random.normal(size=(3, 5, n))

    def along(step: float) -> float:
        moved = np.array([q, v, a]) + step * direction
        return float(np.sum(weights * base_wrench(model, moved[0], moved[1], moved[2], theta)))

    h = 1e-3  # Richardson's extrapolation of central differences
    once, twice = ((along(s) - along(-s)) / (2.0 * s) for s in (h, 2.0 * h))
    slope = (4.0 * once - twice) / 3.0
    assert np.sum(gradient * direction) == pytest.approx(slope, rel=1e-7)


def test_parameters_of_another_model_are_refused() -> None:
    model = RobotModel.from_description(load_robot("ir361"))
    rest = np.zeros((1, 3))
    with raises_code(EstimationError, "RID-API-ARGUMENT", "parameters"):
        base_wrench(model, rest, rest, rest, np.zeros(3))
