"""Commands of the tutorials print what the tutorials show, in an empty folder in sequence."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.builders.console_blocks import console_steps

TUTORIALS = Path(__file__).resolve().parent.parent / "docs" / "tutorial"
NAMES = ("your-own-robot", "first-hour", "accurate-path", "payload-day")

_NUMBER = re.compile(r"[-−+]?\d[\d.,]*(?:·10[⁻⁰¹²³⁴-⁹]+)?")
_RUN = re.compile(r"\b[0-9A-HJKMNP-TV-Z]{26}\b")
_PATH = re.compile(r"/\S+")


def normalised(line: str) -> str:
    """Return a line without its numbers, paths, ids of runs and column widths."""
    names = _RUN.sub("RUN", _PATH.sub("PATH", line))
    return re.sub(r"\s+", " ", _NUMBER.sub("#", names)).strip()


def files_of(page: Path) -> Iterator[tuple[str, str]]:
    """Yield each file that a page asks the reader to write; the comment at its top is its name."""
    text = page.read_text(encoding="utf-8")
    for block in re.findall(r"```(?:yaml|xml)\n(.*?)```", text, re.DOTALL):
        named = re.match(r"(?:# |<!-- )([\w.-]+)(?: -->)?\n", block)
        assert named, block
        yield named[1], block


def require_shown(shown: list[str], said: list[str], command: str) -> None:
    """Compare the output on a page with that of the command; an ellipsis stands for any lines."""
    parts = "\n".join(map(normalised, shown)).split("…\n") if shown else []
    text = "\n".join(map(normalised, said)) + "\n"
    at = 0
    for number, part in enumerate(each.rstrip("…").rstrip("\n") for each in parts):
        found = text.find(part, at)
        assert found >= 0, (
            f"{command}: after {text[:at]!r} the page shows {part!r}, not in {text!r}"
        )
        if number == 0:
            assert found == 0, f"{command}: begins with {text.splitlines()[0]!r}"
        at = found + len(part)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) for name in NAMES[:1]]
    + [pytest.param(name, marks=pytest.mark.long) for name in NAMES[1:]],
)
def test_a_tutorial_shows_the_output_of_its_commands(name: str, tmp_path: Path) -> None:
    own = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{own}:{os.environ['PATH']}", "COLUMNS": "200"}
    page = TUTORIALS / f"{name}.md"
    found = list(console_steps(page))
    assert len(found) >= 4
    for file, content in files_of(page):
        (tmp_path / file).write_text(content, encoding="utf-8")
    for step in found:
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
        require_shown(list(step.shown), done.stdout.splitlines(), step.command)


def test_every_tutorial_is_tested() -> None:
    assert {path.stem for path in TUTORIALS.glob("*.md")} == set(NAMES)
