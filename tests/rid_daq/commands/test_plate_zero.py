"""`rid-daq plate zero` on a simulated cell whose force plate has offsets and drift."""

from __future__ import annotations

import json
import os
import signal
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.journal.cycles import read_journal
from acquisition.runs.catalogue import find_run
from acquisition.runs.manifest import RECORDING
from acquisition.session.plate_preparation import discharge_plate
from acquisition.task.states import TaskProgress
from config.load import load_cell
from mock_hw.amplifier.sensors import PlateSensors
from mock_hw.cell import SimulatedCell
from mock_hw.host.runtime_directory import runtime_directory
from mock_hw.plant.rigid_bodies import BaseWrench
from mock_hw.simulation import CellSimulation
from rid_daq.app import run
from rid_daq.operations.cell import zeroed_plate
from tests.builders.console_blocks import assert_shown
from tests.builders.screens import recorded_calls, require_fitting

pytestmark = pytest.mark.slow

JUMP_PC = (300.0, -150.0, 90.0, 0.0, -180.0, 120.0, 60.0, -30.0)
DRIFT_PC_S = (-1.5, 0.9, -0.3, 0.0, 0.5, -0.4, 0.3, 0.0)
# The plate is zeroed once for many tests, so these tests run in one pytest worker.
QUICK = ["--read", "3", "--settle", "1"]


def bundled_text(kind: str, name: str) -> str:
    return files("config").joinpath(f"bundled/{kind}/{name}.yaml").read_text()


def make_cell(folder: Path) -> Path:
    """Write a cell with a separate bus name and a plate with larger offset jumps and drift."""
    plant = bundled_text("plants", "ir361").splitlines(keepends=True)
    for i, line in enumerate(plant):
        if line.startswith("  zero_jump_pc:"):
            plant[i] = f"  zero_jump_pc: {list(JUMP_PC)}\n"
        elif line.startswith("  drift_pc_s:"):
            plant[i] = f"  drift_pc_s: {list(DRIFT_PC_S)}\n"
    (folder / "plant.yaml").write_text("".join(plant))
    text = bundled_text("cells", "ir361").replace("plant: ir361", "plant: plant.yaml")
    text = text.replace("channel: ir361", f"channel: z{zlib.crc32(str(folder).encode()):08x}")
    cell = folder / "cell.yaml"
    cell.write_text(text)
    return cell


