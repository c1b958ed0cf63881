"""Joint temperatures that are assumed before a motion: stated by the user, computed from a motion,
or computed after a rest.
"""

from __future__ import annotations

import numpy as np
import pytest

from compensation.loops.velocity_loop import VelocityLoop
from compensation.online.online import OnlineFeedforward
from compensation.operating_temperature import at_operating_temperature
from config.errors import ConfigError, EstimationError
from config.load import LoadedCell, load_cell
from dynamics.terms.conditions import Conditions
from identification.equations.warming import Warming
from identification.estimation.estimate import Estimate, predict
from tests.builders.known_model import known_estimate
from tests.builders.raised_codes import raises_code
from tests.builders.warm_model import FALL, by_temperature
from tests.builders.warming_arm import motion, recording

WAY = motion(20.0, 4)


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture(scope="module")
def measured(cell: LoadedCell) -> Estimate:
    return by_temperature(cell, measured=True)


@pytest.fixture(scope="module")
def followed(cell: LoadedCell) -> Estimate:
    """Model with computed warming instead of measured temperatures."""
    return by_temperature(cell, measured=False)


@pytest.mark.parametrize(
    ("temperatures", "celsius"), [("40", [40.0, 40.0, 40.0]), ("-5,61.5,20", [-5.0, 61.5, 20.0])]
)
def test_measured_temperatures_are_given_in_degrees_celsius(
    measured: Estimate, temperatures: str, celsius: list[float]
) -> None:
    found = at_operating_temperature(measured, temperatures, None)
    conditions = Conditions(temperature_k=np.array(celsius) + 273.15)
    np.testing.assert_allclose(
        predict(found.estimate, *WAY), predict(measured, *WAY, conditions), rtol=1e-9, atol=1e-7
    )
    assert found.notes == [
        f"Friction at {', '.join(f'{c:g} °C' for c in map(float, temperatures.split(',')))}."
    ]


def test_cold_is_the_friction_without_warming(cell: LoadedCell, followed: Estimate) -> None:
    found = at_operating_temperature(followed, "cold", None)
    np.testing.assert_allclose(
        predict(found.estimate, *WAY), predict(known_estimate(cell, {}), *WAY), rtol=1e-9, atol=1e-7
    )
    assert found.sentence == "Friction of axis1, axis2 after a long rest."


def test_warm_is_the_steady_state_of_the_repeated_motion(followed: Estimate) -> None:
    found = at_operating_temperature(followed, "warm", WAY[1])
    warming = followed.warming
    assert warming is not None
    # Compare with an hour (many time constants) of the same motion as a recording.
    signals = recording(20.0, (None, None, None), seed=4)
    assert np.array_equal(signals.velocity, WAY[1])
    settled = _after_an_hour(warming, followed)
    np.testing.assert_allclose(
        warming.steady_temperatures(followed.robot, WAY[1])[:2], settled[:2], rtol=0.002
    )
    axis1 = found.estimate.base.names.index("fc_axis1")
    cold = at_operating_temperature(followed, "cold", None).estimate.values[axis1]
    rise = warming.steady_temperatures(followed.robot, WAY[1])[0] - 298.15
    assert rise > 5.0
    assert found.estimate.values[axis1] == pytest.approx(cold * (1.0 - FALL * rise))
    assert f": {rise:.3g} W in axis1, " in found.sentence
    assert "axis3" not in found.sentence


def _after_an_hour(warming: Warming, estimate: Estimate) -> np.ndarray:
    """Return the mean temperatures (K) in the last repetition after an hour of the motion."""
    one = recording(20.0, (None, None, None), seed=4)
    turns = 30
    rows = len(one) * turns
    whole = type(one)(
        **{
            **{key: getattr(one, key) for key in ("joint_names", "sample_period_s", "cutoff_hz")},
            "time_s": one.sample_period_s * np.arange(rows, dtype=np.float64),
            **{
                key: np.tile(getattr(one, key), (turns, 1))
                for key in ("position", "velocity", "acceleration", "torque_nm")
            },
            "segment": np.zeros(rows, dtype=np.int64),
        }
    )
    followed = warming.with_temperatures(estimate.robot, whole).temperature_k
    assert followed is not None
    return np.asarray(followed[-len(one) :].mean(axis=0))


def test_on_line_compensation_needs_a_model_at_one_temperature(
    cell: LoadedCell, followed: Estimate
) -> None:
    loops = [
        VelocityLoop(joint, 500.0, 0.08, 0.0, 0.002, ("gain",), np.eye(1), 1.0, ())
        for joint in cell.robot.joint_names
    ]
    with raises_code(EstimationError, "RID-MODEL-TEMPERATURE"):
        OnlineFeedforward.from_model(cell.config, cell.robot, followed, loops)
    warm = at_operating_temperature(followed, "warm", WAY[1]).estimate
    OnlineFeedforward.from_model(cell.config, cell.robot, warm, loops)


def test_a_temperature_without_effect_is_refused(cell: LoadedCell) -> None:
    plain = known_estimate(cell, {})
    assert at_operating_temperature(plain, None, None).estimate is plain
    assert at_operating_temperature(plain, None, None).notes == []
    with raises_code(ConfigError, "RID-OPTION-NO-EFFECT", "--temperature", "40"):
        at_operating_temperature(plain, "40", None)


@pytest.mark.parametrize("temperatures", [None, "warm", "cold"])
def test_a_model_with_measured_temperatures_needs_them_in_degrees(
    measured: Estimate, temperatures: str | None
) -> None:
    with raises_code(ConfigError, "RID-MODEL-TEMPERATURE", "axis1", "axis2"):
        at_operating_temperature(measured, temperatures, WAY[1])


@pytest.mark.parametrize(
    ("temperatures", "code"),
    [
        *((each, "RID-OPTION-SYNTAX") for each in ("", "hot", "nan", "40;41;42", "1,2,")),
        ("40,41", "RID-OPTION-COUNT"),
        ("500", "RID-OPTION-RANGE"),
    ],
)
def test_an_invalid_temperature_is_refused(
    measured: Estimate, temperatures: str, code: str
) -> None:
    with raises_code(ConfigError, code, "-40", "200"):
        at_operating_temperature(measured, temperatures, WAY[1])


@pytest.mark.parametrize("temperatures", [None, "40"])
def test_degrees_are_refused_for_a_model_without_measured_temperatures(
    followed: Estimate, temperatures: str | None
) -> None:
    with raises_code(ConfigError, "RID-MODEL-TEMPERATURE", "--temperature"):
        at_operating_temperature(followed, temperatures, WAY[1])


def test_warm_is_refused_for_points_from_another_program(followed: Estimate) -> None:
    with raises_code(ConfigError, "RID-MODEL-TEMPERATURE"):
        at_operating_temperature(followed, "warm", None)
