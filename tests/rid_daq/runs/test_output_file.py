"""Output files of commands: none can replace a part of a run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.errors import ConfigError, RecordingError
from rid_daq.app import run
from rid_daq.runs.made_file import EXPORT, LOOPS, MODEL, MOTION
from rid_daq.runs.output_file import refuse_output, register_output
from tests.builders.raised_codes import raises_code

PARTS = ("recording.mcap", "cell.yaml", "result.json", "report.html", "session.json", "drive.eds")


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    """Return a completed run that also contains a result with a user-defined name."""
    folder = RunFolder.create(tmp_path / "runs", "swing")
    for name in (*PARTS, "model.json", "own.json"):
        folder.write(name, name.encode())
    folder.finish(RunStatus.COMPLETE)
    return folder


@pytest.mark.parametrize("name", [*PARTS, "manifest.json", "map.yaml", "feedforward.json"])
def test_an_output_that_would_replace_a_part_of_a_run_is_refused(
    folder: RunFolder, name: str
) -> None:
    with raises_code(ConfigError, "RID-OUTPUT-RUN", f"{name}: ", folder.run_id):
        refuse_output(folder.path / name, overwrite=True, made=MOTION)


@pytest.mark.parametrize("name", ["model.json", "own.json", "new.json", "robot.urdf", "new.yaml"])
def test_results_can_be_written_into_a_run_folder(folder: RunFolder, name: str) -> None:
    (folder.path / name).write_text('{"kind": "rid-daq estimate"}')
    refuse_output(folder.path / name, overwrite=True, made=MODEL)


@pytest.mark.promise("own-outputs")
@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("cell4.pem", "-----BEGIN PRIVATE KEY-----\n"),
        ("data.csv", "time,torque\n"),
        ("notes.yaml", "of a colleague: yes\n"),
        ("mine.yaml", "# my own motion\nkind: fourier\n"),
        ("cell.yaml", "# written by rid-daq init\nname: cell\n"),
        ("payload.json", '{"kind": "rid-daq payload"}'),
    ],
)
def test_overwrite_refuses_files_of_another_kind(tmp_path: Path, name: str, content: str) -> None:
    (tmp_path / name).write_text(content)
    for made in (MOTION, MODEL, LOOPS, EXPORT):
        with pytest.raises(ConfigError) as refused:
            refuse_output(tmp_path / name, overwrite=True, made=made)
        assert refused.value.refusal == "RID-OUTPUT-FOREIGN"


@pytest.mark.parametrize(
    ("kind", "software"), [("estimate", "rid-daq 0.1.0"), ("payload", "rid-daq 0.1.0")]
)
def test_an_export_does_not_replace_a_model_or_a_payload(
    tmp_path: Path, kind: str, software: str
) -> None:
    path = tmp_path / "model.json"
    path.write_text(json.dumps({"kind": f"rid-daq {kind}", "software": software}, indent=1))
    with raises_code(ConfigError, "RID-OUTPUT-FOREIGN", str(path)):
        refuse_output(path, overwrite=True, made=EXPORT)
    path.write_text(json.dumps({"kind": "rid-daq parameters", "software": software}, indent=1))
    refuse_output(path, overwrite=True, made=EXPORT)


def test_overwrite_replaces_an_output_of_the_same_kind(tmp_path: Path) -> None:
    motion = tmp_path / "motion.yaml"
    motion.write_text("# For robot arm, verified within its limits at 4 ms.\n\nkind: fourier\n")
    refuse_output(motion, overwrite=True, made=MOTION)


def test_a_link_to_a_part_of_a_renamed_run_is_refused(folder: RunFolder, tmp_path: Path) -> None:
    renamed = folder.path.rename(tmp_path / "mine")
    (tmp_path / "link").symlink_to(renamed / "recording.mcap")
    with raises_code(ConfigError, "RID-OUTPUT-RUN", "link"):
        refuse_output(tmp_path / "link", overwrite=True, made=MOTION)


def test_with_a_damaged_manifest_parts_are_recognised_by_name(folder: RunFolder) -> None:
    (folder.path / "manifest.json").write_text("{")
    with raises_code(ConfigError, "RID-OUTPUT-RUN", "recording.mcap"):
        refuse_output(folder.path / "recording.mcap", overwrite=True, made=MOTION)


def test_a_foreign_manifest_does_not_make_a_run(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text("{}")
    refuse_output(tmp_path / "motion.yaml", overwrite=True, made=MOTION)


@pytest.mark.parametrize(
    "words",
    [
        "identify latest -o",
        "payload identify --loaded latest -o",
        "loop latest -o",
        "design ir361 -o",
        "export m.json --to c -o",
        "retime ir361 m.yaml --model m -o",
        "retime ir361 m.yaml --model m -o new.yaml --report",
        "compensate ir361 m.yaml --model m --loop l -o",
        "refine latest --model m --loop l -o",
        "sensitivity -o",
    ],
)
def test_every_command_refuses_a_part_of_a_run_as_output(
    words: str,
    folder: RunFolder,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder.path.parents[1])
    assert run([*words.split(), str(folder.file("recording.mcap")), "--overwrite"]) == 2
    error = capsys.readouterr().err
    assert "[RID-OUTPUT-RUN]" in error
    assert "recording.mcap: " in error
    assert folder.verify() == ()
    assert folder.read("recording.mcap") == b"recording.mcap"


def test_an_output_that_is_gone_before_it_is_registered_has_a_code(folder: RunFolder) -> None:
    with raises_code(RecordingError, "RID-FILE-READ", "lost.json"):
        register_output(folder, folder.path / "lost.json")
