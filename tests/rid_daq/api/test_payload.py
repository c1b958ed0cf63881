"""A payload from Python: identified from arrays, checked, saved and exported for a controller."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from config.arrays import FloatArray
from config.errors import ConfigError, EstimationError
from dynamics.geometry.kinematics import flange_pose
from dynamics.model.robot_model import RobotModel, torque
from dynamics.terms.conditions import Conditions
from identification.payload.body import PayloadBody, parameters_to_parent
from rid_daq.api import Payload, Recording, identify_payload
from tests.builders.raised_codes import raises_code
from tests.rid_daq.api.conftest import Arm

MASS_KG, CENTRE_M = 20.0, np.array([0.02, -0.01, 0.1])


def with_payload(arm: Arm, seed: int, mass_kg: float) -> Recording:
    """Return a recording of the arm with a body on its flange; noise of 1 N m."""
    robot = arm.robot.description
    model = RobotModel.from_description(robot, payload=True)
    body = PayloadBody(mass_kg, CENTRE_M, np.diag([0.2, 0.2, 0.1]))
    on_link = parameters_to_parent(flange_pose(robot)) @ body.parameters
    time_s, q, v, a = arm.motion(seed, 30.0)
    theta: FloatArray = np.concatenate([arm.theta, on_link])
    measured = torque(model, q, v, a, theta, Conditions(payload=True))
    measured += np.random.default_rng(seed).standard_normal(q.shape)
    return Recording.from_arrays(
        time_s, q, measured, torques="motor_torque", robot=arm.robot, name=f"loaded {seed}"
    )


@pytest.fixture(scope="module")
def payload(arm: Arm) -> Payload:
    return identify_payload(with_payload(arm, 21, MASS_KG), arm.recording(22, 30.0))


def test_the_intervals_contain_mass_and_centre(payload: Payload) -> None:
    true = (MASS_KG, *CENTRE_M)
    for parameter, value in zip(payload.parameters, true, strict=False):
        low, high = parameter.interval
        assert not parameter.is_shown or low - parameter.sigma <= value <= high + parameter.sigma
    assert payload.mass_kg == pytest.approx(MASS_KG, rel=0.05)
    assert payload.inertia_kg_m2.shape == (3, 3)


def test_a_payload_is_saved_and_loaded(payload: Payload, tmp_path: Path) -> None:
    payload.save(tmp_path / "payload.json")
    again = Payload.load(tmp_path / "payload.json")
    assert again.mass_kg == payload.mass_kg
    assert again.passed == payload.passed
    with raises_code(ConfigError, "RID-OUTPUT-EXISTS"):
        payload.save(tmp_path / "payload.json")


def test_only_a_payload_that_passed_is_exported_for_a_controller(payload: Payload) -> None:
    with raises_code(ConfigError, "RID-REQUEST-INVALID", "kuka"):
        payload.load_data("none")
    if payload.passed:
        assert "set_target_payload" in payload.load_data("ur")
        return
    with pytest.raises(EstimationError):
        payload.load_data("ur")


def test_a_known_mass_is_not_estimated(arm: Arm) -> None:
    found = identify_payload(
        with_payload(arm, 21, MASS_KG), arm.recording(22, 30.0), known={"m": (MASS_KG, 0.0)}
    )
    assert found.mass_kg == pytest.approx(MASS_KG)
    with raises_code(ConfigError, "RID-OPTION-NAME"):
        identify_payload(arm.recording(1), arm.recording(2), known={"weight": (1.0, 0.0)})
