"""Changes in the run folder while the robot moves: foreign files, deleted or replaced files."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from acquisition.journal.cycles import JournalWriter, read_journal
from acquisition.journal.header import JournalHeader
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RECORDING, RunStatus
from acquisition.session.record import record_motion
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import RecorderState, TaskProgress
from config.errors import RecordingError
from rid_daq.app import run
from tests.builders.json_output import document

pytestmark = pytest.mark.slow

INTO = 100
"""Number of the first set-point at which the folder can be changed."""

Disturb = Callable[[RunFolder], None]
Meddle = Callable[[Disturb], None]


@pytest.fixture
def change_during_motion(monkeypatch: pytest.MonkeyPatch) -> Meddle:
    """Return a function that schedules a change of the run folder during the motion."""
    whole = record_motion

    def schedule_change(disturb: Disturb) -> None:
        def record(
            *arguments: Any, on_progress: Callable[[TaskProgress], None], **options: Any
        ) -> Any:
            done = False

            def change_once(progress: TaskProgress) -> None:
                nonlocal done
                if not done and progress.sample_index >= INTO:
                    disturb(arguments[3])
                    done = True
                on_progress(progress)

            return whole(*arguments, on_progress=change_once, **options)

        monkeypatch.setattr("rid_daq.recording.run_session.record_motion", record)

    return schedule_change


def add_strays(folder: RunFolder) -> None:
    for name in ("notes (1).txt", ".DS_Store", "notes.txt"):
        (folder.path / name).write_text("mine")
    (folder.path / "a subfolder").mkdir()
    (folder.path / "a subfolder" / "more.txt").write_text("mine")
    (folder.path / "dangling").symlink_to("nowhere")
    os.mkfifo(folder.path / "pipe")
    Path(os.fsdecode(os.fsencode(folder.path) + b"/caf\xe9.txt")).write_text("mine")


@pytest.mark.fault(44)
def test_foreign_files_are_kept_and_named_and_the_run_is_completed(
    workshop: Path,
    tmp_path: Path,
    change_during_motion: Meddle,
    capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
) -> None:
    change_during_motion(add_strays)
    runs = ["--runs", str(tmp_path)]
    words = ["record", str(workshop / "cell.yaml"), str(workshop / "validation.yaml"), *runs]
    assert run([*words, "--json"]) == 0
    folder = RunFolder.open(Path(document(capsys)["folder"]))
    manifest = folder.manifest()
    assert manifest.status == RunStatus.COMPLETE
    assert {RECORDING, "robot.yaml", "result.json", "report.html"} <= set(manifest.files)
    strays = (
        ".DS_Store", "a subfolder", "a subfolder/more.txt", r"caf\udce9.txt", "dangling",
        "notes (1).txt", "notes.txt", "pipe",
    )  # fmt: skip
    assert folder.strays() == strays
    assert not set(strays) & set(manifest.files)
    assert (folder.path / "notes (1).txt").read_text() == "mine"
    assert run(["runs", "--verify", *runs]) == 0
    output = capsys.readouterr().out
    assert (
        f"note: {folder.run_id}: files that do not belong to the run: .DS_Store, a subfolder"
        in output
    )
    assert run(["export", str(folder.path), "--to", "csv", "-o", str(tmp_path / "all.csv")]) == 0
    measured(f"{len(strays)} of 8 unknown files: exit code 0, run complete, named by runs --verify")


def delete_folder(folder: RunFolder) -> None:
    shutil.rmtree(folder.path)


def delete_recording(folder: RunFolder) -> None:
    (folder.path / RECORDING).unlink()


def cut_recording(folder: RunFolder) -> None:
    os.truncate(folder.path / RECORDING, 20_000)


def replace_recording(folder: RunFolder) -> None:
    shutil.copy(folder.path / RECORDING, folder.path / "copy.tmp")
    (folder.path / "copy.tmp").rename(folder.path / RECORDING)


@pytest.mark.fault(48)
@pytest.mark.parametrize(
    ("disturb", "became"),
    [
        (delete_folder, "was deleted while it was being written"),
        (delete_recording, "was deleted while it was being written"),
        (cut_recording, "was cut while it was being written: "),
        (replace_recording, "was deleted while it was being written"),
    ],
)
def test_a_deleted_or_truncated_recording_stops_the_motion(
    workshop: Path,
    tmp_path: Path,
    change_during_motion: Meddle,
    capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
    disturb: Disturb,
    became: str,
) -> None:
    """In lock-step, the simulated time waits after each period until the program has evaluated it.

    So the motion cannot end before the change is noticed.
    """
    change_during_motion(disturb)
    words = ["record", str(workshop / "cell.yaml"), str(workshop / "motion.yaml")]
    assert run([*words, "--runs", str(tmp_path)]) == 7
    out, err = capsys.readouterr()
    output = out + err
    (stopped,) = [line for line in output.splitlines() if "Stopped: " in line]
    assert f"/{RECORDING}: {became}" in stopped
    for word in ("killed", "died", "exit code"):
        assert word not in output
    for path in tmp_path.iterdir():
        assert RunFolder.open(path).manifest().status == RunStatus.STOPPED
    fault = disturb.__name__.replace("_", " ")
    measured(f"{fault}: quick stop with this cause, exit code 7, no process killed")


@pytest.mark.fault(42)
def test_a_folder_that_replaces_the_run_folder_is_not_written_to(
    workshop: Path,
    tmp_path: Path,
    change_during_motion: Meddle,
    capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
) -> None:
    foreign = RunFolder.create(tmp_path / "other runs", "foreign")
    foreign.write("robot.yaml", b"foreign")
    foreign.finish(RunStatus.COMPLETE)
    before = (foreign.path / "manifest.json").read_bytes()
    folders: list[RunFolder] = []

    def swap(folder: RunFolder) -> None:
        folders.append(folder)
        folder.path.rename(tmp_path / "moved")
        foreign.path.rename(folder.path)

    change_during_motion(swap)
    words = ["record", str(workshop / "cell.yaml"), str(workshop / "motion.yaml")]
    assert run([*words, "--runs", str(tmp_path / "runs")]) == 7
    output = capsys.readouterr().err
    (folder,) = folders
    assert f"{RECORDING}: was moved away while it was being written" in output
    assert f"{folder.path}: now contains run {foreign.run_id}" in output
    assert {path.name for path in folder.path.iterdir()} == {"manifest.json", "robot.yaml"}
    assert (folder.path / "manifest.json").read_bytes() == before
    moved = read_journal(tmp_path / "moved" / RECORDING)
    assert moved.header.run_id == folder.run_id
    assert moved.damage.notes == ()
    measured(
        "another run's folder replaces it: quick stop with this cause, 0 bytes written into it"
    )


@pytest.mark.parametrize(
    ("disturb", "became"),
    [
        (lambda path: path.unlink(), "was deleted while it was being written"),
        (lambda path: os.truncate(path, 10), "was cut while it was being written: "),
        (lambda path: path.rename(f"{path}.moved"), "was moved away while it was being written"),
        (
            lambda path: (path.rename(f"{path}.moved"), path.write_text("x")),
            "was replaced by another file while it was being written",
        ),
    ],
)
def test_a_journal_detects_a_change_of_its_file(
    tmp_path: Path, disturb: Callable[[Path], object], became: str
) -> None:
    path = tmp_path / RECORDING
    header = JournalHeader(joint_names=("a",), sample_period_s=0.008)
    with JournalWriter(path, header) as writer:
        writer.flush()
        assert writer.trouble == ""
        disturb(path)
        assert writer.trouble.startswith(became)


def test_a_recorder_that_requests_a_stop_gives_the_reason() -> None:
    control = ControlBlock.create()
    control.recorder.end(RecordingError("recording.mcap: was deleted while it was being written"))
    assert control.recorder.state is RecorderState.ENDING
    assert str(control.recorder.error) == "recording.mcap: was deleted while it was being written"
