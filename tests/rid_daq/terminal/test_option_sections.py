from __future__ import annotations

from pathlib import Path

import pytest

from rid_daq.app import run
from rid_daq.command_line.root import COMMAND_GROUPS
from rid_daq.terminal.option_sections import SHARED

REFERENCE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "command-line.md"


def test_many_options_are_shown_in_sections_each_of_them_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["stream", "--help"]) == 0
    shown = capsys.readouterr().out
    own, simulated, before, files = (
        shown.index(f"\n{title}:\n")
        for title in ("Options", "Simulated cells", "Before it moves", "Files and services")
    )
    assert own < simulated < before < files
    assert own < shown.index("  --model ") < simulated < shown.index("  --pace ") < before
    assert files < shown.index("  --runs ") < shown.index("  --json ") < shown.index("  --help ")
    assert "Live page:" not in shown


def test_every_option_that_stands_in_a_section_is_one_of_the_program() -> None:
    page = REFERENCE.read_text(encoding="utf-8")
    names = [name for section in SHARED.values() for name in section]
    assert len(names) == len(set(names))
    assert [name for name in names if f"{name} " not in page] == []


def test_the_help_shows_commands_in_groups(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"]) == 0
    shown = capsys.readouterr().out
    for title, commands in COMMAND_GROUPS.items():
        group = shown[shown.index(f"\n{title}:\n") :].split("\n\n")[0]
        assert [name for name in commands if f"\n  {name} " not in group] == []
    assert max(map(len, shown.splitlines())) <= 80


def test_a_payload_session_is_named_where_payloads_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["payload", "--help"]) == 0
    assert "rid-daq payload CELL" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--pace", "soon"], "'--pace': it should be a number"),
        (["--periods", "1.5"], "'--periods': it should be a whole number"),
        (["--periods", "1"], "'--periods': it should be at least 2"),
    ],
)
def test_a_value_that_is_refused_is_told_in_plain_words(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["payload", "session", "ir361", *words]) == 2
    assert f"Invalid value for {said}" in capsys.readouterr().err
