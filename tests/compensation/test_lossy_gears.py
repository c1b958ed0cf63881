"""Load-dependent gear losses in limits and stability bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.motion.samples import JointTrajectory
from compensation.feedforward.refinement import without_jumps
from compensation.timing.uncertainty import ModelMargin
from config.load import LoadedCell, load_cell
from identification.accuracy.goals import Goal, goal_states
from identification.estimation.estimate import Estimate, predict
from identification.payload.carried import carry
from tests.builders.certified import estimate_of
from tests.builders.known_model import estimate_with_terms, known_estimate
from tests.builders.warm_model import by_temperature


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture(scope="module")
def lossy(cell: LoadedCell) -> Estimate:
    return estimate_with_terms(cell, ("coulomb", "viscous", "load"), 10.0, 0.1)


def motion() -> JointTrajectory:
    random = np.random.default_rng(0)
    return JointTrajectory(*random.normal(0.0, 0.4, (3, 40, 3)))


def test_losses_jump_and_are_excluded_from_the_smooth_model_of_refinement(
    cell: LoadedCell, lossy: Estimate
) -> None:
    smooth, plain = without_jumps(lossy), without_jumps(known_estimate(cell, {}))
    np.testing.assert_allclose(predict(smooth, *motion()), predict(plain, *motion()), atol=1e-9)


def test_a_torque_margin_includes_a_payload_behind_lossy_gears(
    cell: LoadedCell, lossy: Estimate
) -> None:
    payload = estimate_of(cell, ("run",))
    exact = replace(payload, covariance=np.zeros((10, 10)))
    margin, least = (
        ModelMargin(carry(lossy, each), 0.95)(motion()).torque for each in (payload, exact)
    )
    assert np.all(margin > least)


def test_a_goal_for_the_torque_is_judged_for_any_friction_model(
    cell: LoadedCell, lossy: Estimate
) -> None:
    goal = Goal("torque", 1.0, False, "torque<1Nm")
    for model in (lossy, by_temperature(cell, measured=True)):
        (state,) = goal_states([goal], model, motion())
        assert state.sigma > 0.0
