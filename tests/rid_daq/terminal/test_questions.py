from __future__ import annotations

import io

import pytest

from config.errors import ConfigError, PreflightError
from config.load import load_cell
from rid_daq.terminal.clearance import require_cleared, require_yes
from rid_daq.terminal.console import Console
from tests.builders.raised_codes import raises_code


def test_a_question_is_written_to_stderr(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    assert Console().confirm("Attached?")
    captured = capsys.readouterr()
    assert captured.err.startswith("Attached?")
    assert captured.out.strip() == ""


def test_a_question_without_an_answer_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    with raises_code(PreflightError, "RID-ANSWER-NOBODY"):
        Console().ask("The cell's name", str)


def test_an_invalid_answer_repeats_the_question(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def number(text: str) -> int:
        if not text.isdigit():
            raise ConfigError("digits")
        return int(text)

    monkeypatch.setattr("sys.stdin", io.StringIO("two\n2\n"))
    assert Console().ask("How many?", number) == 2
    assert "digits" in capsys.readouterr().err


def test_clearing_a_cell_asks_for_its_name_and_the_emergency_stop(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = load_cell("ir361").config
    require_cleared(cell, cleared=False, context=Console())
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr(Console, "can_ask", True)
    monkeypatch.setattr("sys.stdin", io.StringIO("ir361\ny\n"))
    require_cleared(cell, cleared=False, context=Console(), practise=True)
    captured = capsys.readouterr()
    assert captured.out.strip() == "The robot will move."
    first, second = "Is cell ir361 free of people?", "Is the emergency stop within reach?"
    assert 0 <= captured.err.index(first) < captured.err.index(second)
    for answers, detail in (("ir362\n", "'ir362'"), ("ir361\nn\n", "emergency")):
        monkeypatch.setattr("sys.stdin", io.StringIO(answers))
        with raises_code(PreflightError, "RID-ANSWER-NO", detail):
            require_cleared(cell, cleared=False, context=Console(), practise=True)


def test_a_real_cell_is_asked_about_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a terminal no question is possible: nothing moves without `--yes`."""
    real = load_cell("ir361").config.model_copy(update={"simulated": False})
    monkeypatch.setattr("sys.stdin", io.StringIO("ir361\ny\n"))
    with raises_code(PreflightError, "RID-ANSWER-NOBODY"):
        require_cleared(real, cleared=False, context=Console())
    require_cleared(real, cleared=True, context=Console())


def test_only_yes_continues(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Console, "can_ask", True)
    monkeypatch.setattr("sys.stdin", io.StringIO("n\ny\n"))
    with raises_code(PreflightError, "RID-ANSWER-NO"):
        require_yes(Console(), "Mounted?", answered=False)
    require_yes(Console(), "Mounted?", answered=False)
    monkeypatch.setattr(Console, "can_ask", False)
    with raises_code(PreflightError, "RID-ANSWER-NOBODY"):
        require_yes(Console(), "Mounted?", answered=False)
