"""`--load-changes` with signals: a gripper's switch at a digital input of a simulated drive."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from acquisition.motion.load_changes import LoadChange, LoadChanges, read_load_changes
from acquisition.motion.load_signal import LoadSignal
from acquisition.runs.catalogue import find_run
from acquisition.runs.folder import RunFolder
from compensation.online.stream import stream_motion
from config.cell.servo_profile import ServoProfile
from config.errors import DataQualityError, RecordingError
from config.load import load_cell, to_yaml
from config.simulation.plant import MountedBody
from rid_daq.app import run
from rid_daq.operations.path import streamed_path
from rid_daq.runs.changed_load import (
    LOAD_CHANGES,
    load_change_notes,
    load_changes_bytes,
    load_changes_of,
    require_known_outcomes,
)
from rid_daq.session.scenario import load_transfers
from tests.builders.json_output import document
from tests.builders.known_model import write_path_files
from tests.builders.raised_codes import raises_code

TOOL = MountedBody(
    mass_kg=4.0, centre_m=(0.8, 0.02, 0.01), inertia_kg_m2=(0.02, 0.03, 0.03, 0.0, 0.0, 0.0)
)
STILL = (
    "{kind: joint_path, robot: ir361, speed_fraction: 0.05, dwell_s: 2.0,"
    " points: [[0.0, 0.0, 0.0], [0.02, 0.02, 0.02]]}"
)
CYCLE_S = 0.008


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a cell whose drive of axis 2 sends its inputs, a path and models."""
    folder = tmp_path_factory.mktemp("signals")
    write_path_files(folder, STILL)
    bundled = load_cell("ir361")
    assert bundled.plant is not None
    plant = bundled.plant.model_copy(update={"payloads": {"tool": TOOL}})
    (folder / "plant.yaml").write_text(to_yaml(plant))
    axes = tuple(
        axis.model_copy(update={"servo": ServoProfile(digital_inputs=True)})
        if axis.joint == "axis2"
        else axis
        for axis in bundled.config.axes
    )
    keys = {"plate": None, "name": "signals", "plant": str(folder / "plant.yaml"), "axes": axes}
    (folder / "cell.yaml").write_text(to_yaml(bundled.config.model_copy(update=keys)))
    return folder


def load_file(folder: Path, name: str, simulated: str, **signal: Any) -> Path:
    """Write a load-change file with a signal at 1 s; keys of the signal can be replaced."""
    keys: dict[str, Any] = {"joint": "axis2", "bit": 16, "debounce_s": 0.01}
    keys |= {"early_s": 0.1, "late_s": 0.1, "missed": "stop"} | signal
    words = ", ".join(f"{key}: {value}" for key, value in keys.items())
    file = folder / f"{name}.yaml"
    file.write_text(
        "changes:\n- {at_s: 1.0, payload: payload.json, ramp_s: 0.1,"
        f" signal: {{{words}}}, simulated: {{payload: tool, {simulated}}}}}\n"
    )
    return file


def three_changes(folder: Path, name: str, simulated: str, missed: str = "stop") -> Path:
    """Write a load-change file with two signals at one switch, and a change at a stated time."""
    keys = "joint: axis2, bit: 16, debounce_s: 0.01, early_s: 0.1, late_s: 0.1"
    up = f"at_s: 0.5, ramp_s: 0.1, signal: {{{keys}, missed: {missed}}}"
    down = f"at_s: 1.0, ramp_s: 0.1, signal: {{{keys}, missed: {missed}, active: low}}"
    file = folder / f"{name}.yaml"
    file.write_text(
        f"changes:\n- {{{up}, payload: payload.json, simulated: {{payload: tool, {simulated}}}}}\n"
        f"- {{{down}, payload: none, simulated: {{payload: none}}}}\n"
        "- {at_s: 1.5, ramp_s: 0.1, payload: payload.json, simulated: {payload: tool}}\n"
    )
    return file


def outcomes_of(folder: Path, name: str) -> list[str | None]:
    stored = load_changes_of(find_run(folder / "runs", name))
    assert stored is not None
    return [change.outcome for change in stored.changes]


