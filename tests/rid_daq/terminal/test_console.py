from __future__ import annotations

import json
from pathlib import Path

import pytest

from acquisition.runs.catalogue import list_runs
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from rid_daq.app import run
from rid_daq.terminal.console import Console
from tests.builders.screens import screen_lines, terminal


def test_a_pipe_gets_plain_text_without_escapes(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console()
    console.table(("axis", "error"), [("axis1", "0.9 N m"), ("a", "12 N m")], red=[True, False])
    console.verdict(False, "Failed: axis1")
    assert capsys.readouterr().out == "axis   error\naxis1  0.9 N m\na      12 N m\nFailed: axis1\n"


def test_json_output_is_exactly_one_document(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(as_json=True)
    console.say("for people")
    console.table(("a",), [("b",)])
    console.verdict(True, "for people")
    with console.progress("recording", 10.0, "periods") as progress:
        progress.update(5.0, "measuring")
    console.document({"rows": 3, "unit": "N·m"})
    assert json.loads(capsys.readouterr().out) == {"rows": 3, "unit": "N·m"}


def test_a_non_finite_number_in_json_output_is_an_internal_error(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(ValueError, match="JSON"):
        Console(as_json=True).document({"error": float("nan")})


def test_progress_in_a_log_file_is_one_line_per_tenth(capsys: pytest.CaptureFixture[str]) -> None:
    with Console().progress("recording", 20.0, "periods") as progress:
        for done in range(200):
            progress.update(done / 10.0, "measuring")
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 9
    assert lines[0] == "recording: 2 of 20 periods  measuring"


def test_messages_during_a_progress_bar_appear_above_it() -> None:
    console = Console()
    with terminal(80) as shown, console.progress("recording", 20.0, "periods") as progress:
        progress.update(5.0, "measuring")
        console.say("[1] Ready: hold the key.")
        console.verdict(False, "Too warm.")
        console.table(("axis", "error"), [("axis1", "0.9 N m")])
    lines = [plain.rstrip() for plain in screen_lines(shown.getvalue())]
    assert lines[:4] == ["[1] Ready: hold the key.", "Too warm.", "axis   error", "axis1  0.9 N m"]
    assert lines[4].startswith("recording ━")
    assert lines[4].endswith("5/20 periods -:--:-- measuring")
    with terminal(80) as shown:
        console.say("Done.")
    assert shown.getvalue() == "Done.\n"


HOSTILE = "evil\x1b]0;title\x07\x9b2J\u202etxt"


def test_texts_of_files_and_devices_cannot_control_the_terminal(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Console().say(HOSTILE)
    Console().verdict(True, HOSTILE)
    Console().table(("a", "b"), [(HOSTILE, "two\nlines"), ("x", "y")])
    Console(as_json=True).document({"label": HOSTILE})
    out = capsys.readouterr().out
    assert all(c.isprintable() or c == "\n" for c in out)
    assert "two\\nlines" in out
    document = json.loads(out[out.index("{") :])
    assert document == {"label": HOSTILE}


def test_a_foreign_run_folder_cannot_control_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = RunFolder.create(tmp_path, "fine")
    manifest = folder.path / "manifest.json"
    document = json.loads(manifest.read_text())
    document |= {"label": HOSTILE, "kind": HOSTILE, "facts": {HOSTILE: HOSTILE}}
    document["files"] = {"../../" + HOSTILE: {"sha256": "", "size_bytes": 0}}
    manifest.write_text(json.dumps(document))
    run(["runs", "--verify", "--runs", str(tmp_path)])
    run(["recover", str(folder.path)])
    captured = capsys.readouterr()
    for text in (captured.out, captured.err):
        assert text
        assert all(c.isprintable() or c == "\n" for c in text)


def test_on_a_narrow_terminal_ids_and_texts_are_complete(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Console, "is_terminal", True)
    monkeypatch.setenv("COLUMNS", "60")
    run_id, label = "01KAM9Y2Q3Z7XW5V8T6S4R2P1N", "a-label-longer-than-its-column"
    Console().table(("run", "label", "more"), [(run_id, label, "robot ir361, rows 12345")])
    shown = capsys.readouterr().out
    assert run_id in shown
    column = "".join(line[28:44].strip() for line in shown.splitlines()[1:])
    assert label in column
    assert "…" not in shown


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """Return a folder of two runs with the same label and with facts in their manifests."""
    for number in range(2):
        made = RunFolder.create(tmp_path / "runs", "a long label", kind="payload session")
        made.finish(RunStatus.COMPLETE, {"robot": "ir361", "rows": 1000 * number, "axis_test": "?"})
    return tmp_path / "runs"


def test_the_list_of_runs_fits_eighty_columns(
    runs: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Console, "is_terminal", True)
    monkeypatch.setenv("COLUMNS", "80")
    assert run(["runs", "--runs", str(runs)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert len([line for line in lines if line.startswith("0")]) == 2
    assert "robot ir361" not in "".join(lines)
    monkeypatch.setenv("COLUMNS", "140")
    assert run(["runs", "--runs", str(runs)]) == 0
    assert "1000" in capsys.readouterr().out


def test_verify_ends_with_a_verdict_and_an_exit_code(
    runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made, other = (path for path, _ in list_runs(runs))
    for each in (made, other):
        each.write("motion.yaml", b"kind: fourier")
        each.finish(RunStatus.COMPLETE, {})
    assert run(["runs", "--verify", "--runs", str(runs)]) == 0
    assert capsys.readouterr().out.endswith("Unchanged runs: 2 of 2.\n")
    made.file("motion.yaml").write_text("kind: circle")
    assert run(["runs", "--verify", "--runs", str(runs)]) == 7
    captured = capsys.readouterr()
    assert captured.out.endswith("Unchanged runs: 1 of 2.\n")
    assert "motion.yaml" in captured.err
