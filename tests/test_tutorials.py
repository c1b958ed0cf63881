"""The commands of each tutorial, run in an empty folder, print what the tutorial shows."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.builders.console_blocks import console_steps, require_shown

TUTORIALS = Path(__file__).resolve().parent.parent / "docs" / "tutorial"
NAMES = ("your-own-robot", "first-hour", "accurate-path", "payload-day")


def files_of(page: Path) -> Iterator[tuple[str, str]]:
    """Yield each file that a page asks the reader to write; the comment at its top is its name."""
    text = page.read_text(encoding="utf-8")
    for block in re.findall(r"```(?:yaml|xml)\n(.*?)```", text, re.DOTALL):
        named = re.match(r"(?:# |<!-- )([\w.-]+)(?: -->)?\n", block)
        assert named, block
        yield named[1], block


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) for name in NAMES[:1]]
    + [pytest.param(name, marks=pytest.mark.long) for name in NAMES[1:]],
)
def test_a_tutorial_shows_the_output_of_its_commands(name: str, tmp_path: Path) -> None:
    bin_folder = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{bin_folder}:{os.environ['PATH']}", "COLUMNS": "200"}
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
        require_shown(step.shown, done.stdout, f"{step.place}: {step.command}")


def test_every_tutorial_is_tested() -> None:
    assert {path.stem for path in TUTORIALS.glob("*.md")} == set(NAMES)
