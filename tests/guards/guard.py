"""`Guard`: one check in the code that refuses or stops a motion, and the tests of this check.

The files `*.yaml` in this folder list the guards. Each entry says how the guard is removed: `code`,
which occurs once in `file`, is replaced by `without`.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import yaml
from pydantic import BaseModel, ConfigDict

from tests.builders.syntax_trees import tree_of

ROOT: Final = Path(__file__).resolve().parents[2]
FOLDER: Final = Path(__file__).parent


class Guard(BaseModel):
    """One guard.

    Attributes:
        guard: What the guard refuses or stops, in one sentence.
        file: Source file that contains the guard.
        code, without: Source text of the guard, and the text that replaces it when it is removed.
        tests: Test functions of which at least one fails without the guard.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    guard: str
    file: str
    code: str
    without: str = ""
    tests: tuple[str, ...]

    def removed_from(self, text: str) -> str:
        """Return a source text without this guard.

        Raises:
            ValueError: The text does not contain the guard's code exactly once.
        """
        found = text.count(self.code)
        if found != 1:
            raise ValueError(
                f"{self.file}: contains the code of the guard {found} times instead of once"
            )
        return text.replace(self.code, self.without)


class Section(BaseModel):
    """The guards of one YAML file, under one title."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    title: str
    guards: tuple[Guard, ...]


def sections() -> list[Section]:
    """Return the sections of guards, sorted by the names of their files."""
    files = sorted(FOLDER.glob("*.yaml"))
    return [Section.model_validate(yaml.safe_load(each.read_text("utf-8"))) for each in files]


def guards() -> list[Guard]:
    return [guard for section in sections() for guard in section.guards]


def functions_of(path: Path) -> set[str]:
    """Return the test functions of a file, `test_a` or `TestA::test_b`."""
    return set(_functions(tree_of(path), ""))


def _functions(node: ast.Module | ast.ClassDef, prefix: str) -> Iterator[str]:
    for child in node.body:
        if isinstance(child, ast.ClassDef):
            yield from _functions(child, f"{prefix}{child.name}::")
        elif isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield f"{prefix}{child.name}"
