"""Places at which the packages construct errors, and their codes, from the source code."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

from tests.builders.code_lines import PACKAGES, ROOT
from tests.builders.syntax_trees import source_files, text_of, tree_of

CODE: Final = re.compile(r"RID(-[A-Z0-9]+){2,}")


def modules(package: str) -> Iterator[tuple[Path, ast.Module]]:
    """Yield the path and the syntax tree of every file of a package."""
    for path in source_files(package):
        yield path.relative_to(ROOT), tree_of(path)


@cache
def codes_in_use() -> set[str]:
    """Return the error codes that the packages contain as literals."""
    return {
        node.value
        for path in source_files(*PACKAGES)
        if "RID-" in text_of(path)
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and CODE.fullmatch(node.value)
    }


def errors_without_code(module: ast.Module, classes: dict[str, bool]) -> list[int]:
    """Return the lines on which one of the project's errors is constructed without a code.

    Args:
        module: The file.
        classes: Result of `error_classes`.
    """
    return [
        node.lineno
        for node in ast.walk(module)
        if isinstance(node, ast.Call)
        and not classes.get(_name(node.func), True)
        and not _has_code(node)
    ]


def error_classes() -> dict[str, bool]:
    """Return the classes of the project's errors by name.

    A value is True if the class or one of its base classes sets a code. The function
    `system_errors`, which also constructs errors, is included.
    """
    children: dict[str, list[ast.ClassDef]] = {}
    for package in PACKAGES:
        for _, module in modules(package):
            for node in ast.walk(module):
                for base in node.bases if isinstance(node, ast.ClassDef) else ():
                    assert isinstance(node, ast.ClassDef)
                    children.setdefault(_name(base), []).append(node)
    found = {"system_errors": False, "RidDaqError": False}
    waiting = ["RidDaqError"]
    while waiting:
        parent = waiting.pop()
        for child in children.get(parent, ()):
            found[child.name] = found[parent] or _gives_code(child)
            waiting.append(child.name)
    return found


def _gives_code(node: ast.ClassDef) -> bool:
    return any(
        isinstance(call, ast.Call)
        and ast.unparse(call.func) == "super().__init__"
        and _has_code(call)
        and not any(isinstance(k.value, ast.Name) for k in call.keywords if k.arg == "code")
        for call in ast.walk(node)
    )


def _has_code(call: ast.Call) -> bool:
    return any(
        keyword.arg == "code"
        and not (isinstance(keyword.value, ast.Constant) and keyword.value.value == "")
        for keyword in call.keywords
    )


def _name(node: ast.expr) -> str:
    """Return the last name of a dotted name; empty for other expressions."""
    match node:
        case ast.Attribute(attr=name) | ast.Name(id=name):
            return name
    return ""
