"""A joint that no run moves: only its own parameters remain unknown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.processing.periods import average_periods
from acquisition.processing.smoothing import SmoothedSignals
from acquisition.recording.recording import Recording
from config.errors import EstimationError
from dynamics.model.robot_model import RobotModel, torque
from identification.accuracy.identifiability import still_findings
from identification.estimation.estimate import Estimate, predict
from identification.estimation.file import read_estimate, write_estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

Array = NDArray[np.float64]
STOOD = 0.7


def sines(seed: int, third: float, amplitude: float = 0.0) -> tuple[Array, Array, Array]:
    """Return q, v, a of sines on the first two joints; the third is at rest or moves."""
    random = np.random.default_rng(seed)
    omega, time_s = 2.0 * np.pi / 10.0 * np.arange(1, 6), 0.01 * np.arange(3000)
    sine = random.normal(size=(5, 3)) * np.array([0.4, 0.4, amplitude])
    s, c = np.sin(np.outer(time_s, omega)), np.cos(np.outer(time_s, omega))
    return s @ sine + [0.0, 0.0, third], (c * omega) @ sine, -(s * omega**2) @ sine


def signals(arm: KnownArm, motion: tuple[Array, Array, Array]) -> SmoothedSignals:
    """Return a recording of the arm; joint 3 has an additional torque of 30 N m at rest."""
    random = np.random.default_rng(5)
    tau = torque(arm.model, *motion, arm.standard) + random.normal(size=motion[0].shape)
    tau[:, 2] += 30.0 * (np.abs(motion[1][:, 2]) < 0.02)
    return SmoothedSignals(
        joint_names=arm.robot.joint_names,
        time_s=0.01 * np.arange(len(tau), dtype=np.float64),
        position=motion[0],
        velocity=motion[1],
        acceleration=motion[2],
        torque_nm=tau,
        segment=np.zeros(len(tau), dtype=np.int64),
        sample_period_s=0.01,
        cutoff_hz=10.0,
    )


@pytest.fixture(scope="module")
def smoothed(arm: KnownArm) -> Estimate:
    return fit_smoothed(arm.robot, [signals(arm, sines(0, STOOD))]).estimate()


@pytest.fixture(scope="module")
def periodic(arm: KnownArm, measure: Callable[..., Recording]) -> Estimate:
    joints = tuple(
        each.model_copy(update={"offset": STOOD, "sine": (0.0,), "cosine": (0.0,)})
        if each.joint == "axis3"
        else each
        for each in arm.motion.joints
    )
    motion: FourierMotion = arm.motion.model_copy(update={"joints": joints})
    return fit_periodic(arm.robot, [average_periods(measure(motion=motion))]).estimate()


@pytest.mark.parametrize("kind", ["smoothed", "periodic"])
def test_parameters_of_the_other_joints_are_identified(
    kind: str, arm: KnownArm, request: pytest.FixtureRequest
) -> None:
    estimate: Estimate = request.getfixturevalue(kind)
    (still,) = estimate.still
    assert still.joint == "axis3"
    assert still.positions == pytest.approx([STOOD], abs=1e-3)
    assert {"fc_axis3", "fv_axis3"} <= set(estimate.base.unseen)
    assert {"fc_axis1", "fv_axis2"} <= set(estimate.base.names)
    off = (estimate.values - estimate.base.from_standard(arm.standard)) / estimate.sigma
    assert np.max(np.abs(off)) < 4.0
    assert "axis3" in still_findings(estimate)[0]


def test_a_prediction_is_limited_to_the_pose_of_the_joint_at_rest(
    smoothed: Estimate, arm: KnownArm
) -> None:
    motion = sines(1, STOOD)
    true = torque(arm.model, *motion, arm.standard)
    moving = predict(smoothed, *motion)[:, :2]
    np.testing.assert_allclose(moving, true[:, :2], atol=0.02 * np.abs(true).max())
    for other in (sines(1, STOOD + 0.1), sines(1, STOOD, amplitude=0.1)):
        with pytest.raises(EstimationError) as refused:
            predict(smoothed, *other)
        assert refused.value.refusal == "RID-MODEL-STILL"


def test_a_file_contains_the_position_of_the_joint_at_rest(
    smoothed: Estimate, tmp_path: Path
) -> None:
    write_estimate(tmp_path / "model.json", smoothed)
    assert read_estimate(tmp_path / "model.json").still == smoothed.still


def test_a_second_run_that_moves_the_joint_determines_all(arm: KnownArm) -> None:
    runs = [signals(arm, sines(0, STOOD)), signals(arm, sines(2, 0.0, amplitude=0.4))]
    estimate = fit_smoothed(arm.robot, runs).estimate()
    assert estimate.still == ()
    assert "fc_axis3" in estimate.base.names


def test_two_positions_determine_more_than_one(arm: KnownArm, smoothed: Estimate) -> None:
    runs = [signals(arm, sines(0, STOOD)), signals(arm, sines(2, STOOD - 1.0))]
    estimate = fit_smoothed(arm.robot, runs).estimate()
    (still,) = estimate.still
    assert still.positions == pytest.approx((STOOD, STOOD - 1.0))
    assert len(estimate.base) > len(smoothed.base)


def test_a_prior_adds_no_parameter_to_a_joint_at_rest_without_friction(arm: KnownArm) -> None:
    # Without friction terms the rows at rest seemed to determine the rotor's inertia.
    model = RobotModel.from_description(arm.robot, friction=False)
    truth = dict(zip(arm.model.parameter_names, arm.standard, strict=True))
    known = np.array([truth[name] for name in model.parameter_names])
    motion = sines(0, STOOD)
    still = replace(signals(arm, motion), torque_nm=torque(model, *motion, known))
    options = EstimationOptions(
        model=ModelOptions(friction=False), prior=(known, np.maximum(np.abs(known), 0.1))
    )
    estimate = fit_smoothed(arm.robot, [still], options).estimate()
    assert "Im3" in estimate.base.unseen
    np.testing.assert_allclose(estimate.values, estimate.base.from_standard(known), rtol=1e-3)


def test_a_short_disturbance_of_the_joint_is_not_a_motion(arm: KnownArm) -> None:
    q, v, a = sines(0, STOOD)
    v[1000:1005, 2] = 0.07
    q[1000:, 2] += 0.003
    estimate = fit_smoothed(arm.robot, [signals(arm, (q, v, a))]).estimate()
    assert [each.joint for each in estimate.still] == ["axis3"]
    assert estimate.left_out_fraction[2] == 1.0
