"""`rid-daq axes` on simulated drives in lock-step: mistakes in wiring and files are named."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.runs.folder import RunFolder
from config.load import load_cell, read_named, to_yaml
from mock_hw.cell import SimulatedCell
from mock_hw.host.runtime_directory import runtime_directory
from mock_hw.simulation import CellSimulation
from rid_daq.app import run
from rid_daq.operations.cell.mock import MockRequest
from rid_daq.operations.cell.served_devices import serve_cell
from tests.builders.console_blocks import assert_shown
from tests.builders.screens import recorded_calls, require_fitting, screen_lines
from tests.builders.typist import Typist

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def served() -> Iterator[SimulatedCell]:
    """Serve the devices of the bundled cell on its bus."""
    loaded = load_cell("ir361")
    assert loaded.plant is not None
    simulation = CellSimulation(
        loaded.config, loaded.robot, loaded.plant, realtime=False, seed=1,
        directory=runtime_directory(),
    )  # fmt: skip
    with SimulatedCell(simulation) as simulated:
        yield simulated


def test_a_reversed_axis_is_found_within_two_degrees_and_the_other_axes_pass(
    served: SimulatedCell, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = read_named("ir361", "cells", None)[0].decode()
    cell = tmp_path / "cell.yaml"
    cell.write_text(text.replace("node_id: 1}", "node_id: 1, direction: -1}"))
    with recorded_calls() as calls:
        words = ["axes", str(cell), "--unattended", "--json", "--runs", str(tmp_path / "r")]
        assert run(words) == 1
    require_fitting(["axes", "cell.yaml"], calls)
    result = json.loads(capsys.readouterr().out)
    assert not result["passed"]
    assert [each["passed"] for each in result["axes"]] == [False, True, True]
    (line,) = result["axes"][0]["problems"]
    assert "axes, axis1: direction: 1 (is -1)" in line
    assert all(abs(each["motion"]["measured"]) < 2.3 for each in result["axes"])
    signed = json.loads(Path(result["signed"]).read_text())
    assert [each["joint"] for each in signed["axes"]] == ["axis2", "axis3"]


def test_a_wrong_gear_ratio_is_found_from_the_motion(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = read_named("ir361", "cells", None)[0].decode()
    robot = read_named("ir361", "robots", None)[0].decode()
    assert "gear_ratio: 121.0" in robot
    (tmp_path / "robot.yaml").write_text(robot.replace("gear_ratio: 121.0", "gear_ratio: 242.0"))
    cell = cell.replace("channel: ir361", "channel: wrong-gear")
    (tmp_path / "cell.yaml").write_text(cell.replace("robot: ir361", "robot: robot.yaml", 1))
    (tmp_path / "true.yaml").write_text(cell + "servo: {lacks: [6091h]}\n")
    true = str(tmp_path / "true.yaml")
    devices = MockRequest(cell=str(tmp_path / "cell.yaml"), lockstep=True, seed=1, devices=true)
    words = ["axes", str(tmp_path / "cell.yaml"), "--unattended", "--joint", "axis1", "--json"]
    with serve_cell(devices):
        assert run([*words, "--runs", str(tmp_path / "r")]) == 1
    (axis,) = json.loads(capsys.readouterr().out)["axes"]
    (line,) = axis["problems"]
    assert "joints, axis1: gear_ratio: " in line
    found = float(line.split("gear_ratio: ")[1].split()[0])
    assert found == pytest.approx(121.0, rel=0.1)


def test_a_reversed_direction_reported_by_the_user_is_named(
    served: SimulatedCell, tmp_path: Path
) -> None:
    (tmp_path / "cell.yaml").write_bytes(read_named("ir361", "cells", None)[0])
    words = ["axes", "cell.yaml", "--joint", "axis2", "--runs", tmp_path]
    with contextlib.chdir(tmp_path), Typist(*words) as person:
        person.wait_for_text("Hold SPACE")
        with person.hold_key(" "):
            person.wait_for_text("Simulated: axis2 has turned by")
        person.wait_for_text("How did axis2 move?")
        person.type("-\n")
        person.wait_for_text("By about how much")
        person.type("30mm\n")
        assert person.wait_for_end() == 1
        person.wait_for_text("Next: ")
    shown = "\n".join(screen_lines(person.shown))
    assert "axis2: direction: -1 (is 1)" in " ".join(shown.split())
    assert_shown("first-motion", "rid-daq axes cell.yaml --joint axis2", shown, same_numbers=False)


def test_record_needs_the_axis_test_or_notes_its_waiver_in_the_manifest(
    served: SimulatedCell, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = tmp_path / "cell.json"
    real = served.cell.model_dump(mode="json") | {"simulated": False, "plant": None, "plate": None}
    cell.write_text(json.dumps(real))
    joints = tuple(FourierJoint(joint=f"axis{i}", sine=(0.05,), cosine=(0.0,)) for i in (1, 2, 3))
    motion = FourierMotion(
        kind="fourier", robot="ir361", period_s=2.0, periods=1, ramp_s=0.8, joints=joints
    )
    (tmp_path / "motion.yaml").write_text(to_yaml(motion))
    words = ["record", str(cell), str(tmp_path / "motion.yaml"), "--i-have-cleared-the-cell"]
    words += ["--runs", str(tmp_path / "runs")]
    assert run(words) == 3
    assert "RID-AXIS-TEST-MISSING" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()
    assert run([*words, "--without-axis-test", "--json"]) == 0
    folder = RunFolder.open(Path(json.loads(capsys.readouterr().out)["folder"]))
    assert folder.manifest().facts["axis_test"] == "waived; missing: axis1, axis2, axis3"
