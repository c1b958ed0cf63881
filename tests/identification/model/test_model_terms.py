"""Coupling, temperature, payload and gear losses: simulated and recovered by the estimators."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from acquisition.processing.smoothing import SmoothedSignals
from acquisition.recording.recording import Recording
from config.errors import EstimationError
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, torque
from dynamics.terms.conditions import Conditions
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.base_parameters import base_parameters
from identification.model.options import ModelOptions
from identification.validation.torque_prediction import validate_torques
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

NOISE_NM = np.array([1.0, 2.0, 0.3])
COUPLING = ((1.0, 0.0, 0.0), (0.1, 1.0, 0.0), (-0.2, -0.4, 1.0))
WARM = ("coulomb", "viscous", "temperature")


def with_joints(robot: RobotDescription, **changes: Any) -> RobotDescription:
    joints = tuple(joint.model_copy(update=changes) for joint in robot.joints)
    return robot.model_copy(update={"joints": joints})


def truth(arm: KnownArm, model: RobotModel, **others: float) -> np.ndarray:
    """Return the known arm's parameters together with the given ones."""
    known = dict(zip(arm.model.parameter_names, arm.standard, strict=True)) | others
    return np.array([known[name] for name in model.parameter_names])


def signals_of(
    arm: KnownArm,
    model: RobotModel,
    theta: np.ndarray,
    conditions: Conditions | None = None,
    seed=0,
) -> SmoothedSignals:
    trajectory = arm.motion.trajectory(arm.robot, 0.01)
    times = np.arange(3000, dtype=np.float64) * 0.01
    q, v, a = (
        f(times) for f in (trajectory.position, trajectory.velocity, trajectory.acceleration)
    )
    noise = NOISE_NM * np.random.default_rng(seed).standard_normal(q.shape)
    return SmoothedSignals(
        joint_names=arm.robot.joint_names,
        time_s=times,
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=torque(model, q, v, a, theta, conditions) + noise,
        segment=np.zeros(len(times), dtype=np.int64),
        sample_period_s=0.01,
        cutoff_hz=50.0,
        temperature_k=None if conditions is None else conditions.temperature_k,
    )


def deviations(estimate: Any, theta: np.ndarray) -> np.ndarray:
    return (estimate.values - estimate.base.from_standard(theta)) / estimate.sigma


def test_a_coupled_robot_is_identified_from_actuator_torques(arm: KnownArm) -> None:
    robot = arm.robot.model_copy(update={"coupling": COUPLING})
    model = RobotModel.from_description(robot)
    theta = truth(arm, model)
    signals = signals_of(arm, model, theta)
    estimate = fit_smoothed(robot, [signals]).estimate()
    assert np.mean(np.abs(deviations(estimate, theta)) < 2.5) >= 0.9
    np.testing.assert_allclose(estimate.residual_nm, NOISE_NM, rtol=0.06)
    blind = fit_smoothed(arm.robot, [signals]).estimate()
    assert np.all(blind.residual_nm > 3.0 * NOISE_NM)


def test_a_coupled_actuator_is_at_rest_when_its_own_speed_is_zero(arm: KnownArm) -> None:
    """Only the rows at rest are left out: arbitrary torques in these rows have no effect."""
    robot = arm.robot.model_copy(update={"coupling": COUPLING})
    model = RobotModel.from_description(robot)
    signals = signals_of(arm, model, truth(arm, model))
    speed = np.linalg.solve(np.array(COUPLING), signals.velocity.T).T
    slow = np.abs(speed) < 0.05
    spoilt = replace(signals, torque_nm=np.where(slow, 1000.0, signals.torque_nm))
    clean, other = (
        fit_smoothed(robot, [s], EstimationOptions(standstill_rad_s=0.05)).estimate()
        for s in (signals, spoilt)
    )
    np.testing.assert_allclose(clean.left_out_fraction, slow.mean(axis=0))
    np.testing.assert_array_equal(clean.values, other.values)


