"""The examples of docs/extending.md work on a copy of the program if only their text is used."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.builders.code_lines import PACKAGES, ROOT
from tests.builders.console_blocks import require_shown

PAGE = ROOT / "docs" / "extending.md"
COPIED = (*PACKAGES, "tests")
MOST_FILES = 6
LONGEST_S = 600
EXAMPLES = (
    pytest.param("a drive without a torque limit", marks=pytest.mark.slow),
    pytest.param("drives on a multicast group", marks=pytest.mark.slow),
    pytest.param("quadratic friction", marks=pytest.mark.slow),
    pytest.param("one joint moves to a pose and back", marks=pytest.mark.slow),
    "the masses of a robot file",
    pytest.param("a recorder that calls torques loads", marks=pytest.mark.slow),
)


def example(title: str) -> str:
    text = PAGE.read_text(encoding="utf-8")
    return text.split(f"\n### Example: {title}\n")[1].split("\n## ")[0].split("\n### ")[0]


def blocks(text: str) -> Iterator[tuple[str, str, str]]:
    """Yield kind, file name (empty for commands) and content of each block."""
    pattern = r"(?:^`([\w./-]+)`:\n\n)?^```(\w+)\n(.*?)^```$"
    for name, kind, content in re.findall(pattern, text, re.DOTALL | re.MULTILINE):
        yield kind, name, content


def apply_changes(path: Path, changes: str) -> None:
    """Apply the hunks of a diff; each is located by its text, which occurs once in the file."""
    text = path.read_text(encoding="utf-8")
    for hunk in changes.split("@@\n"):
        lines = hunk.splitlines(keepends=True)
        old = "".join(line[1:] for line in lines if line[0] in "- ")
        new = "".join(line[1:] for line in lines if line[0] in "+ ")
        assert text.count(old) == 1, f"{path}: {text.count(old)} times:\n{old}"
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")


@pytest.mark.parametrize("title", EXAMPLES)
def test_an_example_works_as_written(title: str, tmp_path: Path) -> None:
    program, work = tmp_path / "program", tmp_path / "work"
    work.mkdir()
    for package in COPIED:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / package, program / package, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", program)
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "PYTHONPATH": str(program),
        "COLUMNS": "200",
    }
    touched = set()
    for kind, name, content in blocks(example(title)):
        if kind == "console":
            run_commands(content, work, program, environment)
            continue
        assert name, content
        path = (program if name.split("/")[0] in COPIED else work) / name
        touched.add(name)
        if kind == "diff":
            apply_changes(path, content)
        else:
            assert not path.exists()
            path.write_text(content, encoding="utf-8")
    assert 1 <= len(touched) <= MOST_FILES


def run_commands(content: str, work: Path, program: Path, environment: dict[str, str]) -> None:
    for step in re.split(r"^\$ ", content, flags=re.MULTILINE)[1:]:
        command, *shown = step.splitlines()
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=program if "pytest" in command else work,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
        require_shown(shown, done.stdout, command)


def test_every_example_is_tested() -> None:
    titles = re.findall(r"^### Example: (.*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    named = [each if isinstance(each, str) else each.values[0] for each in EXAMPLES]
    assert titles == named
