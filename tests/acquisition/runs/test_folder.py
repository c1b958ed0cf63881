from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.runs.catalogue import (
    find_file_or_run,
    find_run,
    list_damaged_runs,
    list_runs,
    unlisted_folders,
)
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST, RunStatus
from acquisition.runs.run_id import RUN_ID, new_run_id
from config.errors import ConfigError, RecordingError
from tests.builders.raised_codes import raises_code

NOW_NS = 1_760_000_000_000_000_000


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return tmp_path / "runs"


@pytest.fixture
def folder(root: Path) -> RunFolder:
    return RunFolder.create(root, "first run", software={"rid-daq": "0.1.0"}, now_ns=NOW_NS)


@given(st.lists(st.integers(0, 2**48 * 10**6 - 1), min_size=2, max_size=5))
def test_ids_are_unique_and_sorted_by_time(times_ns: list[int]) -> None:
    ids = [new_run_id(time_ns) for time_ns in times_ns]
    assert all(RUN_ID.fullmatch(run_id) for run_id in ids)
    assert len(set(ids)) == len(ids)
    order = sorted(range(len(ids)), key=lambda i: ids[i])
    milliseconds = [times_ns[i] // 10**6 for i in order]
    assert milliseconds == sorted(milliseconds)


def test_a_new_run_has_a_manifest_with_its_kind(folder: RunFolder, root: Path) -> None:
    manifest = folder.manifest()
    assert folder.path == root.resolve() / folder.run_id
    assert (manifest.label, manifest.kind, manifest.status) == ("first run", "record", "unfinished")
    assert manifest.created_utc == "2025-10-09T08:53:20.000+00:00"
    assert manifest.software == {"rid-daq": "0.1.0"}


@pytest.mark.parametrize("label", ["", "a" * 65, "a/b", "..\n", "a\n", "<b>", "a\x1b[0m", "é" * 65])
def test_a_label_is_plain_text(root: Path, label: str) -> None:
    with raises_code(ConfigError, "RID-FILE-NAME", "label"):
        RunFolder.create(root, label)
    assert not root.exists()


@pytest.mark.parametrize("label", ["a", "..", "Prüfung 3_b-2.1", "x" * 64])
def test_a_label_is_never_part_of_a_path(root: Path, label: str) -> None:
    folder = RunFolder.create(root, label)
    assert [path.name for path in root.iterdir()] == [folder.run_id]


def test_files_are_written_completely_and_listed(folder: RunFolder) -> None:
    folder.write("cell.yaml", b"old")
    path = folder.write("cell.yaml", b"name: a\n")
    folder.write("figures/torque.svg", b"<svg/>")
    assert path.read_bytes() == folder.read("cell.yaml") == b"name: a\n"
    entry = folder.manifest().files["cell.yaml"]
    assert entry.sha256 == hashlib.sha256(b"name: a\n").hexdigest()
    assert entry.size_bytes == 8
    assert sorted(path.name for path in folder.path.rglob("*.tmp")) == []


@pytest.mark.parametrize(
    "name",
    ["", "..", "../x", "/etc/passwd", "a//b", "a/../b", "x\n", ".hidden", "a\0", "nul", "COM1.txt",
     "a b", "trailing.", MANIFEST],
)  # fmt: skip
def test_a_name_outside_the_folder_is_refused(folder: RunFolder, name: str) -> None:
    with pytest.raises(ConfigError):
        folder.write(name, b"x")


def test_a_link_in_the_folder_is_refused(folder: RunFolder, tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "secret").write_bytes(b"secret")
    (folder.path / "link").symlink_to(outside / "secret")
    (folder.path / "dir").symlink_to(outside)
    for name in ("link", "dir/secret"):
        with raises_code(RecordingError, "RID-RUN-LINK"):
            folder.read(name)
        with raises_code(RecordingError, "RID-RUN-LINK"):
            folder.write(name, b"x")
    assert folder.finish(RunStatus.COMPLETE).files == {}
    assert folder.strays() == ("dir", "link")
    assert (outside / "secret").read_bytes() == b"secret"


def test_a_link_in_place_of_the_temporary_file_is_replaced_and_not_followed(
    folder: RunFolder, tmp_path: Path
) -> None:
    outside = tmp_path / "outside"
    outside.write_bytes(b"untouched")
    (folder.path / "a.txt.tmp").symlink_to(outside)
    folder.write("a.txt", b"x")
    assert outside.read_bytes() == b"untouched"
    assert folder.read("a.txt") == b"x"


def test_a_finished_run_lists_every_file_and_verifies(folder: RunFolder) -> None:
    folder.write("cell.yaml", b"a")
    (folder.path / "recording.mcap").write_bytes(b"rows")
    assert folder.verify() == (
        "the run is not finished: it is still running, or its program was killed",
    )
    manifest = folder.finish(RunStatus.COMPLETE, {"rows": 12})
    assert set(manifest.files) == {"cell.yaml", "recording.mcap"}
    assert manifest.facts == {"rows": 12}
    assert manifest.finished_utc is not None
    assert folder.verify() == ()


def test_verify_finds_changed_missing_and_unlisted_files(
    folder: RunFolder,
) -> None:
    for name in ("a.txt", "b.txt"):
        folder.write(name, b"x")
    folder.finish(RunStatus.STOPPED)
    (folder.path / "a.txt").write_bytes(b"y")
    (folder.path / "b.txt").unlink()
    (folder.path / "c.txt").write_bytes(b"z")
    problems = folder.verify()
    assert len(problems) == 2
    assert problems[0] == "a.txt: the file has changed since it was written (its SHA-256 differs)"
    assert problems[1].startswith("b.txt:")
    assert folder.strays() == ("c.txt",)


def test_a_file_changed_after_its_writing_keeps_its_first_hash(
    folder: RunFolder,
) -> None:
    folder.write("robot.yaml", b"gear 121")
    (folder.path / "robot.yaml").write_bytes(b"gear 60")
    folder.finish(RunStatus.COMPLETE)
    assert folder.verify() == (
        "robot.yaml: the file has changed since it was written (its SHA-256 differs)",
    )
    assert set(folder.find_changes(["robot.yaml", "cell.yaml"])) == {"robot.yaml"}
    with raises_code(RecordingError, "RID-RUN-CHANGED"):
        folder.read("robot.yaml")


def test_later_steps_can_add_results(folder: RunFolder) -> None:
    folder.finish(RunStatus.COMPLETE)
    folder.write("result.json", b"{}")
    assert folder.verify() == ()
    assert folder.manifest().status == RunStatus.COMPLETE


def test_a_run_without_listed_files_is_not_verified(folder: RunFolder) -> None:
    folder.finish(RunStatus.COMPLETE)
    assert len(folder.verify()) == 1


def test_a_recording_without_an_entry_is_a_problem(folder: RunFolder) -> None:
    folder.write("cell.yaml", b"a")
    folder.finish(RunStatus.STOPPED)
    (folder.path / "recording.mcap").write_bytes(b"rows")
    (folder.path / "notes.txt").write_bytes(b"cold morning")
    (problem,) = folder.verify(["recording.mcap", "cell.yaml", "motion.yaml"])
    assert problem.startswith("recording.mcap:")


def test_a_moved_run_can_be_opened(folder: RunFolder, tmp_path: Path) -> None:
    folder.write("cell.yaml", b"a")
    folder.finish(RunStatus.COMPLETE)
    moved = folder.path.rename(tmp_path / "from a colleague")
    opened = RunFolder.open(moved)
    assert opened.run_id == folder.run_id
    assert opened.verify() == ()


@pytest.mark.parametrize(
    ("text", "key"),
    [("", ""), ("[]", ""), ("{", ""), ('{"format": 99}', " run_id "), ("not json \x00", "")],
)
def test_a_damaged_manifest_is_a_clear_error(folder: RunFolder, text: str, key: str) -> None:
    (folder.path / MANIFEST).write_text(text)
    where = f"{folder.path / MANIFEST}: "
    with raises_code(RecordingError, "RID-RUN-DAMAGED", where, key):
        RunFolder.open(folder.path)


@pytest.mark.parametrize("other", [1, 3])
def test_another_format_is_refused(folder: RunFolder, other: int) -> None:
    manifest = json.loads((folder.path / MANIFEST).read_text())
    (folder.path / MANIFEST).write_text(json.dumps({**manifest, "format": other}))
    with raises_code(RecordingError, "RID-FILE-FORMAT", f"format {other}"):
        folder.manifest()


def test_a_manifest_that_is_a_link_or_pipe_is_refused(folder: RunFolder, tmp_path: Path) -> None:
    path = folder.path / MANIFEST
    target = path.rename(tmp_path / "elsewhere.json")
    path.symlink_to(target)
    with raises_code(RecordingError, "RID-RUN-DAMAGED"):
        folder.manifest()


def test_a_folder_that_is_not_a_run_is_refused(tmp_path: Path) -> None:
    with raises_code(RecordingError, "RID-RUN-DAMAGED"):
        RunFolder.open(tmp_path)


def test_runs_are_listed_by_time_without_other_folders(root: Path, tmp_path: Path) -> None:
    runs = [RunFolder.create(root, f"run {i}", now_ns=NOW_NS + i * 10**9) for i in (0, 1, 2)]
    (root / "notes").mkdir()
    (root / new_run_id(NOW_NS)).mkdir()
    (root / new_run_id(NOW_NS)).symlink_to(runs[0].path)
    assert [manifest.label for _, manifest in list_runs(root)] == ["run 0", "run 1", "run 2"]
    assert list_runs(tmp_path / "none") == ()


def test_a_run_is_found_by_start_of_id_label_path_or_latest(root: Path) -> None:
    first = RunFolder.create(root, "slow", now_ns=NOW_NS)
    last = RunFolder.create(root, "fast", now_ns=NOW_NS + 10**15)
    assert find_run(root, "latest") == last
    assert find_run(root, "slow") == first
    assert find_run(root, first.run_id) == first
    assert find_run(root, first.run_id[:14].lower()) == first
    assert find_run(root, str(last.path)) == last


@pytest.mark.parametrize(
    ("reference", "code"),
    [
        ("0", "RID-RUN-AMBIGUOUS"),
        ("none", "RID-RUN-UNKNOWN"),
        ("", "RID-RUN-UNKNOWN"),
        ("../..", "RID-RUN-UNKNOWN"),
    ],
)
def test_an_ambiguous_or_unknown_reference_is_refused(
    root: Path, reference: str, code: str
) -> None:
    for _ in range(2):
        RunFolder.create(root, "same", now_ns=NOW_NS)
    with raises_code(ConfigError, code, repr(reference)):
        find_run(root, reference)


def test_a_label_of_several_runs_means_the_newest_and_the_dates_are_reported(
    root: Path, caplog: pytest.LogCaptureFixture
) -> None:
    old, new = (RunFolder.create(root, "same", now_ns=NOW_NS + i * 10**14) for i in range(2))
    RunFolder.create(root, "other", now_ns=NOW_NS + 10**15)
    assert find_run(root, "same") == new
    (message,) = caplog.messages
    assert message.startswith("2 runs have the label 'same': using the newest, " + new.run_id)
    assert f"older: {old.run_id} ({old.manifest().created_utc[:10]} " in message


def test_an_id_start_of_several_runs_is_refused_with_their_dates(root: Path) -> None:
    first = RunFolder.create(root, "a", now_ns=NOW_NS)
    RunFolder.create(root, "b", now_ns=NOW_NS + 10**9)
    created = first.manifest().created_utc[:10]
    with raises_code(ConfigError, "RID-RUN-AMBIGUOUS", f"{first.run_id} ({created} "):
        find_run(root, first.run_id[:4])


def test_latest_means_the_latest_run_with_the_required_file(root: Path) -> None:
    with_file = RunFolder.create(root, "same", now_ns=NOW_NS)
    with_file.write("payload.json", b"{}")
    RunFolder.create(root, "same", now_ns=NOW_NS + 10**15)
    assert find_run(root, "latest", having=("payload.json",)) == with_file
    assert find_run(root, "same", having=("payload.json",)) == with_file
    with raises_code(ConfigError, "RID-RUN-UNKNOWN", "session.json", "'latest'"):
        find_run(root, "latest", having=("session.json",))


def test_an_existing_file_is_a_file_and_anything_else_is_a_run(root: Path, tmp_path: Path) -> None:
    made = RunFolder.create(root, "arm v1.json")
    assert find_file_or_run(root, "arm v1.json") == made
    file = tmp_path / "model"
    file.touch()
    assert find_file_or_run(root, str(file)) == file
    with raises_code(ConfigError, "RID-RUN-UNKNOWN", "x.json: ", "'x.json'"):
        find_file_or_run(root, "x.json")


def test_a_run_with_a_damaged_manifest_is_reported_and_not_skipped(
    root: Path, folder: RunFolder
) -> None:
    later = RunFolder.create(root, "second", now_ns=NOW_NS + 10**9)
    (later.path / MANIFEST).write_text('{"la')
    ((damaged, problem),) = list_damaged_runs(root)
    assert damaged.path == later.path
    assert MANIFEST in str(problem)
    assert [found.run_id for found, _ in list_runs(root)] == [folder.run_id]
    with raises_code(RecordingError, "RID-RUN-DAMAGED"):
        find_run(root, "latest")


def test_a_copied_or_renamed_run_folder_is_reported_and_not_skipped(
    root: Path, folder: RunFolder
) -> None:
    other = RunFolder.create(root, "second", now_ns=NOW_NS + 10**9)
    copy, renamed, link = root / other.run_id, root / "friday", root / "link"
    shutil.move(copy, renamed)
    shutil.copytree(folder.path, copy)
    link.symlink_to(renamed)
    ((damaged, problem),) = list_damaged_runs(root)
    assert damaged.path == copy
    assert folder.run_id in str(problem)
    assert unlisted_folders(root) == ("friday", "link")
    assert [found.run_id for found, _ in list_runs(root)] == [folder.run_id]


def test_a_lost_disk_is_a_typed_error(folder: RunFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(path: Path) -> bool:
        raise OSError(errno.EIO, os.strerror(errno.EIO), str(path))

    monkeypatch.setattr(Path, "is_symlink", gone)
    with raises_code(RecordingError, "RID-FILE-READ", "recording.mcap", "Input/output"):
        folder.file("recording.mcap")
    folder.path.joinpath("recording.mcap").touch()
    with raises_code(RecordingError, "RID-FILE-READ", "recording.mcap", "Input/output"):
        folder.finish(RunStatus.STOPPED)


def test_another_run_in_place_of_the_folder_is_not_written_to(
    root: Path, folder: RunFolder
) -> None:
    other = RunFolder.create(root, "second run")
    folder.path.rename(root / "moved")
    other.path.rename(folder.path)
    with raises_code(RecordingError, "RID-RUN-REPLACED", folder.run_id, other.run_id):
        folder.finish(RunStatus.COMPLETE)
    assert RunFolder.open(root / "moved").manifest().status == RunStatus.UNFINISHED
