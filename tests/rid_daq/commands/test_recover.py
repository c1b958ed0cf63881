"""`rid-daq recover` on killed, damaged and complete run folders, and on single files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import JournalWriter, read_journal
from acquisition.journal.header import JournalHeader
from acquisition.runs.catalogue import find_run
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.load import load_cell
from rid_daq.app import run
from rid_daq.runs.run_data import ONLINE_MODEL, RunData
from tests.builders.console_blocks import assert_shown
from tests.builders.json_output import document

ROWS = 1000
HALF = 400


def write_journal(folder: RunFolder, *, close: bool) -> None:
    rows = np.zeros(ROWS, dtype=row_dtype(3))
    rows["time_s"] = np.arange(ROWS) * 0.008
    rows["cycle"] = rows["sample_index"] = np.arange(ROWS)
    rows["position"] = rows["cycle"][:, np.newaxis]
    rows["valid"] = 1
    header = JournalHeader(
        joint_names=("axis1", "axis2", "axis3"), sample_period_s=0.008, run_id=folder.run_id
    )
    with JournalWriter(folder.file("recording.mcap"), header) as writer:
        for start in range(0, ROWS, 10):
            writer.append(rows[start : start + 10].tobytes())
            writer.flush()
        if not close:
            writer.abandon()


@pytest.fixture
def killed(tmp_path: Path) -> RunFolder:
    """Return the run folder of a killed program."""
    folder = RunFolder.create(tmp_path / "runs", "swing", software={"rid-daq": "0"})
    for name, content in load_cell("ir361").files.items():
        folder.write(name, content)
    write_journal(folder, close=False)
    return folder


@pytest.fixture
def runs(killed: RunFolder) -> list[str]:
    return ["--runs", str(killed.path.parent)]


def file_contents(folder: RunFolder) -> dict[str, bytes]:
    return {str(p): p.read_bytes() for p in folder.path.rglob("*") if p.is_file()}


def flip_bit(path: Path, at: int) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= 0x10
    path.write_bytes(data)


def test_a_killed_run_is_recovered_into_a_new_run_folder(
    killed: RunFolder, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    before = file_contents(killed)
    assert run(["recover", "swing", *runs, "--json"]) == 0
    result = document(capsys)
    new = RunFolder.open(Path(result["recovered"]))
    assert file_contents(killed) == before
    assert new.path.parent == killed.path.parent
    assert new.verify() == ()
    manifest = new.manifest()
    assert (manifest.label, manifest.status) == ("swing", RunStatus.RECOVERED)
    assert manifest.facts == {"recovered_from": killed.run_id, "rows": ROWS, "rows_lost": 0}
    data = RunData.load(new)
    assert data.damage == ()
    assert len(data.recording) == ROWS
    assert data.recording.run_id == new.run_id
    assert find_run(killed.path.parent, "latest").run_id == new.run_id


def test_a_recovered_streamed_run_is_still_a_streamed_run(
    killed: RunFolder, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    killed.write(ONLINE_MODEL, b"{}")
    killed.write("result.json", b"{}")
    assert run(["recover", "swing", *runs, "--json"]) == 0
    new = RunFolder.open(Path(document(capsys)["recovered"]))
    assert new.file(ONLINE_MODEL).read_bytes() == b"{}"
    assert not new.file("result.json").exists()


def test_lost_rows_are_reported_with_their_time_and_an_exit_code(
    killed: RunFolder, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = killed.file("recording.mcap")
    flip_bit(path, path.stat().st_size // 2)
    assert run(["recover", killed.run_id, *runs]) == 1
    output = capsys.readouterr().out
    assert_shown("run-folders", "rid-daq recover RUN", output, same_numbers=False)
    new = find_run(killed.path.parent, "latest")
    data = RunData.load(new)
    assert len(data.recording) == 990
    assert any("are lost (10 rows)" in note for note in data.damage)


def test_a_file_with_a_wrong_hash_is_not_copied(
    killed: RunFolder, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    flip_bit(killed.file("robot.yaml"), 300)
    assert run(["recover", killed.run_id, *runs, "--json"]) == 0
    result = document(capsys)
    assert any("robot.yaml: its SHA-256 differs" in note for note in result["notes"])
    new = RunFolder.open(Path(result["recovered"]))
    assert not new.file("robot.yaml").exists()
    assert new.file("cell.yaml").exists()


@pytest.mark.parametrize("damage", ["missing", "torn", "not a manifest"])
def test_a_run_without_a_manifest_is_recovered(
    killed: RunFolder, damage: str, capsys: pytest.CaptureFixture[str]
) -> None:
    manifest = killed.path / "manifest.json"
    text = manifest.read_bytes()
    manifest.unlink()
    if damage != "missing":
        manifest.write_bytes(text[:40] if damage == "torn" else b"[]")
    assert run(["recover", str(killed.path), "--json"]) == 0
    result = document(capsys)
    assert any("cannot be verified" in note for note in result["notes"])
    new = RunFolder.open(Path(result["recovered"]))
    assert new.manifest().label == killed.path.name
    assert len(RunData.load(new).recording) == ROWS


def test_links_and_strange_names_in_a_run_folder_are_not_followed(
    killed: RunFolder, runs: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    secret = tmp_path / "secret"
    secret.write_text("secret")
    (killed.path / "notes.txt").symlink_to(secret)
    (killed.path / "away").symlink_to(tmp_path)
    (killed.path / "a\x1b[2Jb").write_text("x")
    assert run(["recover", killed.run_id, *runs]) == 0
    output = capsys.readouterr().out
    assert "symbolic link" in output
    assert "\x1b" not in output
    new = find_run(killed.path.parent, "latest")
    assert not any(path.is_symlink() for path in new.path.rglob("*"))
    assert not any(b"secret" in content for content in file_contents(new).values())


def test_a_complete_run_is_not_recovered(
    tmp_path: Path, killed: RunFolder, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    killed.file("recording.mcap").unlink()
    write_journal(killed, close=True)
    killed.finish(RunStatus.COMPLETE)
    assert run(["recover", killed.run_id, *runs, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["recovered"] is None
    assert len(list(killed.path.parent.iterdir())) == 1


def test_a_run_without_readable_rows_makes_no_folder(
    killed: RunFolder, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    killed.file("recording.mcap").write_bytes(bytes(5000))
    assert run(["recover", killed.run_id, *runs]) == 7
    assert "RID-RECORDING-EMPTY" in capsys.readouterr().err
    assert len(list(killed.path.parent.iterdir())) == 1


def test_a_recording_in_progress_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = RunFolder.create(tmp_path / "runs", "now")
    header = JournalHeader(joint_names=("a",), sample_period_s=0.008)
    with JournalWriter(folder.file("recording.mcap"), header):
        assert run(["recover", str(folder.path)]) == 8
        assert run(["recover", str(folder.file("recording.mcap"))]) == 8
    assert "RID-RUN-OPEN" in capsys.readouterr().err


def test_a_single_file_is_recovered_into_a_new_file(
    killed: RunFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(killed.file("recording.mcap").read_bytes()[: -HALF * 230])
    assert run(["recover", str(torn)]) == 0
    new = tmp_path / "torn-recovered.mcap"
    kept = len(read_journal(new).rows)
    assert HALF < kept < ROWS
    assert run(["recover", str(torn)]) == 7
    assert "RID-OUTPUT-EXISTS" in capsys.readouterr().err
    assert run(["recover", str(torn), "-o", str(tmp_path / "other.mcap")]) == 0
    assert (tmp_path / "other.mcap").read_bytes() == new.read_bytes()
    assert not list(tmp_path.glob("*.tmp"))


@pytest.mark.parametrize(
    ("what", "exit_code", "code"),
    [
        ("nowhere.mcap", 7, "RID-FILE-UNKNOWN"),
        ("no-such-run", 2, "RID-RUN-UNKNOWN"),
        ("", 2, "RID-RUN-UNKNOWN"),
    ],
)
def test_a_run_or_file_that_does_not_exist_is_named(
    what: str, exit_code: int, code: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["recover", what, "--runs", str(tmp_path)]) == exit_code
    assert f"[{code}]" in capsys.readouterr().err