@contextmanager
def serve_lockstep_cell(
    cell: Path, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> Iterator[SimulatedCell]:
    """Serve a cell like `rid-daq mock --lockstep`; its amplifier keeps running between commands."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    loaded = load_cell(str(cell))
    assert loaded.plant is not None
    with SimulatedCell(
        CellSimulation(
            loaded.config,
            loaded.robot,
            loaded.plant,
            realtime=False,
            seed=1,
            directory=runtime_directory(),
            amplifier_profile=loaded.amplifier_profile,
        )
    ) as simulated:
        yield simulated


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_cell(tmp_path_factory.mktemp("zero"))


@pytest.fixture(scope="module")
def running_devices(
    cell: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[SimulatedCell]:
    with (
        pytest.MonkeyPatch.context() as patch,
        serve_lockstep_cell(cell, patch, tmp_path_factory.mktemp("served")) as simulated,
    ):
        yield simulated


@pytest.fixture(scope="module")
def discharged_at() -> list[Any]:
    """True position of the braked arm at the time when the amplifier was discharged [rad]."""
    return []


@pytest.fixture(scope="module")
def zero_document(
    cell: Path, running_devices: SimulatedCell, discharged_at: list[Any]
) -> dict[str, Any]:
    """Zero the plate with `--write`, and return the JSON document of the command."""
    runs = ["--runs", str(cell.parent / "runs")]

    def discharge(*plate: Any) -> Any:
        discharged_at.append(np.array(running_devices.axes().position))
        return discharge_plate(*plate)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(zeroed_plate, "discharge_plate", discharge)
        messages: list[str] = []
        patch.setattr("click.echo", lambda text="", **_: messages.append(str(text)))
        words = ["plate", "zero", str(cell), "--write", "--json", *QUICK]
        with recorded_calls() as calls:
            assert run([*words, *runs]) == 0
    require_fitting(words, calls)
    document = json.loads("\n".join(messages))
    assert isinstance(document, dict)
    return document


def channel_values(document: dict[str, Any], key: str) -> np.ndarray[Any, Any]:
    return np.array([each[key] for each in document["plate_zero"]["channels"]])


def test_the_drift_is_estimated_within_its_uncertainty(
    zero_document: dict[str, Any], cell: Path
) -> None:
    plant = load_cell(str(cell)).plant
    assert plant is not None
    assert plant.plate is not None
    truth = np.array(DRIFT_PC_S) / np.array(plant.plate.sensitivity_pc_n)
    off = channel_values(zero_document, "drift_n_s") - truth
    assert (np.abs(off) <= 3.0 * channel_values(zero_document, "drift_std_n_s")).all()


def test_the_offset_is_estimated_within_its_uncertainty(
    zero_document: dict[str, Any], cell: Path, discharged_at: list[Any]
) -> None:
    """Compare the offset with the plant's jump, its drift, and the mean load of both poses.

    The drift began at the command "operate", whose time is not in the recording. The test
    estimates this time from all channels; each channel must agree with it.
    """
    loaded = load_cell(str(cell))
    plate, plant = loaded.config.plate, loaded.plant
    assert plate is not None
    assert plant is not None
    assert plant.plate is not None
    rows = read_journal(find_run(cell.parent / "runs", "plate zero").file(RECORDING)).rows
    base, sensors = BaseWrench(loaded.robot, plant), PlateSensors(plate, plant.plate)
    per_newton = np.array(plant.plate.sensitivity_pc_n)

    def load_n(position: Any) -> Any:
        wrench = base(np.array([position, np.zeros(3), np.zeros(3)]))
        return sensors.charges_pc(wrench) / per_newton

    at = [np.abs(rows["position"][:, 0] - angle) < 1e-3 for angle in (-np.pi / 2, np.pi / 2)]
    first, second = (load_n(np.median(rows["position"][k], axis=0)) for k in at)
    begun = load_n(discharged_at[0])
    known = np.array(JUMP_PC) / per_newton + 0.5 * (first + second) - begun
    drift = np.array(DRIFT_PC_S) / per_newton
    off, sigma = (channel_values(zero_document, f"offset_{key}") for key in ("n", "std_n"))
    off = off - known
    since_s = float(np.sum(drift * off / sigma**2) / np.sum((drift / sigma) ** 2))
    assert 15.0 < since_s < 60.0
    assert (np.abs(off - since_s * drift) <= 3.0 * sigma).all()


def test_the_gravity_moment_is_half_the_difference_between_the_poses(
    zero_document: dict[str, Any], cell: Path
) -> None:
    loaded = load_cell(str(cell))
    assert loaded.plant is not None
    base = BaseWrench(loaded.robot, loaded.plant)
    first, second = (
        base(np.array([zero_document["plate_zero"][pose], np.zeros(3), np.zeros(3)]))
        for pose in ("first_pose", "second_pose")
    )
    found = np.array([each["value"] for each in zero_document["plate_zero"]["gravity"]])
    np.testing.assert_allclose(found, 0.5 * (first - second), atol=0.05)
    assert abs(found[3]) > 20.0


def test_the_zero_is_written_to_the_cell_file_and_the_run(
    zero_document: dict[str, Any], cell: Path
) -> None:
    plate = load_cell(str(cell)).config.plate
    assert plate is not None
    assert plate.zero is not None
    assert plate.zero.model_dump(mode="json") == zero_document["zero"]
    assert zero_document["written"] == str(cell)
    beside = find_run(cell.parent / "runs", "plate zero")
    assert beside.read("zero.yaml").decode() in cell.read_text()
    assert "Offsets of the force plate" in beside.file("report.html").read_text()
    assert "# a Kistler 9281B force plate under the robot" in cell.read_text()


def test_other_commands_subtract_that_zero(
    zero_document: dict[str, Any], cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = ["--runs", str(tmp_path / "runs")]
    assert run(["check", str(cell), "--seconds", "0.3", "--json", *runs]) == 0
    lines = {line["what"]: line for line in json.loads(capsys.readouterr().out)["lines"]}
    assert lines["deviation of the force at rest from its zero"]["verdict"] == "ok"
    assert (
        abs(float(lines["deviation of the force at rest from its zero"]["found"].split()[1])) < 2.5
    )
    moved = cell.with_name("moved.yaml")
    moved.write_text(cell.read_text().replace("    pose: [-1.57", "    pose: [1.57"))
    assert run(["check", str(moved), "--seconds", "0.3", "--json", *runs]) == 0
    lines = {line["what"]: line for line in json.loads(capsys.readouterr().out)["lines"]}
    elsewhere = lines[
        "deviation of the force at rest from its zero, in another pose than at zeroing"
    ]
    assert elsewhere["verdict"] == "shown"


def interrupt_after(
    after_row: int, sent: list[int]
) -> Callable[..., Callable[[TaskProgress], None]]:
    from rid_daq.terminal.motion_progress import progress_callback

    def make_callback(*arguments: Any) -> Callable[[TaskProgress], None]:
        show = progress_callback(*arguments)

        def update(progress: TaskProgress) -> None:
            show(progress)
            if progress.sample_index >= after_row and not sent:
                sent.append(1)
                os.kill(os.getpid(), signal.SIGINT)

        return update

    return make_callback


@pytest.mark.parametrize("after_row", [0, 600])
def test_ctrl_c_disables_the_drives_and_writes_no_zero(
    after_row: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    cell = make_cell(tmp_path)
    before = cell.read_bytes()
    sent: list[int] = []
    monkeypatch.setattr(
        "rid_daq.recording.run_session.progress_callback", interrupt_after(after_row, sent)
    )
    words = ["plate", "zero", str(cell), "--write", "--runs", str(tmp_path / "runs"), *QUICK]
    with serve_lockstep_cell(cell, monkeypatch, tmp_path) as simulated:
        assert run(words) == 130
        axes = simulated.axes()
    assert sent
    assert not axes.enabled.any()
    assert np.abs(axes.velocity).max() < 1e-6
    assert cell.read_bytes() == before


def test_without_write_the_lines_are_printed_and_the_file_is_unchanged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = make_cell(tmp_path)
    before = cell.read_bytes()
    words = ["plate", "zero", str(cell), "--runs", str(tmp_path / "runs"), *QUICK]
    assert run([*words, "--pose", "1.6,0.1,0.2"]) == 0
    output = capsys.readouterr().out
    assert "turned by 124 degrees" in output
    assert "do not allow half a turn" in output
    assert "    offset_n: [" in output
    assert_shown("force-plate", "rid-daq plate zero ir361", output, same_numbers=False)
    assert cell.read_bytes() == before


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--pose", "0,here,0"], "RID-REQUEST-INVALID"),
        (["--pose", "2.6,0,0"], "RID-PLATE-ZERO-POSE"),
        (["--pose", "0,0"], "RID-MOTION-JOINTS"),
    ],
)
def test_invalid_poses_are_refused_before_motion(
    words: list[str], code: str, cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["plate", "zero", str(cell), *words]) == 2
    assert code in capsys.readouterr().err


def test_a_bundled_cell_file_is_not_changed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["plate", "zero", "ir361", "--write"]) == 2
    assert "RID-PLATE-ZERO-WRITE" in capsys.readouterr().err


def test_a_real_cell_is_not_moved_without_a_user_to_confirm(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = make_cell(tmp_path)
    cell.write_text(cell.read_text().replace("simulated: true", "simulated: false"))
    assert run(["plate", "zero", str(cell)]) == 3
    assert "RID-AXIS-TEST-MISSING" in capsys.readouterr().err
    assert run(["plate", "zero", str(cell), "--without-axis-test"]) == 3
    assert "RID-ANSWER-NOBODY" in capsys.readouterr().err


def test_a_cell_without_a_plate_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = make_cell(tmp_path)
    text = cell.read_text()
    cell.write_text(text[: text.index("\nplate:") + 1])
    assert run(["plate", "zero", str(cell)]) == 2
    assert "RID-PLATE-MISSING" in capsys.readouterr().err
