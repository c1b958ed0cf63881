"""The torque that is compared with limits, if friction depends on temperature."""

from __future__ import annotations

import numpy as np
import pytest

from config.load import LoadedCell, load_cell
from dynamics.terms.conditions import Conditions
from identification.estimation.estimate import predict
from identification.estimation.limit_torque import limit_temperature_note, limit_torque
from tests.builders.known_model import known_estimate
from tests.builders.warm_model import by_temperature
from tests.builders.warming_arm import motion

WAY = motion(20.0, 4)
COLD_K = 298.15


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    return load_cell("ir361")


def test_a_warming_joint_has_the_larger_torque_of_cold_and_warm(cell: LoadedCell) -> None:
    followed = by_temperature(cell, measured=False)
    assert followed.warming is not None
    settled = followed.warming.steady_temperatures(followed.robot, WAY[1])
    cold, half, warm = (
        np.abs(predict(followed, *WAY, Conditions(temperature_k=COLD_K + share)))
        for share in (0.0 * (settled - COLD_K), 0.5 * (settled - COLD_K), settled - COLD_K)
    )
    assert (cold > warm).any()
    assert (warm > cold).any()  # at which friction helps to slow down
    held = np.abs(limit_torque(followed, *WAY))
    np.testing.assert_array_equal(held, np.maximum(cold, warm))
    assert (half <= held + 1e-9).all()
    assert "axis1, axis2 after a long rest" in limit_temperature_note(followed)


def test_with_measured_temperatures_the_torque_is_that_at_the_reference_with_a_note(
    cell: LoadedCell,
) -> None:
    measured = by_temperature(cell, measured=True)
    there = Conditions(temperature_k=np.full(3, COLD_K))
    np.testing.assert_array_equal(limit_torque(measured, *WAY), predict(measured, *WAY, there))
    assert "(axis1 25 °C, axis2 25 °C)" in limit_temperature_note(measured)


def test_other_models_have_their_own_torque(cell: LoadedCell) -> None:
    plain = known_estimate(cell, {})
    np.testing.assert_array_equal(limit_torque(plain, *WAY), predict(plain, *WAY))
    assert limit_temperature_note(plain) == ""
