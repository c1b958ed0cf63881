"""`mock CELL --as OTHER`: commands report differences between the files and the devices."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest

from config.errors import ConfigError
from config.load import load_cell
from mock_hw.host.runtime_directory import plate_path, runtime_directory
from rid_daq.app import run
from rid_daq.operations.cell.mock import MockRequest
from rid_daq.operations.cell.served_devices import serve_cell
from tests.builders.raised_codes import raises_code

Serve = Callable[[str], AbstractContextManager[None]]


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """Return the folder of a new cell for practice, with a separate bus."""
    assert run(["init", str(tmp_path / "mine")]) == 0
    cell = tmp_path / "mine" / "cell.yaml"
    replace_in_file(cell, "channel: my_cell", f"channel: {tmp_path.name[-40:]}")
    return tmp_path / "mine"


@pytest.fixture
def serve(files: Path) -> Serve:
    """Return a function that serves another cell's devices at the addresses of the new cell."""

    @contextmanager
    def serve_devices(devices: str) -> Iterator[None]:
        with serve_cell(MockRequest(cell=str(files / "cell.yaml"), lockstep=True, devices=devices)):
            yield

    return serve_devices


def replace_in_file(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert text.count(old) == 1
    file.write_text(text.replace(old, new), encoding="utf-8")


def red_lines(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, list[dict[str, Any]]]:
    """Check a cell; return the exit status and the red lines."""
    capsys.readouterr()
    code = run(["check", *words, "--seconds", "0.3", "--json"])
    lines = json.loads(capsys.readouterr().out)["lines"]
    return code, [line for line in lines if line["verdict"] == "red"]


@pytest.mark.slow
def test_a_file_that_differs_from_the_devices_is_red_until_corrected(
    files: Path, tmp_path: Path, serve: Serve, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["init", str(tmp_path / "true")]) == 0
    replace_in_file(tmp_path / "true" / "robot.yaml", "gear_ratio: 101.0", "gear_ratio: 81.0")
    cell = str(files / "cell.yaml")
    with serve(str(tmp_path / "true" / "cell.yaml")):
        code, lines = red_lines(capsys, cell)
        assert code != 0
        assert [line["what"] for line in lines] == ["6091h:00 gear ratio"]
        replace_in_file(files / "robot.yaml", "gear_ratio: 101.0", "gear_ratio: 81.0")
        assert red_lines(capsys, cell) == (0, [])


@pytest.mark.slow
def test_missing_drives_are_named_by_their_nodes(
    files: Path, tmp_path: Path, serve: Serve, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["init", str(tmp_path / "true")]) == 0
    replace_in_file(
        tmp_path / "true" / "cell.yaml", "joint: axis3, node_id: 3", "joint: axis3, node_id: 7"
    )
    with serve(str(tmp_path / "true" / "cell.yaml")):
        assert run(["check", str(files / "cell.yaml")]) != 0
    message = capsys.readouterr().err
    assert "RID-DRIVE-SILENT" in message
    assert "axis3" in message


def test_the_served_devices_are_those_of_the_other_cell(files: Path) -> None:
    request = MockRequest(cell=str(files / "cell.yaml"), lockstep=True, devices="ir361")
    with serve_cell(request) as served:
        mine, other = load_cell(str(files / "cell.yaml")).config, load_cell("ir361").config
        assert served.channel == str(runtime_directory() / f"{mine.can.channel}.sock")
        assert served.address == str(plate_path(mine.can.channel))
        assert served.cell.axes == other.axes
        assert served.cell.drive_safety == mine.drive_safety


@pytest.mark.long
def test_the_five_mistakes_of_the_exercise_are_reported_in_sequence(
    files: Path, serve: Serve, capsys: pytest.CaptureFixture[str]
) -> None:
    cell, robot, motion = (files / f"{name}.yaml" for name in ("cell", "robot", "motion"))
    runs = ["--runs", str(files / "runs"), "--json"]

    def document(*words: str) -> tuple[int, dict[str, Any]]:
        capsys.readouterr()
        code = run([*words, *runs])
        return code, json.loads(capsys.readouterr().out)

    with serve("exercise"):
        code, lines = red_lines(capsys, str(cell))
        assert [line["found"] for line in lines] == ["153:1", "121:1", "81:1"]
        replace_in_file(cell, "    node_id: 1\n", "    node_id: 2\n")
        replace_in_file(cell, "{joint: axis2, node_id: 2}", "{joint: axis2, node_id: 1}")
        replace_in_file(robot, "gear_ratio: 101.0", "gear_ratio: 81.0")
        assert red_lines(capsys, str(cell)) == (0, [])

        code, tested = document("axes", str(cell), "--unattended", "--joint", "axis2")
        assert code == 1
        assert "direction:" in str(tested["axes"][0]["problems"])
        replace_in_file(cell, "node_id: 1}", "node_id: 1, direction: -1}")

        replace_in_file(motion, "periods: 8 ", "periods: 3 ")
        assert document("record", str(cell), str(motion))[0] == 0
        code, identified = document("identify", "latest")
        assert code == 6
        sentences = [mistake["sentence"] for mistake in identified["estimate"]["mistakes"]]
        assert len(sentences) == 2
        assert "Gravity points along -y of the base" in sentences[0]
        assert "The zero position of axis1 is wrong: add 60" in sentences[1]

        replace_in_file(robot, "gravity_m_s2: [0.0, 0.0, 9.81]", "gravity_m_s2: [9.81, 0.0, 0.0]")
        replace_in_file(cell, "# position_zero_counts: 0 ", "position_zero_counts: 165205 ")
        assert document("record", str(cell), str(motion))[0] == 0
        code, identified = document("identify", "latest")
        assert code == 0
        assert identified["estimate"]["mistakes"] == []
        assert [axis["grade"] for axis in identified["estimate"]["axes"]] == ["good"] * 3


def test_devices_that_are_not_simulated_are_refused(files: Path, tmp_path: Path) -> None:
    assert run(["init", str(tmp_path / "real")]) == 0
    cell = tmp_path / "real" / "cell.yaml"
    replace_in_file(cell, "simulated: true\n", "")
    request = MockRequest(cell=str(files / "cell.yaml"), devices=str(cell))
    with raises_code(ConfigError, "RID-CELL-NOT-SIMULATED"), serve_cell(request):
        pass
