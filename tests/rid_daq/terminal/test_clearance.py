from __future__ import annotations

import io

import pytest
import typer

from config.errors import PreflightError
from rid_daq.terminal.clearance import asked


def test_a_question_stands_beside_what_programs_read(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    assert asked(typer.confirm, "Attached?")
    captured = capsys.readouterr()
    assert captured.err.startswith("Attached?")
    assert captured.out.strip() == ""


def test_no_answer_is_a_refusal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    with pytest.raises(PreflightError, match="nobody answered: nothing more is moved"):
        asked(typer.prompt, "The cell's name")
