"""A centre of gravity behind the flange is reported for controllers with Z out of the flange."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from config.load import load_cell
from identification.choices import LoadFormat
from identification.payload.body import PayloadBody
from identification.payload.file import write_payload
from identification.payload.verdict import PayloadCheck, PayloadResult
from rid_daq.app import run
from tests.builders.certified import estimate_of


def export_notes(
    folder: Path, z_m: float, to: LoadFormat, capsys: pytest.CaptureFixture[str]
) -> tuple[list[str], str]:
    """Return the notes and the text of load data with their centre of gravity at z_m."""
    estimate = estimate_of(load_cell("kr15"), ())
    centre = estimate.body.centre_m.copy()
    centre[2] = z_m
    body = PayloadBody(estimate.body.mass_kg, centre, estimate.body.inertia_kg_m2)
    passed = (PayloadCheck("rank", 10, "≥", 10),)
    payload = PayloadResult(replace(estimate, values=body.parameters), passed)
    write_payload(folder / "payload.json", payload)
    capsys.readouterr()
    words = ["payload", "export", str(folder / "payload.json"), "--to", to.value, "--json"]
    assert run([*words, "-o", str(folder / "load")]) == 0
    return json.loads(capsys.readouterr().out)["notes"], (folder / "load").read_text()


@pytest.mark.parametrize("to", [each for each in LoadFormat if each is not LoadFormat.URDF])
def test_a_centre_behind_the_flange_is_reported_with_its_distance(
    to: LoadFormat, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    notes, text = export_notes(tmp_path, -0.2, to, capsys)
    assert "200 mm behind the flange" in " ".join(notes)
    assert "200 mm behind the flange" in text
    (tmp_path / "load").unlink()
    assert export_notes(tmp_path, 0.2, to, capsys)[0] == []


def test_a_urdf_needs_no_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert export_notes(tmp_path, -0.2, LoadFormat.URDF, capsys)[0] == []
