"""If the output or the result cannot be written, the motion and its outcome are still complete."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from acquisition.runs.folder import RunFolder
from acquisition.session.record import record_motion
from config.errors import RecordingError
from rid_daq.app import run
from rid_daq.terminal.console import output_error

pytestmark = pytest.mark.slow

NOTE = "the drives of axis2 did not confirm being disabled"


@pytest.fixture
def unwritable_result(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the writing of results fail after a motion with a warning about the drives."""

    def refuse(folder: RunFolder, _result: dict[str, Any]) -> Path:
        raise RecordingError(f"{folder.path}/result.json: cannot be written: Input/output error")

    whole = record_motion

    def with_note(*arguments: Any, **options: Any) -> Any:
        return replace(whole(*arguments, **options), notes=(NOTE,))

    monkeypatch.setattr("rid_daq.recording.run_session.write_result", refuse)
    monkeypatch.setattr("rid_daq.recording.run_session.record_motion", with_note)


def test_a_motion_continues_if_the_output_cannot_be_written(
    workshop: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = [str(workshop / "cell.yaml"), str(workshop / "validation.yaml")]
    monkeypatch.setattr("rid_daq.terminal.console._output.refused", None)
    with (
        contextlib.suppress(OSError),  # closing the file also fails
        open("/dev/full", "w") as full,
        monkeypatch.context() as swapped,
    ):
        swapped.setattr("sys.stdout", full)
        code = run(["record", *files, "--runs", str(tmp_path)])
    assert code == 0
    assert output_error() is not None
    (path,) = tmp_path.iterdir()
    assert RunFolder.open(path).manifest().status == "complete"
    assert (path / "report.html").exists()


@pytest.mark.parametrize(
    ("output", "code", "complains"),
    [
        ("| true", 0, ""),
        ("> /dev/full", 7, "rid-daq: cannot write to standard output: No space left on device\n"),
        (">&-", 0, ""),
    ],
)
def test_a_closed_output_is_not_an_error_and_a_full_disk_is_one(
    tmp_path: Path, output: str, code: int, complains: str
) -> None:
    words = f"set -o pipefail; {sys.executable} -m rid_daq runs --runs {tmp_path} {output}"
    done = subprocess.run(["bash", "-c", words], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (code, complains)


@pytest.mark.usefixtures("unwritable_result")
@pytest.mark.parametrize(
    ("option", "ended"),
    [
        ([], "The motion ended as planned. "),
        (
            ["--rehearse"],
            "The motion ended as planned. Only the rehearsal was performed, not the motion"
            " itself. ",
        ),
    ],
)
def test_an_unwritable_result_hides_neither_outcome_nor_warning(
    workshop: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    option: list[str],
    ended: str,
) -> None:
    files = [str(workshop / "cell.yaml"), str(workshop / "validation.yaml")]
    assert run(["record", *files, "--runs", str(tmp_path), *option]) == 7
    captured = capsys.readouterr()
    (path,) = tmp_path.iterdir()
    why = f"{ended}{path}/result.json: cannot be written: Input/output error"
    assert captured.err == f"rid-daq: {why}\n"
    assert f"note: {NOTE}\n" in captured.out
    manifest = RunFolder.open(path).manifest()
    assert (manifest.status, manifest.facts["why"]) == ("stopped", why)
