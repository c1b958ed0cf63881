"""A motion file that was timed with an identified model: its content and its safety margin."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acquisition.motion.kinds.motion import Motion
from acquisition.motion.limits import verify_limits
from acquisition.motion.motion_file import MotionFile
from acquisition.motion.samples import MotionSamples
from compensation.timing.limits import TimingLimits
from compensation.timing.timed_motion import TimedMotion, retime_path
from compensation.timing.uncertainty import ModelMargin
from config.errors import ConfigError, LimitError
from config.load import LoadedCell, load_cell
from identification.estimation.estimate import Estimate, predict
from tests.builders.known_model import known_estimate
from tests.builders.raised_codes import raises_code

POINTS = ((0.0, 0.0, 0.0), (0.5, 0.3, -0.4), (0.9, 0.1, 0.3), (0.0, 0.2, 0.5))
LINES: dict[str, Any] = {
    "kind": "path",
    "robot": "ir361",
    "start_m": (0.6, -0.2, -1.7),
    "near": (0.1, -0.1, 0.4),
    "speed_m_s": 0.4,
    "segments": (
        {"kind": "line", "to_m": (0.6, 0.1, -1.7)},
        {"kind": "line", "to_m": (0.8, 0.1, -1.7)},
    ),
}
CIRCLE: dict[str, Any] = {
    "kind": "circle",
    "robot": "ir361",
    "centre_m": (0.575, -0.078, -1.724),
    "radius_m": 0.1,
    "speed_m_s": 0.3,
    "near": (0.1, -0.1, 0.4),
    "periods": 2,
    "transient_periods": 0,
}


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture(scope="module")
def model(cell: LoadedCell) -> Estimate:
    """Return the true values with an uncertainty of 1 %."""
    found = known_estimate(cell, {})
    covariance = np.diag((0.01 * found.values) ** 2)
    return replace(found, covariance_jackknife=covariance, residual_nm=np.array([4.0, 4.0, 1.5]))


@pytest.fixture(scope="module")
def limits(cell: LoadedCell) -> TimingLimits:
    return TimingLimits.of_robot(cell.robot)


def planned(cell: LoadedCell, **keys: Any) -> MotionSamples:
    motion: Motion = MotionFile.model_validate(keys).root
    return motion.plan(cell.robot, cell.config.cycle_time_s)


def points(cell: LoadedCell) -> MotionSamples:
    return planned(cell, kind="joint_path", robot="ir361", points=POINTS)


def plan_within_limits(timed: TimedMotion, cell: LoadedCell, model: Estimate) -> MotionSamples:
    """Plan the written motion as `record` does, and compare it with robot and model."""
    again = MotionFile.model_validate_json(timed.motion.model_dump_json()).root
    assert again == timed.motion
    samples = again.plan(cell.robot, cell.config.cycle_time_s)
    verify_limits(samples, cell.robot)
    torque = predict(model, samples.position, samples.velocity, samples.acceleration)
    allowed = [joint.limits.torque for joint in cell.robot.joints]
    assert (np.abs(torque) <= np.array(allowed) * (1.0 + 1e-9)).all()
    return samples


def test_a_timed_motion_is_faster_and_keeps_its_path(
    cell: LoadedCell, model: Estimate, limits: TimingLimits
) -> None:
    samples = points(cell)
    timed = retime_path(samples, cell.robot, model, limits)
    assert timed.shorter > 0.2
    found = plan_within_limits(timed, cell, model)
    gap = np.linalg.norm(samples.position[:, np.newaxis] - found.position, axis=2).min(axis=1)
    fastest = limits.speed.max() * cell.config.cycle_time_s
    assert gap.max() < fastest
    assert timed.off < 1e-4


@pytest.mark.parametrize("keys", [LINES, CIRCLE], ids=["stops in a corner", "turns of a circle"])
def test_tool_paths_are_timed(
    keys: dict[str, Any], cell: LoadedCell, model: Estimate, limits: TimingLimits
) -> None:
    timed = retime_path(planned(cell, **keys), cell.robot, model, limits)
    assert len(timed.ways) == (2 if keys is LINES else 1)
    assert timed.shorter > 0.0
    plan_within_limits(timed, cell, model)


def test_a_margin_for_the_uncertainty_stays_unused(
    cell: LoadedCell, model: Estimate, limits: TimingLimits
) -> None:
    samples = points(cell)
    tight = replace(limits, torque=0.5 * limits.torque)
    bold, careful = (
        retime_path(samples, cell.robot, model, tight, confidence=share) for share in (0.0, 0.95)
    )
    assert careful.moving_s > bold.moving_s
    (way,) = careful.ways
    assert way.margins is not None
    assert (way.margins.torque > 1.9 * 1.5).all()
    assert (np.abs(way.torque) + way.margins.torque <= tight.torque).all()
    surely = retime_path(samples, cell.robot, model, tight, confidence=0.999)
    assert surely.moving_s > careful.moving_s


def test_the_margin_equals_the_scatter_of_random_parameters(
    cell: LoadedCell, model: Estimate
) -> None:
    """Compare with the standard deviation over 600 robots drawn from the estimate."""
    exact = replace(model, residual_nm=np.zeros(3))
    samples = points(cell)
    rows = slice(40, 60)
    motion = (samples.position[rows], samples.velocity[rows], samples.acceleration[rows])
    margin = ModelMargin(exact, 0.95)
    found = margin(type(within_path(samples))(*motion)).torque / margin.deviations
    draws = np.random.default_rng(1).multivariate_normal(
        exact.values, exact.covariance_jackknife, 3000
    )
    torques = [predict(replace(exact, values=values), *motion) for values in draws[:600]]
    np.testing.assert_allclose(np.std(torques, axis=0), found, rtol=0.15)


def within_path(samples: MotionSamples) -> Any:
    from acquisition.motion.samples import JointTrajectory

    return JointTrajectory(samples.position, samples.velocity, samples.acceleration)


def test_a_torque_limit_that_is_too_small_is_named(
    cell: LoadedCell, model: Estimate, limits: TimingLimits
) -> None:
    weak = replace(limits, torque=limits.torque * np.array([1.0, 0.02, 1.0]))
    with raises_code(LimitError, "RID-TIMING-NOT-FEASIBLE", "axis2", "12."):
        retime_path(points(cell), cell.robot, model, weak)


def test_a_limit_of_the_base_needs_a_model_of_the_base(
    cell: LoadedCell, model: Estimate, limits: TimingLimits
) -> None:
    with raises_code(ConfigError, "RID-MODEL-NOT-COMBINED"):
        retime_path(points(cell), cell.robot, model, replace(limits, base=np.full(6, 1e4)))


def test_another_cycle_time_is_refused(
    cell: LoadedCell, model: Estimate, limits: TimingLimits
) -> None:
    timed = retime_path(points(cell), cell.robot, model, limits)
    with raises_code(ConfigError, "RID-MOTION-CYCLE"):
        timed.motion.plan(cell.robot, 0.5 * cell.config.cycle_time_s)
