from __future__ import annotations

import io

import pytest

from config.errors import ConfigError, PreflightError
from rid_daq.terminal.console import Console


def test_a_question_stands_beside_what_programs_read(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    assert Console().confirm("Attached?")
    captured = capsys.readouterr()
    assert captured.err.startswith("Attached?")
    assert captured.out.strip() == ""


def test_no_answer_is_a_refusal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    with pytest.raises(PreflightError, match="nobody answered: nothing more is moved"):
        Console().ask("The cell's name", str)


def test_an_answer_that_means_nothing_is_asked_for_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def number(text: str) -> int:
        if not text.isdigit():
            raise ConfigError("give a number")
        return int(text)

    monkeypatch.setattr("sys.stdin", io.StringIO("two\n2\n"))
    assert Console().ask("How many?", number) == 2
    assert "give a number" in capsys.readouterr().err
