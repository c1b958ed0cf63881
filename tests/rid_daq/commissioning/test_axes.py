"""`rid-daq axes` on simulated drives, in lock-step: mistakes of wiring and files are named."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from config.load import load_cell, read_named
from mock_hw.cell import SimulatedCell
from mock_hw.host.runtime_directory import runtime_directory
from mock_hw.simulation import CellSimulation
from rid_daq.app import run
from tests.builders.typist import Typist

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def served() -> Iterator[SimulatedCell]:
    """The devices of the bundled cell, on its own bus."""
    loaded = load_cell("ir361")
    assert loaded.plant is not None
    simulation = CellSimulation(
        loaded.config, loaded.robot, loaded.plant, realtime=False, seed=1,
        directory=runtime_directory(),
    )  # fmt: skip
    with SimulatedCell(simulation) as simulated:
        yield simulated


def test_a_reversed_axis_is_found_within_two_degrees_and_the_others_are_signed(
    served: SimulatedCell, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = read_named("ir361", "cells", None)[0].decode()
    cell = tmp_path / "cell.yaml"
    cell.write_text(text.replace("node_id: 1}", "node_id: 1, direction: -1}"))
    assert run(["axes", str(cell), "--unattended", "--json", "--runs", str(tmp_path / "r")]) == 1
    told = json.loads(capsys.readouterr().out)
    assert not told["passed"]
    assert [each["passed"] for each in told["axes"]] == [False, True, True]
    (line,) = told["axes"][0]["problems"]
    assert "axes, axis1: direction: 1 (is -1)" in line
    assert all(abs(each["motion"]["measured"]) < 2.3 for each in told["axes"])
    signed = json.loads((tmp_path / "cell.axes.json").read_text())
    assert [each["joint"] for each in signed["axes"]] == ["axis2", "axis3"]


def test_a_person_holds_the_key_and_says_what_was_seen(
    served: SimulatedCell, tmp_path: Path
) -> None:
    words = ["axes", "ir361", "--joint", "axis2", "--runs", tmp_path]
    with Typist(*words) as person:
        person.sees("Hold SPACE")
        with person.holding(" "):
            person.sees("Simulated: axis2 has moved by")
        person.sees("Did axis2 move as was said")
        person.type("-\n")
        person.sees("By about how much")
        person.type("2\n")
        assert person.ends() == 1
        assert "axis2: direction: -1 (is 1)" in " ".join(person.shown.split())
