from __future__ import annotations

import json

import pytest

from rid_daq.console import Console


def test_a_pipe_gets_plain_text_without_escapes(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console()
    console.table(("axis", "error"), [("axis1", "0.9 N m"), ("a", "12 N m")], red=[True, False])
    console.verdict(False, "Failed: axis1")
    assert capsys.readouterr().out == "axis   error\naxis1  0.9 N m\na      12 N m\nFailed: axis1\n"


def test_json_is_one_document_and_nothing_else(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(as_json=True)
    console.say("for people")
    console.table(("a",), [("b",)])
    console.verdict(True, "for people")
    with console.progress("recording", 10.0, "periods") as progress:
        progress.update(5.0, "measuring")
    console.document({"rows": 3, "unit": "N·m"})
    assert json.loads(capsys.readouterr().out) == {"rows": 3, "unit": "N·m"}


def test_a_number_that_json_does_not_have_is_a_bug_not_a_file(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(ValueError, match="JSON"):
        Console(as_json=True).document({"error": float("nan")})


def test_progress_in_a_log_file_is_a_line_a_tenth(capsys: pytest.CaptureFixture[str]) -> None:
    with Console().progress("recording", 20.0, "periods") as progress:
        for done in range(200):
            progress.update(done / 10.0, "measuring")
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 9
    assert lines[0] == "recording: 2 of 20 periods  measuring"
