"""A payload that is part of the last link gives the same torques and variances as separate payload
columns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from config.arrays import FloatArray
from config.errors import ConfigError, EstimationError
from config.load import load_cell
from dynamics.geometry.kinematics import flange_pose
from dynamics.terms.conditions import Conditions
from identification.estimation.estimate import (
    Estimate,
    base_regressor,
    predict,
    predict_base_wrench,
)
from identification.payload.body import parameters_to_parent
from identification.payload.carried import carry, carry_own, without_payload
from tests.builders.certified import estimate_of
from tests.builders.known_model import estimate_with_terms, known_estimate, with_payload_columns
from tests.builders.raised_codes import raises_code

LOADED = Conditions(payload=True)


@pytest.fixture(scope="module", params=["plain", "lossy gears"])
def alone(request: pytest.FixtureRequest) -> Estimate:
    cell = load_cell("ir361")
    if request.param == "plain":
        return known_estimate(cell, {})
    return estimate_with_terms(cell, ("coulomb", "viscous", "load"), 10.0, 0.1)


def motion(rows: int = 30) -> tuple[FloatArray, FloatArray, FloatArray]:
    position, velocity, acceleration = np.random.default_rng(5).normal(0.0, 0.8, (3, rows, 3))
    return position, velocity, acceleration


def torque_variance(estimate: Estimate, conditions: Conditions | None = None) -> FloatArray:
    columns = base_regressor(estimate, *motion(), conditions)
    covariance = estimate.covariance_jackknife
    return np.asarray(np.einsum("skb,bc,skc->sk", columns, covariance, columns))


@pytest.mark.parametrize(
    ("change", "conditions"), [(carry_own, LOADED), (without_payload, Conditions())]
)
def test_torques_and_their_variances_equal_those_of_separate_columns(
    alone: Estimate, change: Callable[[Estimate], Estimate], conditions: Conditions
) -> None:
    both = with_payload_columns(alone)
    found = change(both)
    assert not found.options.payload
    np.testing.assert_allclose(
        predict(found, *motion()), predict(both, *motion(), conditions), rtol=1e-9, atol=1e-7
    )
    if not alone.model.transmission.losses:
        np.testing.assert_allclose(
            torque_variance(found), torque_variance(both, conditions), rtol=1e-7
        )


def test_the_base_wrench_equals_that_of_separate_columns() -> None:
    both = with_payload_columns(known_estimate(load_cell("ir361"), {}), kind="combined")
    for change, conditions in ((carry_own, LOADED), (without_payload, Conditions())):
        np.testing.assert_allclose(
            predict_base_wrench(change(both), *motion()),
            predict_base_wrench(both, *motion(), conditions),
            rtol=1e-9,
            atol=1e-7,
        )


def test_a_separate_payload_gives_the_torques_of_a_payload_identified_with_the_robot(
    alone: Estimate,
) -> None:
    payload = estimate_of(load_cell("ir361"), ("loaded run",))
    found = carry(alone, payload)
    np.testing.assert_allclose(
        predict(found, *motion()),
        predict(with_payload_columns(alone), *motion(), LOADED),
        rtol=1e-9,
        atol=1e-7,
    )
    exact = carry(alone, replace(payload, covariance=np.zeros((10, 10))))
    assert np.all(torque_variance(found) > torque_variance(exact))
    assert found.run_ids == ("loaded run",)


def test_a_payload_is_in_the_tool_frame_of_its_own_robot_file() -> None:
    """A robot file with another tool frame gives the payload other numbers, but equal torques."""
    alone = known_estimate(load_cell("ir361"), {})
    payload = estimate_of(load_cell("ir361"), ())
    offset = np.add(payload.robot.tool_offset_m, (0.1, -0.2, 0.3))
    shifted = payload.robot.model_copy(
        update={"tool_offset_m": tuple(offset), "tool_rpy_rad": (0.4, -0.5, 0.6)}
    )
    old_to_new = np.linalg.inv(flange_pose(shifted)) @ flange_pose(payload.robot)
    values = parameters_to_parent(np.asarray(old_to_new, dtype=np.float64)) @ payload.values
    np.testing.assert_allclose(
        predict(carry(alone, replace(payload, robot=shifted, values=values)), *motion()),
        predict(carry(alone, payload), *motion()),
        rtol=1e-9,
        atol=1e-7,
    )


def test_another_payload_replaces_the_one_in_the_model() -> None:
    alone = known_estimate(load_cell("ir361"), {})
    payload = estimate_of(load_cell("ir361"), ())
    heavier = replace(payload, values=2.0 * payload.values)
    np.testing.assert_allclose(
        predict(carry(with_payload_columns(alone), heavier), *motion()),
        predict(carry(alone, heavier), *motion()),
        rtol=1e-9,
        atol=1e-7,
    )


def test_the_payload_of_a_model_without_one_is_refused() -> None:
    with raises_code(ConfigError, "RID-PAYLOAD-UNSTATED"):
        carry_own(known_estimate(load_cell("ir361"), {}))


def test_a_payload_that_is_not_fully_determined_is_refused() -> None:
    hidden = replace(estimate_of(load_cell("ir361"), ()), unseen=np.eye(10)[:, -1:])
    with raises_code(EstimationError, "RID-MOTION-UNINFORMATIVE"):
        carry(known_estimate(load_cell("ir361"), {}), hidden)
