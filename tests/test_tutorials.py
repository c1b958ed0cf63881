"""The commands of each tutorial, run in an empty folder, print what the tutorial shows.

A shell runs the commands of one tutorial. This process runs those of the others, and draws nothing
in their reports; that halves the CPU time.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from rid_daq.app import run
from rid_daq.terminal.exit_codes import ExitCode
from tests.builders.console_blocks import (
    ConsoleStep,
    console_steps,
    program_arguments,
    require_shown,
)

TUTORIALS = Path(__file__).resolve().parent.parent / "docs" / "tutorial"
IN_A_SHELL = "your-own-robot"
IN_THIS_PROCESS = ("first-hour", "accurate-path", "payload-day")


def files_of(page: Path) -> Iterator[tuple[str, str]]:
    """Yield each file that a page asks the reader to write; the comment at its top is its name."""
    text = page.read_text(encoding="utf-8")
    for block in re.findall(r"```(?:yaml|xml)\n(.*?)```", text, re.DOTALL):
        named = re.match(r"(?:# |<!-- )([\w.-]+)(?: -->)?\n", block)
        assert named, block
        yield named[1], block


def prepared(name: str, folder: Path) -> list[ConsoleStep]:
    """Write the files of a tutorial into a folder, and return its commands."""
    page = TUTORIALS / f"{name}.md"
    found = list(console_steps(page))
    assert len(found) >= 4
    for file, content in files_of(page):
        (folder / file).write_text(content, encoding="utf-8")
    return found


@pytest.mark.slow
def test_a_tutorial_shows_the_output_of_its_commands_in_a_shell(tmp_path: Path) -> None:
    bin_folder = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{bin_folder}:{os.environ['PATH']}", "COLUMNS": "200"}
    for step in prepared(IN_A_SHELL, tmp_path):
        done = subprocess.run(
            step.command,
            shell=True,
            cwd=tmp_path,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{step.place}: {step.command}\n{done.stdout}{done.stderr}"
        require_shown(step.shown, done.stdout, f"{step.place}: {step.command}")


@pytest.mark.long
@pytest.mark.usefixtures("plain_reports")
@pytest.mark.parametrize("name", IN_THIS_PROCESS)
def test_a_tutorial_shows_the_output_of_its_commands(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    for step in prepared(name, tmp_path):
        (words,) = program_arguments(step.command)
        assert step.command == shlex.join(["rid-daq", *words]).replace("'", '"')  # no shell syntax
        code, printed = run(words), capsys.readouterr()
        place = f"{step.place}: {step.command}"
        assert code == 0, f"{place}\n{printed.out}{printed.err}"
        require_shown(step.shown, printed.out, place)


def test_every_tutorial_is_tested() -> None:
    assert {path.stem for path in TUTORIALS.glob("*.md")} == {IN_A_SHELL, *IN_THIS_PROCESS}


@pytest.mark.slow
def test_the_exercise_of_the_first_hour_shows_a_red_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (bit_rate,) = re.findall(
        r"change the `bitrate` of `can` to (\d+)",
        (TUTORIALS / "first-hour.md").read_text(encoding="utf-8"),
    )
    monkeypatch.chdir(tmp_path)
    assert run(["init", "mine"]) == 0
    cell = Path("mine/cell.yaml")
    changed, count = re.subn(r"(?m)^(can: .*bitrate: )\d+", rf"\g<1>{bit_rate}", cell.read_text())
    assert count == 1
    cell.write_text(changed)
    capsys.readouterr()
    assert run(["check", "mine/cell.yaml"]) == ExitCode.USAGE
    shown = capsys.readouterr()
    assert len(re.findall(r"(?m)^  RED", shown.out)) == 1
    assert "RID-CAN-LOAD" in shown.err
