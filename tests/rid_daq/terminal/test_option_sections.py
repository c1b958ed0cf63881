from __future__ import annotations

import pytest

from rid_daq.app import run
from rid_daq.command_line.root import COMMAND_GROUPS


def test_each_option_is_shown_once_in_a_section(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["stream", "--help"]) == 0
    shown = capsys.readouterr().out
    general, simulated, before, files = (
        shown.index(f"\n{title}:\n")
        for title in ("Options", "Simulated cells", "Before it moves", "Files and services")
    )
    assert general < simulated < before < files
    assert general < shown.index("  --model ") < simulated < shown.index("  --pace ") < before
    assert files < shown.index("  --runs ") < shown.index("  --json ") < shown.index("  --help ")
    assert "Live page:" not in shown


def test_the_help_shows_commands_in_groups(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"]) == 0
    shown = capsys.readouterr().out
    for title, commands in COMMAND_GROUPS.items():
        group = shown[shown.index(f"\n{title}:\n") :].split("\n\n")[0]
        assert [name for name in commands if f"\n  {name} " not in group] == []
    assert max(map(len, shown.splitlines())) <= 80


def test_the_help_of_payload_names_the_session(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["payload", "--help"]) == 0
    assert "CELL" in capsys.readouterr().out