def stream(folder: Path, name: str, loads: Path, *words: str) -> int:
    files = [str(folder / "cell.yaml"), str(folder / "path.yaml"), "--load-changes", str(loads)]
    by = ["--model", str(folder / "alone.json"), "--loop", str(folder / "loops.json")]
    more = ["--label", name, "--runs", str(folder / "runs"), "--json", *words]
    return run(["stream", *files, *by, *more])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "simulated", "signal", "lateness_s"),
    [
        ("in time", "late_s: 0.0", {}, 0.0),
        ("late by 50 ms", "late_s: 0.05", {}, 0.05),
        ("early by 50 ms", "late_s: -0.05", {}, -0.05),
        ("a slow switch", "signal_delay_s: 0.05", {}, 0.05),
        ("bouncing", "bounce_s: 0.024", {}, 0.016),
        ("followed", "late_s: 0.3", {"outside": "report", "missed": "unloaded"}, 0.3),
    ],
)
def test_the_lateness_of_the_signal_is_reported_and_stored(
    folder: Path,
    name: str,
    simulated: str,
    signal: dict[str, Any],
    lateness_s: float,
    capsys: pytest.CaptureFixture[str],
) -> None:
    loads = load_file(folder, name, simulated, **signal)
    assert stream(folder, name, loads) == 0
    (found,) = document(capsys)["load_signals"]
    assert found["lateness_s"] == pytest.approx(lateness_s, abs=CYCLE_S)
    assert found["in_window"] is (name != "followed")
    stored = load_changes_of(find_run(folder / "runs", name))
    assert stored is not None
    assert stored.changes[0].came_s == found["came_s"]
    (note,) = load_change_notes(find_run(folder / "runs", name), name)
    assert f"{abs(1e3 * found['lateness_s']):.0f} ms" in note
    words = ["--model", str(folder / "alone.json"), "--load-changes", str(loads)]
    assert run(["tracking", name, *words, "--runs", str(folder / "runs")]) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "simulated"), [("never", "fault: never_closes"), ("too early", "late_s: -0.3")]
)
def test_a_signal_that_does_not_come_in_time_stops_the_robot(
    folder: Path, name: str, simulated: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert stream(folder, name, load_file(folder, name, simulated)) == 5
    found = document(capsys)
    assert found["status"] == "stopped"
    assert found["stop"]["code"] == "LOAD_SIGNAL"
    (signal,) = found["load_signals"]
    assert (signal["came_s"] is None) == (name == "never")


@pytest.mark.slow
def test_a_motion_with_an_active_input_is_refused_before_the_drives_are_enabled(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    loads = load_file(folder, "stuck", "fault: stuck", missed="unloaded", outside="report")
    assert stream(folder, "stuck", loads) == 3
    assert "RID-LOAD-SIGNAL-ACTIVE" in capsys.readouterr().err
    assert outcomes_of(folder, "stuck") == ["already_active"]


@pytest.mark.slow
def test_a_stopped_run_tells_which_changes_were_not_reached(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert stream(folder, "first", three_changes(folder, "first", "fault: never_closes")) == 5
    assert outcomes_of(folder, "first") == ["missed", "not_reached", "not_reached"]
    notes = load_change_notes(find_run(folder / "runs", "first"), "first")
    assert len(notes) == 3
    capsys.readouterr()
    assert stream(folder, "all", three_changes(folder, "all", "late_s: 0")) == 0
    assert outcomes_of(folder, "all") == ["came", "came", "begun"]
    assert [each["outcome"] for each in document(capsys)["load_signals"]] == ["came", "came"]


@pytest.mark.slow
def test_a_run_that_an_error_ended_contains_its_signals(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail_afterwards(*arguments: Any) -> None:
        stream_motion(*arguments)
        raise RecordingError("the recorder failed", code="RID-RECORDING-LOST")

    monkeypatch.setattr(streamed_path, "stream_motion", fail_afterwards)
    loads = load_file(folder, "failed", "late_s: 0.05")
    assert stream(folder, "failed", loads) != 0
    assert outcomes_of(folder, "failed") == ["came"]


def test_a_run_whose_program_was_killed_does_not_claim_that_a_signal_was_missed(
    tmp_path: Path,
) -> None:
    """The run contains the stated changes, but not their outcomes."""
    changes = read_load_changes(load_file(tmp_path, "killed", "late_s: 0"))
    folder = RunFolder.create(tmp_path / "runs", "killed", software={}, facts={})
    folder.write(LOAD_CHANGES, load_changes_bytes(changes))
    assert outcomes_of(tmp_path, "killed") == [None]
    assert len(load_change_notes(folder, "killed")) == 1
    with raises_code(DataQualityError, "RID-LOAD-SIGNAL-UNKNOWN", "killed"):
        require_known_outcomes(load_changes_of(folder), "killed")


def test_a_change_after_the_last_row_of_a_run_did_not_begin(tmp_path: Path) -> None:
    stated = LoadChange(at_s=1.5, payload="none", ramp_s=0.1)
    folder = RunFolder.create(tmp_path / "runs", "stopped", software={}, facts={})
    folder.write(LOAD_CHANGES, load_changes_bytes(LoadChanges(changes=(stated,))))
    (reached,) = load_change_notes(folder, "stopped", 1.6)
    (before,) = load_change_notes(folder, "stopped", 1.4)
    assert "1.5 s" in reached
    assert reached != before


@pytest.mark.slow
def test_a_missed_grip_can_be_reported_only(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    loads = load_file(folder, "missed", "fault: never_closes", missed="unloaded")
    assert stream(folder, "missed", loads) == 0
    (signal,) = document(capsys)["load_signals"]
    assert (signal["came_s"], signal["lateness_s"]) == (None, None)
    words = ["--model", str(folder / "alone.json"), "--load-changes", str(loads)]
    assert run(["tracking", "missed", *words, "--runs", str(folder / "runs")]) == 0


@pytest.mark.parametrize(
    ("signal", "code"),
    [
        ({"joint": "axis1"}, "RID-LOAD-SIGNAL-INPUT"),
        ({"joint": "gripper"}, "RID-LOAD-SIGNAL-INPUT"),
        ({"bit": 32}, "RID-FILE-VALUE"),
        ({"late_s": 50.0}, "RID-LOAD-CHANGE-TIME"),
        ({"missed": "wait"}, "RID-FILE-VALUE"),
    ],
)
def test_signals_that_cannot_come_are_refused(
    folder: Path, signal: dict[str, Any], code: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert stream(folder, "refused", load_file(folder, "refused", "late_s: 0", **signal)) == 2
    assert code in capsys.readouterr().err
    assert not (folder / "runs" / "refused").exists()


@pytest.mark.parametrize(
    "words",
    [
        ("compensate", "--model", "alone.json", "--loop", "loops.json", "-o", "ff.json"),
        ("record",),
        ("record", "--model", "alone.json"),
    ],
)
def test_torques_that_are_computed_before_the_motion_cannot_wait_for_a_signal(
    folder: Path, words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    loads = load_file(folder, "ahead", "late_s: 0")
    command, *given = [str(folder / word) if "." in word else word for word in words]
    full = [command, str(folder / "cell.yaml"), str(folder / "path.yaml"), *given]
    more = [] if command == "compensate" else ["--runs", str(folder / "runs")]
    assert run([*full, "--load-changes", str(loads), *more]) == 2
    assert "RID-LOAD-SIGNAL" in capsys.readouterr().err


def test_the_simulated_switch_is_that_of_the_signal() -> None:
    signal = LoadSignal(
        joint="axis2", bit=3, active="low", debounce_s=0.0, early_s=0.0, late_s=0.0, missed="stop"
    )
    change = LoadChange.model_validate(
        {"at_s": 1.0, "payload": "none", "ramp_s": 0.1, "signal": signal}
        | {"simulated": {"payload": "none", "late_s": -0.2, "fault": "never_closes"}}
    )
    (transfer,) = load_transfers(LoadChanges(changes=(change,)))
    assert transfer.missed
    assert transfer.begin_s == pytest.approx(0.8)
    assert transfer.switch is not None
    assert (transfer.switch.joint, transfer.switch.bit, transfer.switch.level) == (
        "axis2", 3, False
    )  # fmt: skip
