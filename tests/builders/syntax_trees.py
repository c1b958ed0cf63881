"""Syntax trees of the source files; each process parses a file once."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from tests.builders.code_lines import ROOT


@cache
def source_files(*folders: str) -> tuple[Path, ...]:
    """Return the Python files below the named folders of the project, in a fixed order."""
    return tuple(path for folder in folders for path in sorted((ROOT / folder).rglob("*.py")))


@cache
def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


@cache
def tree_of(path: Path) -> ast.Module:
    """Return the syntax tree of a file, which the caller must not change."""
    return ast.parse(text_of(path))