class TestTemperature:
    @pytest.fixture
    def robot(self, arm: KnownArm) -> RobotDescription:
        return with_joints(arm.robot, friction=WARM, reference_temperature_k=300.0)

    @pytest.fixture
    def theta(self, arm: KnownArm, robot: RobotDescription) -> np.ndarray:
        slopes = {
            f"{s}_axis{j}": -size / j for j in (1, 2, 3) for s, size in (("fcT", 0.3), ("fvT", 0.8))
        }
        return truth(arm, RobotModel.from_description(robot), **slopes)

    @pytest.fixture
    def signals(self, arm: KnownArm, robot: RobotDescription, theta: np.ndarray) -> SmoothedSignals:
        warming = np.linspace(295.0, 320.0, 3000)[:, np.newaxis] + np.array([0.0, 2.0, 5.0])
        conditions = Conditions(temperature_k=warming)
        return signals_of(arm, RobotModel.from_description(robot), theta, conditions)

    def test_friction_that_falls_with_temperature_is_recovered(
        self, robot: RobotDescription, theta: np.ndarray, signals: SmoothedSignals
    ) -> None:
        estimate = fit_smoothed(robot, [signals]).estimate()
        assert np.mean(np.abs(deviations(estimate, theta)) < 2.5) >= 0.9
        np.testing.assert_allclose(estimate.residual_nm, NOISE_NM, rtol=0.06)

    def test_validation_predicts_at_the_recorded_temperature(
        self, robot: RobotDescription, theta: np.ndarray, signals: SmoothedSignals
    ) -> None:
        estimate = fit_smoothed(robot, [signals]).estimate()
        recording = Recording(
            joint_names=signals.joint_names,
            time_s=signals.time_s,
            position=signals.position,
            torque_nm=signals.torque_nm,
            temperature_k=signals.temperature_k,
            valid=np.ones(len(signals), dtype=np.bool_),
            phase=np.zeros(len(signals), dtype=np.uint8),
            sample_index=np.full(len(signals), -1),
            source="import",
        )
        validation = validate_torques(estimate, recording)
        assert np.all(validation.rms_nm < NOISE_NM)
        with raises_code(EstimationError, "RID-MODEL-TEMPERATURE"):
            validate_torques(estimate, replace(recording, temperature_k=None))


def test_runs_with_and_without_payload_separate_it_from_the_last_link(arm: KnownArm) -> None:
    options = ModelOptions(payload=True)
    model = options.build(arm.robot)
    body = dict.fromkeys(model.parameter_names[-10:], 0.0) | {"mL": 5.0, "sxL": 3.0, "IzzL": 2.5}
    theta = truth(arm, model, **body)
    carried = Conditions(payload=True)
    signals = [signals_of(arm, model, theta), signals_of(arm, model, theta, carried, seed=1)]
    estimate = fit_smoothed(
        arm.robot, signals, EstimationOptions(model=options), payload=[False, True]
    ).estimate()
    assert np.mean(np.abs(deviations(estimate, theta)) < 2.5) >= 0.9
    found = dict(zip(estimate.base.names, deviations(estimate, theta), strict=True))
    assert any(name.endswith("L") for name in found)


def test_the_efficiency_of_a_gear_is_recovered(arm: KnownArm) -> None:
    """The gear transmits the load of links and spring, but not the friction."""
    robot = with_joints(arm.robot, efficiency=0.95, rotor=None)
    model = RobotModel.from_description(robot).with_nonlinear([0.7, 0.8, 0.75])
    theta = truth(arm, model)
    estimate = fit_smoothed(robot, [signals_of(arm, model, theta)]).estimate()
    assert estimate.options.nonlinear is not None
    np.testing.assert_allclose(estimate.options.nonlinear, [0.7, 0.8, 0.75], atol=0.02)
    assert np.mean(np.abs(deviations(estimate, theta)) < 2.5) >= 0.9


class TestBaseParameters:
    def test_a_coupling_changes_no_identifiable_link_parameter(self, arm: KnownArm) -> None:
        """C is invertible: actuator torques contain the same information as joint torques."""
        coupled = arm.robot.model_copy(update={"coupling": COUPLING})
        words = [
            base_parameters(
                RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
            ).expressions
            for robot in (arm.robot, coupled)
        ]
        assert words[0] == words[1]
        assert len(words[0]) == 15

    def test_the_first_harmonic_of_a_fourier_spring_merges_with_the_gravity_of_link_2(
        self, arm: KnownArm
    ) -> None:
        """As in the physical spring (3.37), the cosine merges with the parameter sy2 and the sine
        with sx2.
        """
        assert arm.robot.spring is not None
        spring = arm.robot.spring.model_copy(update={"form": "fourier"})
        robot = arm.robot.model_copy(update={"spring": spring})
        base = base_parameters(RobotModel.from_description(robot, rotors=False, friction=False))
        assert len(base) == 15 - 2 + 6
        assert "A1_spring - 9.81 sy2" in base.expressions
        assert "B1_spring - 9.81 sx2 - 4.7088 m3" in base.expressions  # 9.81 x 0.480

    def test_all_parameters_of_payload_and_friction_are_identifiable(self, arm: KnownArm) -> None:
        terms: tuple[FrictionTerm, ...]
        terms = (
            "asymmetric", "viscous", "cubic", "cube_root", "stribeck", "shear_thinning",
            "temperature",
        )  # fmt: skip
        model = ModelOptions(payload=True, friction_terms=terms).build(arm.robot)
        base = base_parameters(model)
        groups = model.parameter_groups
        for group in ("payload", "friction"):
            assert set(model.parameter_names[groups[group]]) <= set(base.expressions)

    def test_an_armature_merges_like_a_rotor(self, arm: KnownArm) -> None:
        robot = with_joints(arm.robot, rotor=None, armature=True)
        model = RobotModel.from_description(robot, friction=False, spring=False)
        base = base_parameters(model)
        assert "Izz1 + Iyy2 + 0.2304 m3 + Iyy3 + Ia1" in base.expressions
        assert "Izz2 + 0.2304 m3 + Ia2" in base.expressions
        assert "Ia3" in base.expressions
