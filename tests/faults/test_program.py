"""Faults of processes and disk during `rid-daq record`, caused by a fault script.

The faults are real: signals, a limit on file sizes, a full file system.
"""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from acquisition.journal.cycles import Journal, read_journal
from acquisition.runs.folder import RunFolder
from rid_daq.app import run

# a fault of the program acts on the program's own child processes
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("new_python_processes")]

AT = 150
Measured = Callable[[str], None]


class RecordedOutcome(NamedTuple):
    """Exit code, JSON document, run folder and journal of a recording."""

    code: int
    document: dict[str, Any]
    folder: RunFolder
    journal: Journal


def record_words(workshop: Path, script: str, runs: Path) -> list[str]:
    (workshop / "faults.yaml").write_text(f"program: [{script}]\n")
    words = ["record", str(workshop / "cell.yaml"), str(workshop / "validation.yaml"), "--json"]
    return [*words, "--faults", str(workshop / "faults.yaml"), "--runs", str(runs)]


Record = Callable[..., RecordedOutcome]


@pytest.fixture
def record(workshop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Record:
    """Return a function that records with a fault of the program."""

    def record_with_fault(script: str) -> RecordedOutcome:
        code = run(record_words(workshop, script, tmp_path / "runs"))
        document, _ = json.JSONDecoder().raw_decode(capsys.readouterr().out)
        folder = RunFolder.open(Path(document["folder"]))
        return RecordedOutcome(code, document, folder, read_journal(folder.path / "recording.mcap"))

    return record_with_fault


def rows_missing(journal: Journal) -> int:
    """Return the number of missing rows between the first and the last one."""
    return int(np.sum(np.diff(journal.rows["cycle"].astype(np.int64)) - 1))


def test_a_killed_recorder_gives_exit_code_7_and_its_rows_are_kept(record: Record) -> None:
    done = record(f"{{kind: kill, process: recorder, at_cycle: {AT}}}")
    assert done.code == 7
    assert done.document["stop"]["code"] == "RECORDER"
    assert "exit code -9" in done.document["notes"][0]
    assert not done.journal.damage.finished
    assert rows_missing(done.journal) == 0
    assert 0 < len(done.journal.rows) <= AT
    assert done.folder.manifest().status == "stopped"


def test_a_killed_task_is_reported_and_rows_are_kept_up_to_that_cycle(record: Record) -> None:
    done = record(f"{{kind: kill, process: task, at_cycle: {AT}}}")
    assert done.code == 5
    assert done.document["stop"]["code"] == "TASK_DIED"
    assert "the drives stop by themselves" in done.document["stop"]["text"]
    assert done.journal.damage.notes == ()
    # The drives' clock determines the time; a row is written after the drives' answers.
    assert AT - 5 <= len(done.journal.rows) < AT


@pytest.mark.fault(20)
def test_the_report_is_written_if_ctrl_c_repeats_during_clean_up(
    record: Record, measured: Measured
) -> None:
    """A SIGINT arrives every 5 ms while the program stops the drives and writes file and report."""
    keys = "kind: signal, signal: INT, count: 1000, period_s: 0.005"
    done = record(f"{{{keys}, at_cycle: {AT}}}")
    assert done.code == 130
    assert done.document["stop"]["text"] == "stopped by the user or by the end of the program"
    assert done.journal.damage.notes == ()
    assert len(done.journal.rows) >= AT - 5
    assert done.folder.manifest().status == "stopped"
    assert "The motion was stopped before its end" in (done.folder.path / "report.html").read_text()
    measured("Ctrl-C 200 times a second until the end: exit 130, file closed, report written")


@pytest.mark.fault(24)
def test_a_failed_write_stops_the_motion_and_keeps_the_written_rows(
    record: Record, measured: Measured
) -> None:
    done = record("{kind: disk_error, after_bytes: 20000}")
    assert done.code == 7
    assert done.document["stop"]["code"] == "RECORDER"
    assert "cannot be written: File too large" in done.document["stop"]["text"]
    size = (done.folder.path / "recording.mcap").stat().st_size
    assert 20_000 < size < 30_000
    assert not done.journal.damage.finished
    assert rows_missing(done.journal) == 0
    assert len(done.journal.rows) > 20
    measured(f"EFBIG at byte {size}: exit 7, {len(done.journal.rows)} whole rows kept")


@pytest.mark.fault(24)
def test_a_suspended_recorder_loses_no_rows(record: Record, measured: Measured) -> None:
    done = record(f"{{kind: disk_stall, duration_s: 0.5, at_cycle: {AT}}}")
    assert done.code == 0
    assert done.journal.damage.notes == ()
    assert rows_missing(done.journal) == 0
    assert done.document["rows"] == len(done.journal.rows) > 2 * AT
    measured(f"the recorder stopped for 0.5 s: 0 of {done.document['rows']} rows lost")


@pytest.mark.fault(18)
def test_a_killed_program_leaves_a_complete_recording(
    workshop: Path, tmp_path: Path, measured: Measured
) -> None:
    words = record_words(workshop, f"{{kind: kill, process: program, at_cycle: {AT}}}", tmp_path)
    # `run` returns when drives, task and recorder have ended: they hold the output pipe.
    done = subprocess.run(
        [sys.executable, "-m", "rid_daq", *words], capture_output=True, check=False
    )
    assert done.returncode == -signal.SIGKILL
    assert done.stderr == b""
    (folder,) = tmp_path.iterdir()
    journal = read_journal(folder / "recording.mcap")
    assert journal.damage.notes == ()
    assert rows_missing(journal) == 0
    assert len(journal.rows) >= AT - 5
    assert not journal.rows["velocity_command"][-1].any()
    measured(
        f"program killed by a fault script: all {len(journal.rows)} rows kept, the file closed"
    )


@pytest.mark.fault(24)
def test_a_full_disk_gives_exit_code_7_and_a_complete_file(
    workshop: Path, tmp_path: Path, measured: Measured
) -> None:
    """The disk is a small RAM disk in a mount namespace of its own, and disappears with it."""
    small, kept = tmp_path / "small", tmp_path / "kept"
    words = record_words(workshop, f"{{kind: disk_full, at_cycle: {AT}}}", small)
    program = [sys.executable, "-m", "rid_daq", *words]
    script = f'mkdir -p "{small}" && mount -t tmpfs -o size=560m none "{small}" && '
    apart = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c"]
    tried = [*apart, f"{script} true"]
    if shutil.which("unshare") is None or subprocess.run(tried, check=False).returncode:
        pytest.skip("no RAM disk can be mounted here: user name spaces are disabled")
    script += f'"$@"; code=$?; cp -r "{small}" "{kept}"; df "{small}"; exit $code'
    done = subprocess.run(
        [*apart, script, "sh", *program], capture_output=True, text=True, check=False
    )
    assert done.returncode == 7, done.stderr
    document, _ = json.JSONDecoder().raw_decode(done.stdout)
    assert document["stop"]["code"] == "RECORDER"
    assert document["stop"]["text"].endswith("the disk is full")
    assert " 1% " in done.stdout.splitlines()[-1], "the disk space is released"
    (folder,) = kept.iterdir()
    journal = read_journal(folder / "recording.mcap")
    assert journal.damage.notes == ()
    assert rows_missing(journal) == 0
    assert document["rows"] == len(journal.rows) >= AT - 5
    assert RunFolder.open(folder).manifest().status == "stopped"
    measured(
        f"ENOSPC on a RAM disk: exit 7, 0 of {document['rows']} rows lost, file and report complete"
    )


@pytest.mark.alone
@pytest.mark.fault(27)
def test_a_task_that_was_suspended_sends_the_quick_stop_before_any_set_point(
    workshop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], measured: Measured
) -> None:
    """The task is suspended for 0.6 s in real time; the wide limits permit all other delays."""
    patient = {
        "late_cycles_limit: 3": "late_cycles_limit: 10000\n  late_answers_limit: 100\n"
        "  late_by_cycles_limit: 60",
        "missed_frames_limit: 3": "missed_frames_limit: 90",
        "master_heartbeat_timeout_ms: 80": "master_heartbeat_timeout_ms: 750",
        "drive_heartbeat_timeout_ms: 100": "drive_heartbeat_timeout_ms: 750",
    }
    text = (workshop / "cell.yaml").read_text()
    for now, then in patient.items():
        assert now in text
        text = text.replace(now, then)
    (tmp_path / "cell.yaml").write_text(text)
    shutil.copy(workshop / "robot.yaml", tmp_path)
    script = f"{{kind: freeze, process: task, duration_s: 0.6, at_cycle: {AT}}}"
    words = record_words(workshop, script, tmp_path / "runs")
    words[1] = str(tmp_path / "cell.yaml")
    assert run([*words, "--realtime"]) == 5
    document, _ = json.JSONDecoder().raw_decode(capsys.readouterr().out)
    assert document["stop"]["code"] == "LATE_CYCLE"
    late = re.search(r"began (\d+\.\d) ms late", document["stop"]["text"])
    assert late is not None
    assert float(late[1]) > 480.0
    rows = read_journal(Path(document["folder"]) / "recording.mcap").rows
    after = np.flatnonzero(rows["lateness_s"] > 0.48)[0]
    assert not rows["velocity_command"][after:].any()
    measured(
        f"SIGSTOP in real time: {late[1]} ms late, then a quick stop and 0 set-points after it"
    )


def test_mock_refuses_faults_of_the_program(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record_words(workshop, "{kind: kill, process: task}", workshop)
    faults = str(workshop / "faults.yaml")
    assert run(["mock", str(workshop / "cell.yaml"), "--faults", faults]) == 2
    message = capsys.readouterr().err
    assert f"{faults}:" in message
    assert "--faults" in message


def test_filling_a_disk_that_is_not_a_separate_one_is_refused_before_the_start(
    workshop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(record_words(workshop, "{kind: disk_full}", tmp_path / "runs")) == 2
    assert "[RID-FAULT-SCRIPT]" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()
