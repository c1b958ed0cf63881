"""A relative and an absolute limit of one quantity are alternatives: meeting one is enough."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.errors import ConfigError
from config.load import load_cell, load_robot
from identification.choices import PayloadLimits
from identification.payload.body import PayloadBody
from identification.payload.estimate import PayloadEstimate
from identification.payload.file import read_payload, write_payload
from identification.payload.rating import NegligibleErrors
from identification.payload.verdict import (
    BAD_FIT,
    PayloadCheck,
    PayloadResult,
    Reached,
    check_payload,
)
from tests.builders.certified import estimate_of
from tests.builders.raised_codes import raises_code

SIZES = st.floats(0.0, 1e3) | st.just(0.0)


def camera() -> PayloadEstimate:
    """Return the estimate of a camera: 0.1 kg ± 24 g, moments of inertia ± 0.004 kg m² (2σ)."""
    body = PayloadBody.of_reported(np.array([0.1, 0.0, 0.0, 0.02, 1e-4, 1e-4, 1e-4, 0.0, 0.0, 0.0]))
    estimate = estimate_of(load_cell("kr15"), ())
    sigma = np.array([0.012, *[4e-4] * 3, *[0.002] * 6])
    return replace(estimate, values=body.parameters, covariance=np.diag(sigma**2))


def line(checks: tuple[PayloadCheck, ...], start: str) -> PayloadCheck:
    (found,) = (each for each in checks if each.text.startswith(start))
    return found


def test_a_light_tool_fails_in_percent_and_passes_in_kilograms() -> None:
    light = camera()
    by_percent = check_payload(light, PayloadLimits(centre_mm=200.0))
    assert not line(by_percent, "interval of the mass").passed
    assert not line(by_percent, "interval of the inertia").passed
    limits = PayloadLimits(centre_mm=200.0, mass_kg=0.03, inertia_kg_m2=0.01)
    checks = check_payload(light, limits)
    mass, inertia = line(checks, "interval of the mass"), line(checks, "interval of the inertia")
    assert mass.value == pytest.approx(0.024)
    assert (mass.limit, mass.unit) == (0.03, "kg")
    assert (inertia.limit, inertia.unit) == (0.01, "kg m²")
    assert PayloadResult(light, checks).passed
    stricter = replace(limits, mass_kg=0.02)
    assert not line(check_payload(light, stricter), "interval of the mass").passed


def test_a_missed_absolute_limit_does_not_affect_a_met_relative_one() -> None:
    heavy = estimate_of(load_cell("kr15"), ())  # 9.6 kg, 2σ of 10 g
    mass = line(check_payload(heavy, PayloadLimits(mass_kg=0.001)), "interval of the mass")
    assert mass.passed
    assert mass.unit == "%"
    assert "0.01 kg, limit 0.001 kg" in mass.text


def test_a_residual_limit_in_newton_metres_is_an_alternative_limit_of_the_fit() -> None:
    poor = replace(estimate_of(load_cell("kr15"), ()), residual_nm=np.full(6, 30.0))
    for limit_nm, fits in ((None, False), (29.0, False), (31.0, True)):
        checks = check_payload(poor, PayloadLimits(residual_nm=limit_nm))
        failed = [line.advice for line in checks if not line.passed]
        assert (BAD_FIT not in failed) is fits


@pytest.mark.parametrize(
    ("robot", "mass_kg", "inertia_kg_m2", "residual_nm"),
    [("ur10e", 0.0625, 0.014, 0.28), ("kr15", None, 0.0275, 1.1)],
)
def test_negligible_errors_follow_from_the_limits_of_the_weakest_joint(
    robot: str, mass_kg: float | None, inertia_kg_m2: float, residual_nm: float
) -> None:
    found = NegligibleErrors.of(load_robot(robot))
    assert found.mass_kg == (None if mass_kg is None else pytest.approx(mass_kg))
    assert found.inertia_kg_m2 == pytest.approx(inertia_kg_m2)
    assert found.residual_nm == pytest.approx(residual_nm)


def test_the_met_limit_is_stored_in_the_payload_file(tmp_path: Path) -> None:
    light, path = camera(), tmp_path / "payload.json"
    limits = PayloadLimits(centre_mm=200.0, mass_kg=0.03, inertia_kg_m2=0.01)
    write_payload(path, PayloadResult(light, check_payload(light, limits)))
    again = read_payload(path)
    assert again.passed
    assert line(again.checks, "interval of the mass").unit == "kg"


@pytest.mark.parametrize("name", ["mass_kg", "inertia_kg_m2", "residual_nm"])
@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf"), 1e6])
def test_an_impossible_absolute_limit_is_refused(name: str, value: float) -> None:
    with raises_code(ConfigError, "RID-OPTION-RANGE", name):
        PayloadLimits(**{name: value})


@given(percent=SIZES, percent_limit=SIZES, size=SIZES, limit=SIZES)
def test_a_check_passes_if_and_only_if_one_of_its_limits_is_met(
    percent: float, percent_limit: float, size: float, limit: float
) -> None:
    relative = Reached("mass", percent, percent_limit, "%")
    check = relative.or_absolute("mass", size, limit, "kg")
    assert check.passed is (percent <= percent_limit or size <= limit)
    alone = relative.or_absolute("mass", size, None, "kg")
    assert (alone.text, alone.value, alone.unit) == ("mass", percent, "%")
    assert alone.passed is (percent <= percent_limit)
