"""Exported files of warming joints contain all data to compute their temperature elsewhere."""

from __future__ import annotations

import csv
import importlib.util
import io
import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from config.arrays import FloatArray
from config.load import LoadedCell, load_cell
from dynamics.terms.conditions import Conditions
from identification.consistency.closest_robot import find_closest
from identification.estimation.estimate import Estimate, predict
from identification.export.description import pinocchio_model, sdf, urdf
from identification.export.function import c_function, python_function
from identification.export.model import ExportModel
from identification.export.table import csv_table, json_table
from tests.builders.known_model import known_estimate
from tests.builders.warm_model import by_temperature
from tests.builders.warming_arm import recording

NUMBER = r"(-?[\d.]+(?:e-?\d+)?)"
LINE = re.compile(
    rf"axis(\d): T = {NUMBER} s, f_C = {NUMBER} N m, f_v = {NUMBER} N m s/rad, T0 = {NUMBER} K"
)


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture(scope="module")
def warming(cell: LoadedCell) -> Estimate:
    return by_temperature(cell, measured=False)


def temperature_by_head(text: str, time_s: FloatArray, v: FloatArray) -> FloatArray:
    """Return `temperature_k` computed from a motion as the head of a file describes."""
    out = np.zeros_like(v)
    for number, *values in LINE.findall(text):
        j = int(number) - 1
        constant_s, coulomb, viscous, cold_k = map(float, values)
        x = np.zeros(len(v))
        for i, step_s in enumerate(np.diff(time_s)):
            speed = abs(v[i, j])
            power = (coulomb + viscous * speed) * speed
            x[i + 1] = power + np.exp(-step_s / constant_s) * (x[i] - power)
        out[:, j] = cold_k + x
    return out


def test_the_function_with_temperatures_from_its_head_gives_the_models_torques(
    warming: Estimate, tmp_path: Path
) -> None:
    text = python_function(ExportModel.from_estimate(warming))
    (tmp_path / "arm.py").write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("arm", tmp_path / "arm.py")
    assert spec is not None
    assert spec.loader is not None
    arm = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(arm)
    signals = recording(20.0, (None, None, None), seed=4)
    motion = signals.position, signals.velocity, signals.acceleration
    temperature_k = temperature_by_head(text, signals.time_s, signals.velocity)
    assert temperature_k[-1, 0] > 300.0
    assert warming.warming is not None
    warm = warming.warming.with_temperatures(warming.robot, signals).temperature_k
    np.testing.assert_allclose(
        arm.inverse_dynamics(*motion, temperature_k),
        predict(warming, *motion, Conditions(temperature_k=warm)),
        rtol=1e-9,
        atol=1e-7,
    )


def test_the_head_says_that_temperatures_are_computed_and_not_measured(
    warming: Estimate,
) -> None:
    for write in (python_function, c_function):
        text = " ".join(write(ExportModel.from_closest_robot(find_closest(warming))).split())
        assert "temperature_k is not a measured temperature" in text
        assert "T x' = P - x, P = (f_C + f_v |v|) |v|, temperature_k = T0 + x" in text
        assert [found[0] for found in LINE.findall(text)] == ["1", "2"]


def test_the_head_names_the_sensor_of_measured_temperatures(cell: LoadedCell) -> None:
    text = python_function(ExportModel.from_estimate(by_temperature(cell, measured=True)))
    assert "temperature_k: measured temperatures of the joints' drives in K." in text
    assert "thermometer" not in text
    assert "temperature_k" not in python_function(
        ExportModel.from_estimate(known_estimate(cell, {}))
    )


def test_tables_contain_the_data_for_computed_temperatures(warming: Estimate) -> None:
    rows = list(csv.DictReader(io.StringIO(csv_table(warming), newline="")))
    found = {row["name"]: row for row in rows if row["kind"] == "warming"}
    assert warming.warming is not None
    assert list(found) == [
        f"{name}_axis{j}" for j in (1, 2) for name in ("T_heat", "fc_heat", "fv_heat", "T0_heat")
    ]
    assert float(found["T_heat_axis1"]["value"]) == 60.0
    assert found["T_heat_axis1"]["unit"] == "s"
    assert float(found["T_heat_axis1"]["sigma"]) == 5.0
    assert "T x' = P - x" in found["T_heat_axis1"]["words"]
    assert "(fc_heat + fv_heat |v|) |v|" in found["T_heat_axis1"]["words"]
    assert float(found["fc_heat_axis2"]["value"]) == warming.warming.coulomb_nm[1]
    assert found["fc_heat_axis2"]["unit"] == "N m"
    assert float(found["fv_heat_axis2"]["value"]) == warming.warming.viscous_nm_s[1]
    assert float(found["T0_heat_axis2"]["value"]) == 298.15
    document = json.loads(json_table(warming))["parameters"]
    assert {row["name"] for row in document if row["kind"] == "warming"} == set(found)


@pytest.mark.parametrize("write", [urdf, sdf, pinocchio_model])
def test_descriptions_state_that_their_friction_is_for_a_cold_robot(
    write: Callable[[ExportModel], str], warming: Estimate, cell: LoadedCell
) -> None:
    text = write(ExportModel.from_closest_robot(find_closest(warming)))
    assert (
        "the change of the friction of axis1 as it warms up (time constant 60 s): the file contains"
        " the friction of a cold robot" in text
    )
    measured = find_closest(by_temperature(cell, measured=True))
    text = write(ExportModel.from_closest_robot(measured))
    assert (
        "the change of the friction of axis1 with its drive's temperature: the file has the"
        " friction at 298.15 K" in text
    )
    assert "(temperature): the file has a straight line" not in text
