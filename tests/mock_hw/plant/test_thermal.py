"""Motor warming, a coupled wrist and payloads on the flange in the simulated plant."""

from __future__ import annotations

import numpy as np
import pytest

from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from config.simulation.plant import PlantConfig
from dynamics.model.robot_model import RobotModel
from dynamics.model.robot_model import torque as model_torque
from dynamics.terms.conditions import Conditions
from mock_hw.plant.plant import Plant
from mock_hw.plant.thermal import MotorTemperatures
from tests.builders.raised_codes import raises_code

ON = np.ones(6, dtype=bool)


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("kr15")


@pytest.fixture
def truth(loaded: LoadedCell) -> PlantConfig:
    assert loaded.plant is not None
    return loaded.plant


def robot_at_rest(loaded: LoadedCell, truth: PlantConfig) -> Plant:
    """Return a robot at rest, held by its drives, without Coulomb friction."""
    free = tuple(axis.model_copy(update={"coulomb_nm": 0.0}) for axis in truth.axes)
    plant = Plant(loaded.robot, truth.without_unmodelled().model_copy(update={"axes": free}))
    for _ in range(200):
        plant.advance(0.012, np.zeros(6), np.zeros(6), ON, ~ON)
    return plant


def test_a_motor_warms_up_to_the_temperature_of_its_losses_with_its_time_constant(
    loaded: LoadedCell, truth: PlantConfig
) -> None:
    heat = MotorTemperatures(loaded.robot, truth)
    assert truth.unmodelled is not None
    thermal = truth.unmodelled.axes[0].thermal
    assert thermal is not None
    rated = truth.axes[0].rated_motor_torque_nm * loaded.robot.joints[0].gear_ratio
    torque = np.array([rated, 0.0, 0.0, 0.0, 0.0, 0.0])
    for _ in range(600):
        heat.advance(0.1, torque, np.zeros(6))
    rise = thermal.loss_at_rated_w * thermal.rise_k_per_w
    expected = thermal.ambient_k + rise * (1.0 - np.exp(-60.0 / thermal.time_constant_s))
    assert heat.temperature_k[0] == pytest.approx(expected, rel=1e-9)
    np.testing.assert_array_equal(heat.temperature_k[1:], 298.15)


def test_friction_and_torque_constant_change_with_temperature(
    loaded: LoadedCell, truth: PlantConfig
) -> None:
    heat = MotorTemperatures(loaded.robot, truth)
    np.testing.assert_array_equal(heat.friction_factor, 1.0)
    heat.temperature_k = heat.temperature_k + 30.0
    np.testing.assert_allclose(heat.friction_factor, 1.0 - 30.0 * 0.005)
    np.testing.assert_allclose(heat.torque_constant_factor, 1.0 - 30.0 * 0.00103)
    heat.temperature_k = heat.temperature_k + 3000.0
    np.testing.assert_array_equal(heat.friction_factor, 0.2)


def test_a_warm_motor_reports_a_higher_torque_than_it_has(
    loaded: LoadedCell, truth: PlantConfig
) -> None:
    """Warming reduces friction, but not gravity; at rest only the torque constant has an effect."""
    assert truth.unmodelled is not None
    reported = []
    for initial_k in (298.15, 338.15):
        extras = tuple(
            extra.model_copy(
                update={
                    "stribeck_nm": 0.0,
                    "cogging_nm": 0.0,
                    "load_friction": 0.0,
                    "thermal": extra.thermal.model_copy(
                        update={"initial_k": initial_k, "ambient_k": initial_k}
                    ),
                }
            )
            for extra in truth.unmodelled.axes
            if extra.thermal is not None
        )
        axes = tuple(
            axis.model_copy(update={"coulomb_nm": 0.0, "torque_noise_nm": 0.0})
            for axis in truth.axes
        )
        plant = Plant(
            loaded.robot,
            truth.model_copy(
                update={
                    "axes": axes,
                    "unmodelled": truth.unmodelled.model_copy(update={"axes": extras}),
                }
            ),
        )
        for _ in range(200):
            plant.advance(0.012, np.zeros(6), np.zeros(6), ON, ~ON)
        expected = 1.0 / (1.0 - 0.00103 * (plant.temperature_k - 298.15))
        np.testing.assert_allclose(plant.measured_torque() / plant.torque, expected, rtol=1e-4)
        reported.append(expected.mean())
    assert reported[1] - reported[0] == pytest.approx(0.043, abs=0.003)


def test_without_unmodelled_effects_no_motor_warms_up(
    loaded: LoadedCell, truth: PlantConfig
) -> None:
    plant = Plant(loaded.robot, truth.without_unmodelled())
    plant.advance(1.0, np.full(6, 0.3), np.full(6, 0.3), ON, ~ON)
    np.testing.assert_array_equal(plant.temperature_k, 298.15)


def test_a_payload_adds_its_weight_to_the_motors_that_carry_it(
    loaded: LoadedCell, truth: PlantConfig
) -> None:
    """At rest, the payload adds the model's payload term, which includes the coupling matrix."""
    plant = robot_at_rest(loaded, truth)
    alone = plant.torque
    plant.attach("large")
    for _ in range(300):
        plant.advance(0.012, np.zeros(6), np.zeros(6), ON, ~ON)
    body = truth.payloads["large"]
    model = RobotModel.from_description(loaded.robot, rotors=False, friction=False, payload=True)
    theta = np.zeros(len(model.parameter_names))
    theta[model.parameter_names.index("mL")] = body.mass_kg
    for axis, centre in zip("xyz", body.centre_m, strict=True):
        theta[model.parameter_names.index(f"s{axis}L")] = body.mass_kg * centre
    still = np.zeros((1, 6))
    expected = model_torque(
        model, plant.position[np.newaxis], still, still, theta, Conditions(payload=True)
    )[0]
    assert np.abs(expected).max() > 100.0
    np.testing.assert_allclose(plant.torque - alone, expected, atol=0.02 * np.abs(expected).max())
    plant.attach(None)
    assert plant.attached is None


def test_joints_follow_the_coupling_matrix_of_the_wrists_motors(
    loaded: LoadedCell, truth: PlantConfig
) -> None:
    plant = Plant(loaded.robot, truth.without_unmodelled())
    counts = plant.position_counts()
    before = plant.position
    speed = np.array([0.0, 0.0, 0.0, 0.5, 0.0, 0.0])
    for _ in range(100):
        plant.advance(0.012, speed, speed, ON, ~ON)
    turned = plant.position - before
    assert turned[3] == pytest.approx(0.6, abs=0.02)
    assert turned[4] / turned[3] == pytest.approx(0.0125, abs=2e-3)
    assert turned[5] / turned[3] == pytest.approx(-0.0100, abs=2e-3)
    moved = plant.position_counts() - counts
    assert abs(moved[4]) < 0.002 * abs(moved[3])


def test_the_reference_payloads_are_those_of_the_thesis(truth: PlantConfig) -> None:
    assert {name: body.mass_kg for name, body in truth.payloads.items()} == {
        "small": 5.8444,
        "medium": 9.579,
        "large": 13.555,
    }
    with raises_code(ConfigError, "RID-PLANT-UNFIT", "'huge'", "small", "large"):
        truth.with_payload("huge")
