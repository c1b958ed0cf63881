"""Exported tables contain every bit of the estimate, and other programs can read them."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest

from acquisition.processing.periods import average_periods
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.export.model import ExportModel
from identification.export.table import csv_table, json_table


@pytest.fixture(scope="module")
def estimate(arm, measure) -> Estimate:
    averages = [average_periods(measure(noise_nm=0.5))]
    return fit_periodic(arm.robot, averages).estimate(cell_name="ir361", run_ids=("a, b",))


@pytest.fixture(scope="module")
def truth(arm) -> ExportModel:
    return ExportModel(arm.robot, arm.model, arm.standard)


def test_the_csv_is_read_back_equal(estimate: Estimate, truth: ExportModel) -> None:
    text = csv_table(estimate, truth)
    rows = list(csv.DictReader(io.StringIO(text, newline="")))
    identified = [row for row in rows if row["kind"] == "identified"]
    assert [row["name"] for row in identified] == list(estimate.base.names)
    assert [row["words"] for row in identified] == list(estimate.base.expressions)
    assert [row["unit"] for row in identified] == list(estimate.base.units)
    for key, values in (("value", estimate.values), ("sigma", estimate.sigma)):
        np.testing.assert_array_equal([float(row[key]) for row in identified], values)
    standard = [row for row in rows if row["kind"] == "consistent"]
    np.testing.assert_array_equal([float(row["value"]) for row in standard], truth.parameters)
    assert standard[0]["sigma"] == ""


def test_links_are_about_their_centres_of_gravity(truth: ExportModel, estimate: Estimate) -> None:
    rows = {row["name"]: row for row in json.loads(json_table(estimate, truth))["parameters"]}
    # plants/ir361.yaml, the first link; it carries no rotor
    assert rows["link1.mass"]["value"] == pytest.approx(45.0)
    centre = [rows[f"link1.centre_{axis}"]["value"] for axis in "xyz"]
    assert centre == pytest.approx([0.020, 0.030, -0.200])
    inertia = [rows[f"link1.I{pair}"]["value"] for pair in ("xx", "yy", "zz", "xy", "xz", "yz")]
    assert inertia == pytest.approx([1.20, 1.10, 0.70, 0.02, -0.03, 0.04])
    assert rows["link1.centre_x"]["unit"] == "m"


def test_the_json_file_states_the_origin_of_the_values(estimate: Estimate) -> None:
    document = json.loads(json_table(estimate))
    assert document["robot"] == "ir361"
    assert document["runs"] == ["a, b"]
    assert document["unseen"] == list(estimate.base.unseen)
    kinds = {row["kind"] for row in document["parameters"]}
    assert kinds == {"identified"}
    values = [row["value"] for row in document["parameters"]]
    np.testing.assert_array_equal(values, estimate.values)


def test_no_text_is_a_formula_for_a_spreadsheet(estimate: Estimate) -> None:
    words = ("-m2 + m3", "=cmd()", *estimate.base.expressions[2:])
    hostile = replace(estimate, base=replace(estimate.base, expressions=words))
    for row in csv.DictReader(io.StringIO(csv_table(hostile))):
        for name in ("kind", "name", "words", "unit"):
            assert not row[name].startswith(("=", "+", "-", "@"))
