"""Accuracy goals: how they are read, and how far an estimate is from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.errors import ConfigError
from config.load import load_robot
from dynamics.model.robot_model import RobotModel, regressor
from identification.accuracy.goals import Goal, GoalState, goal_states, parse_goals
from identification.estimation.estimate import Estimate
from identification.model.base_parameters import base_parameters
from identification.model.options import ModelOptions
from tests.builders.raised_codes import raises_code


@pytest.fixture(scope="module")
def model() -> RobotModel:
    return RobotModel.from_description(load_robot("ir361"))


@pytest.fixture(scope="module")
def estimate(model: RobotModel) -> Estimate:
    base = base_parameters(model)
    b = len(base)
    return Estimate(
        robot=load_robot("ir361"),
        options=ModelOptions(),
        base=base,
        values=np.full(b, 2.0),
        covariance_noise=0.01 * np.eye(b),
        covariance_residual=0.01 * np.eye(b),
        covariance_jackknife=0.04 * np.eye(b),
        condition_number=10.0,
        equations=1000,
        residual_nm=np.ones(3),
        noise_nm=np.ones(3),
        left_out_fraction=np.zeros(3),
        method="periodic",
        band_hz=10.0,
        standstill_rad_s=0.02,
        periods=4,
    )


@pytest.mark.parametrize(
    ("text", "goal"),
    [
        ("fc_axis1<0.5Nm", ("fc_axis1", 0.5, False)),
        ("Izz1 < 0.1 kg m^2", ("Izz1", 0.1, False)),
        ("fv_axis1<5%", ("fv_axis1", 0.05, True)),
        ("torque<1.5Nm", ("torque", 1.5, False)),
        ("fc_axis2<1e-1", ("fc_axis2", 0.1, False)),
    ],
)
def test_goals_are_read(model, text, goal) -> None:
    (found,) = parse_goals([text], model, base_parameters(model))
    assert (found.name, found.limit, found.relative) == goal


@pytest.mark.parametrize(
    ("text", "code", "details"),
    [
        ("fc_axis1=3", "RID-OPTION-SYNTAX", ("fv_axis1<5%",)),
        ("fc_axis1<0", "RID-OPTION-RANGE", ("above 0",)),
        ("fc_axis9<1", "RID-OPTION-NAME", ("fc_axis9", ", fv_axis1, ")),
        ("m3<0.05kg", "RID-OPTION-NAME", ("m3", "'Izz1 ", " m3 ")),
        ("m1<0.05kg", "RID-OPTION-NAME", ("m1",)),
        ("fc_axis1<0.5kg", "RID-OPTION-SYNTAX", ("Nm",)),
        ("torque<5%", "RID-OPTION-SYNTAX", ("in Nm",)),
    ],
)
def test_an_invalid_goal_is_refused(model, text, code, details) -> None:
    with raises_code(ConfigError, code, f"--until {text}: ", *details):
        parse_goals([text], model, base_parameters(model))


def test_a_parameter_is_judged_by_its_total_standard_deviation(estimate) -> None:
    still = np.zeros((5, 3))
    rest = (still, still, still)
    absolute, relative = goal_states(
        [Goal("fc_axis1", 0.3, False, "a"), Goal("fc_axis1", 0.05, True, "b")], estimate, rest
    )
    assert absolute.sigma == pytest.approx(0.2)
    assert absolute.reached
    assert relative.limit == pytest.approx(0.1)
    assert not relative.reached


def test_torque_is_judged_over_a_motion(model, estimate) -> None:
    motion = tuple(np.random.default_rng(0).normal(size=(3, 50, 3)))
    (state,) = goal_states([Goal("torque", 1.0, False, "torque<1")], estimate, motion)
    phi = estimate.base.columns(regressor(model, *motion))
    draws = 0.2 * np.random.default_rng(1).normal(size=(4000, len(estimate.base)))
    spread = np.sqrt(np.mean(np.einsum("snb,db->dsn", phi, draws) ** 2, axis=(0, 1))).max()
    assert state.sigma == pytest.approx(spread, rel=0.05)


class TestAdvice:
    goal = Goal("fc_axis1", 0.1, False, "fc_axis1<0.1Nm")

    def test_more_periods_are_recommended_if_noise_dominates(self) -> None:
        state = GoalState(self.goal, sigma=0.2, limit=0.1, noise=0.2, unit="N m")
        assert "about 16 periods in total" in state.sentence(4)

    def test_another_model_is_recommended_if_its_error_dominates(self) -> None:
        state = GoalState(self.goal, sigma=0.2, limit=0.1, noise=0.01, unit="N m")
        assert "more periods do not reduce" in state.sentence(4)

    def test_nothing_is_recommended_if_the_goal_is_reached(self) -> None:
        state = GoalState(self.goal, sigma=0.05, limit=0.1, noise=0.01, unit="N m")
        assert state.sentence(4).endswith("reached")
        assert replace(state, sigma=0.3).reached is False
