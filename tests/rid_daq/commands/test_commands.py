"""The main commands, one after the other, on a simulated cell, as a new user runs them."""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.journal.cycles import read_journal
from acquisition.motion.samples import Phase
from acquisition.runs.catalogue import find_run
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from acquisition.session.repair import repair_journal
from config.errors import ConfigError
from rid_daq.app import run
from tests.builders.json_output import document
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder made by init, with an excitation run and a validation run."""
    folder = tmp_path_factory.mktemp("workshop")
    assert run(["init", str(folder)]) == 0
    motion = folder / "motion.yaml"
    motion.write_text(motion.read_text().replace("periods: 8", "periods: 4"))
    validation = folder / "validation.yaml"
    validation.write_text(validation.read_text().replace("points: 20", "points: 6"))
    runs = ["--runs", str(folder / "runs")]
    cell = str(folder / "cell.yaml")
    assert run(["record", cell, str(motion), "--label", "excitation", *runs]) == 0
    words = ["record", cell, str(validation), "--label", "validation", "--frames", *runs]
    assert run(words) == 0
    assert run(["identify", "excitation", "-o", str(folder / "model.json"), *runs]) == 0
    return folder


def test_a_run_folder_contains_all_files_and_lists_them(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["runs", "--verify", "--json", *runs]) == 0
    first, second = document(capsys)["runs"]
    assert (first["label"], second["label"]) == ("excitation", "validation")
    assert first["status"] == "complete"
    folder = RunFolder.open(Path(first["folder"]))
    assert {
        "cell.yaml", "robot.yaml", "plant.yaml", "motion.yaml", "recording.mcap",
        "result.json", "report.html",
    } <= set(folder.manifest().files)  # fmt: skip
    assert folder.manifest().software["rid-daq"]
    other = RunFolder.open(Path(second["folder"]))
    assert set(other.manifest().files) - set(folder.manifest().files) == {"frames.blf"}


def test_average_reports_the_periods_used_and_the_noise(
    runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["average", "excitation", "--json", *runs]) == 0
    average = document(capsys)["average"]
    assert average["periods_kept"] == 4
    assert average["samples_per_period"] == 1250
    assert average["rejected"] == []
    noise = [axis["torque_noise"] for axis in average["axes"]]
    assert noise == pytest.approx([1.2, 1.5, 0.5], rel=0.15)


@pytest.mark.usefixtures("drawn_reports")
def test_identify_writes_a_model_with_intervals(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", "excitation", "--json", *runs]) == 0
    result = document(capsys)
    model = json.loads(Path(result["model"]).read_text())
    assert model["cell"] == "my_cell"
    parameters = {entry["name"]: entry for entry in result["estimate"]["parameters"]}
    assert parameters["fv_axis1"]["value"] == pytest.approx(25.0, rel=0.1)
    assert all(entry["std"] > 0.0 for entry in parameters.values())
    assert Path(result["report"]).read_text().count("<svg") >= 4


def test_a_run_given_twice_as_a_copy_or_still_open_is_refused(
    workshop: Path, runs: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(find_run(workshop / "runs", "excitation").path, tmp_path / "copy")
    for command in ("identify", "friction"):
        for twice in ("excitation", str(tmp_path / "copy")):
            assert run([command, "excitation", twice, *runs]) == 2
            assert "RID-OPTION-EXCLUSIVE" in capsys.readouterr().err
    with (tmp_path / "copy" / "recording.mcap").open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert run(["identify", str(tmp_path / "copy"), *runs]) == 8
    assert "RID-RUN-OPEN" in capsys.readouterr().err


def test_missing_rows_of_a_run_are_noted_by_every_command(
    workshop: Path, runs: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = RunFolder.create(tmp_path, "torn")
    whole = find_run(workshop / "runs", "excitation")
    for name in ("cell.yaml", "robot.yaml", "motion.yaml"):
        folder.write(name, whole.read(name))
    path = folder.file("recording.mcap")
    repair_journal(whole.file("recording.mcap"), path, folder.run_id)
    recording = bytearray(path.read_bytes())
    recording[len(recording) // 2] ^= 1
    path.write_bytes(recording)
    folder.finish(RunStatus.STOPPED)
    for words in (["average"], ["validate", str(workshop / "model.json")]):
        run([*words, str(folder.path), *runs])
        output = capsys.readouterr().out
        assert "note: torn: the run was stopped before its end\n" in output
        assert re.search(r"note: torn: rows \d+ to \d+ are lost", output)


@pytest.mark.fault(35)
def test_a_copied_run_gives_the_same_parameters_bit_by_bit_in_another_process(
    workshop: Path, tmp_path: Path, measured: Callable[[str], None]
) -> None:
    folder = find_run(workshop / "runs", "excitation")
    shutil.copytree(folder.path, tmp_path / "elsewhere")
    (tmp_path / "elsewhere" / "model.json").unlink(missing_ok=True)
    words = ["identify", str(tmp_path / "elsewhere"), "-o", str(tmp_path / "again.json")]
    environment = {**os.environ, "TZ": "Pacific/Auckland", "PYTHONHASHSEED": "7"}
    subprocess.run(
        [sys.executable, "-m", "rid_daq", *words], check=True, capture_output=True, env=environment
    )
    first = json.loads((workshop / "model.json").read_text())
    again = json.loads((tmp_path / "again.json").read_text())
    assert len(first["parameters"]) > 10
    assert again == first
    measured("all numbers of both model files are equal, difference 0 ULP")


def test_validate_passes_and_fails_by_its_limits(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["validate", str(workshop / "model.json"), "validation", *runs]
    assert run([*words, "--limits", "10", "--json"]) == 0
    result = document(capsys)
    assert result["verdict"]["passed"] is True
    assert max(axis["relative_error_percent"] for axis in result["validation"]["axes"]) < 5.0
    assert run([*words, "--limits", "10,0.01,10", "--json"]) == 1
    axes = document(capsys)["validation"]["axes"]
    assert [axis["passed"] for axis in axes] == [True, False, True]
    assert run(words) == 0  # with the limits of the cell file


def test_validation_on_the_identification_run_gives_no_verdict(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["validate", str(workshop / "model.json"), "excitation", *runs]) == 6
    assert "RID-VALIDATE-SAME-RUN" in capsys.readouterr().err


def test_a_too_short_run_gives_a_verdict_only_together_with_others(
    workshop: Path, runs: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, folder = find_run(workshop / "runs", "validation"), RunFolder.create(tmp_path, "short")
    for name in ("cell.yaml", "robot.yaml", "motion.yaml"):
        folder.write(name, whole.read(name))
    path = folder.file("recording.mcap")
    repair_journal(whole.file("recording.mcap"), path, folder.run_id)
    recording = path.read_bytes()
    path.write_bytes(recording[: len(recording) // 4])
    folder.finish(RunStatus.STOPPED)
    words = ["validate", str(workshop / "model.json"), str(folder.path), "--limits", "10"]
    assert run([*words, *runs]) == 6
    assert re.search(r"moves for [1-4]\.\d s, but a verdict needs 5 s", capsys.readouterr().err)
    assert run([*words[:3], "validation", *words[3:], *runs]) == 0


@pytest.mark.usefixtures("drawn_reports")
def test_report_is_rewritten_from_the_results_only(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", "excitation", "--json", *runs]) == 0
    report = Path(document(capsys)["report"])
    before = report.read_bytes()
    report.unlink()
    assert run(["report", str(report.parent)]) == 0
    assert f"Report: {report}" in capsys.readouterr().out
    assert report.read_bytes() == before


def test_verify_finds_a_changed_file(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = RunFolder.open(next((workshop / "runs").iterdir()))
    motion = folder.path / "motion.yaml"
    before = motion.read_bytes()
    motion.write_bytes(before + b"# changed\n")
    try:
        assert run(["runs", "--verify", *runs]) == 7
        assert "motion.yaml" in capsys.readouterr().err
        assert run(["runs", "--verify", "--json", *runs]) == 7
        (listed,) = [each for each in document(capsys)["runs"] if each["problems"]]
        assert "motion.yaml" in listed["problems"][0]
    finally:
        motion.write_bytes(before)


def test_verify_refuses_a_runs_folder_that_does_not_exist(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["runs", "--verify", "--runs", str(tmp_path / "rums")]) == 2
    assert "RID-RUN-UNKNOWN" in capsys.readouterr().err


def test_design_writes_a_motion_and_does_not_overwrite_a_file(
    workshop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    motion = tmp_path / "designed.yaml"
    words = ["design", str(workshop / "cell.yaml"), "-o", str(motion), "--json"]
    words += ["--method", "two-harmonic", "--tries", "5"]
    assert run(words) == 0
    result = document(capsys)
    assert result["condition_number"] > 1.0
    assert all(axis["velocity_percent"] <= 100.0 for axis in result["axes"])
    assert motion.read_text().startswith("# Excitation for robot my_robot")
    assert run(words) == 2  # existing files are not overwritten by default


def test_check_reads_every_drive_without_motion(
    workshop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["check", str(workshop / "cell.yaml"), "--seconds", "0.5"]
    assert run([*words, "--json"]) == 0
    result = document(capsys)
    assert result["passed"] is True
    watchdogs = [line for line in result["lines"] if line["what"].startswith("6007h")]
    assert [line["where"] for line in watchdogs] == [
        "axis1, node 1", "axis2, node 2", "axis3, node 3",
    ]  # fmt: skip
    assert all(line["required"] == line["found"] == "3" for line in watchdogs)
    whats = {line["what"]: line["verdict"] for line in result["lines"]}
    assert whats["reaction time if this computer fails"] == "ok"
    assert whats["drive heartbeat loss detected after"] == "ok"
    assert whats["writing to disk"] == "ok"
    assert whats["date"] == "ok"
    privileges = {"real-time scheduling", "locked memory", "processors kept awake"}
    assert privileges <= set(whats)
    assert not list(workshop.glob("**/.rid-daq-speed-*"))


@pytest.mark.fault(9)
def test_a_fault_script_stops_a_recording_and_reset_resets_the_drives(
    workshop: Path,
    runs: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
) -> None:
    faults = tmp_path / "faults.yaml"
    faults.write_text("drives: [{kind: emergency, joint: axis2, at_cycle: 200, code: 17168}]\n")
    cell, motion = str(workshop / "cell.yaml"), str(workshop / "validation.yaml")
    words = ["record", cell, motion, "--label", "spoiled", "--faults", str(faults), *runs]
    assert run([*words, "--json"]) == 5
    stop = document(capsys)["stop"]
    assert (stop["code"], "axis2" in stop["text"]) == ("EMERGENCY", True)
    folder = find_run(workshop / "runs", "spoiled")
    assert (folder.path / "faults.yaml").read_bytes() == faults.read_bytes()
    assert "axis2: torque in the last second" in folder.file("report.html").read_text()
    assert run(["reset", cell, "--json"]) == 0
    drives = document(capsys)["drives"]
    assert [drive["after"] for drive in drives] == ["switch on disabled"] * 3
    words[4] = "twice"
    assert run([*words, "--rehearse"]) == 5
    labels = {folder.name for folder in (workshop / "runs").iterdir()}
    assert find_run(workshop / "runs", "twice rehearsal").path.name in labels
    with raises_code(ConfigError, "RID-RUN-UNKNOWN"):
        find_run(workshop / "runs", "twice")
    faults.write_text("drives: [{kind: emergency, joint: elbow}]\n")
    assert run(words) == 2
    measured("'record': exit code 5, axis named; 'reset': 3 of 3 drives reset, none enabled")


@pytest.mark.fault(19)
def test_ctrl_c_stops_the_robot_and_keeps_the_recording_with_exit_code_130(
    workshop: Path, tmp_path: Path, measured: Callable[[str], None]
) -> None:
    text = (workshop / "motion.yaml").read_text()
    (tmp_path / "long.yaml").write_text(re.sub(r"(?m)^periods: \d+", "periods: 40", text))
    words = [
        sys.executable, "-m", "rid_daq", "record", str(workshop / "cell.yaml"),
        str(tmp_path / "long.yaml"), "--runs", str(tmp_path / "runs"),
    ]  # fmt: skip
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    ) as program:
        assert program.stdout is not None
        lines = [""]
        while not lines[-1].startswith("recording:"):
            lines.append(program.stdout.readline())
            assert lines[-1], f"the program ended before it moved: {''.join(lines)}"
        sent_ns = time.time_ns()
        for _ in range(3):
            program.send_signal(signal.SIGINT)
        output = program.stdout.read()
    assert program.returncode == 130
    assert "Traceback" not in output
    assert re.search(r"Stopped .*\. .* after its start", output)
    (folder,) = (tmp_path / "runs").iterdir()
    assert RunFolder.open(folder).manifest().status == "stopped"
    journal = read_journal(folder / "recording.mcap")
    assert journal.damage.finished
    closed_s = 1e-9 * ((folder / "recording.mcap").stat().st_mtime_ns - sent_ns)
    assert 0.0 < closed_s < 60.0
    measured(f"Ctrl-C: exit code 130, file closed {closed_s:.1f} s later in real time")
    assert "The motion was stopped before its end" in (folder / "report.html").read_text()


def test_record_frames_is_refused_on_slcan_before_a_run_folder_exists(
    workshop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (workshop / "cell.yaml").read_text()
    cell = tmp_path / "cell.yaml"
    assert text.count("interface: rid_sim") == 1
    cell.write_text(text.replace("interface: rid_sim", "interface: slcan"))
    (tmp_path / "robot.yaml").write_text((workshop / "robot.yaml").read_text())
    runs = tmp_path / "runs"
    motion = str(workshop / "validation.yaml")
    assert run(["record", str(cell), motion, "--frames", "--runs", str(runs)]) == 2
    assert "RID-CAN-INTERFACE" in capsys.readouterr().err
    assert not runs.exists()


def test_check_uses_a_served_cell_and_a_second_mock_is_refused(
    workshop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = tmp_path / "cell.yaml"
    text = (workshop / "cell.yaml").read_text()
    cell.write_text(text.replace("channel: my_cell", f"channel: test_{tmp_path.name}"[:60]))
    (tmp_path / "robot.yaml").write_text((workshop / "robot.yaml").read_text())
    words = [sys.executable, "-m", "rid_daq", "mock", str(cell)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as served:
        assert served.stdout is not None
        mock_lines = [served.stdout.readline() for _ in range(3)]
        try:
            assert any("can_logger -i rid_sim -c test_" in line for line in mock_lines)
            assert run(["mock", str(cell)]) == 8
            capsys.readouterr()
            run(["check", str(cell), "--seconds", "0.3", "--json"])
            lines = document(capsys)["lines"]
            assert any(line["what"].startswith("6007h") for line in lines)
            # In real time a stall of the computer can lose an answer; compare drive settings only.
            settings = [line for line in lines if re.match(r"[0-9A-F]{4}h", line["what"])]
            assert {line["verdict"] for line in settings} == {"ok", "shown"}
        finally:
            served.send_signal(signal.SIGINT)
        assert "Ended." in served.stdout.read()
    assert served.returncode == 0


def test_a_nonperiodic_run_is_identified_with_the_anti_alias_filter(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    model = tmp_path / "model.json"
    assert run(["identify", "validation", "-o", str(model), *runs]) == 0
    capsys.readouterr()
    assert run(["validate", str(model), "excitation", "--json", *runs]) == 0
    for axis in document(capsys)["validation"]["axes"]:
        assert axis["relative_error_percent"] < 5.0


@pytest.mark.slow
@pytest.mark.long
def test_a_recording_ends_when_the_required_accuracy_is_reached(
    workshop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    motion = tmp_path / "motion.yaml"
    text = (workshop / "motion.yaml").read_text()
    motion.write_text(text.replace("periods: 4", "periods: 6"))
    words = ["record", str(workshop / "cell.yaml"), str(motion), "--json"]
    words += ["--runs", str(tmp_path / "runs")]
    capsys.readouterr()
    assert run([*words, "--until", "fc_axis1<5Nm", "--until", "torque<50Nm"]) == 0
    result = document(capsys)
    assert result["status"] == "complete"
    assert result["accuracy"]["reached"]
    assert result["accuracy"]["periods"] == 3
    assert max(result["accuracy"]["relative_percent"]) < 8.0  # single periods, with reversals
    recording = read_journal(Path(result["folder"]) / "recording.mcap").recording()
    assert (recording.phase == Phase.MAIN).sum() == 3 * (recording.samples_per_period or 0)
    assert run([*words, "--until", "fc_axis1<0.0001Nm"]) == 1
    result = document(capsys)
    assert (result["status"], result["accuracy"]["periods"]) == ("complete", 6)
    assert run([*words, "--until", "fc_axis9<1"]) == 2
