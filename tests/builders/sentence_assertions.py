"""Count assertions on sentences of errors; tests should pin error codes instead.

`python -m tests.builders.sentence_assertions` prints the number for each test folder, and the sum;
`--list` prints each place. It counts `match=` of `pytest.raises`, assertions with a literal of two
or more words about an error's text or a command's stderr, and details of three or more words of
`raises_code` and `raises_invalid`. Texts that reach the assertion by a variable, a loop or
`parametrize` are counted too.
"""

from __future__ import annotations

import argparse
import ast
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from tests.builders.code_lines import ROOT
from tests.builders.syntax_trees import tree_of

ERROR_TEXTS: Final = ("str(", "message", "err", "refus", "caught", ".output")
Texts = dict[str, tuple[str, ...]]
_DETAILS_FROM: Final = {"raises_code": 2, "raises_invalid": 1}


def sentence_assertions(tests: Path) -> Iterator[tuple[Path, int]]:
    """Yield file and line of each assertion on a sentence below a folder."""
    for path in sorted(tests.rglob("*.py")):
        tree = tree_of(path)
        for line in sorted(_lines(tree, _held_texts(tree))):
            yield path, line


def _lines(node: ast.AST, texts: Texts) -> Iterator[int]:
    """Yield the lines of assertions on sentences below a node.

    Args:
        node: A module, a function or a part of one.
        texts: Texts that each variable of the scope holds.
    """
    for child in ast.iter_child_nodes(node):
        inner = texts
        if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
            inner = {**texts, **_held_texts(child)}
        if _pins_sentence(child, inner):
            assert isinstance(child, (ast.Call, ast.Assert))
            yield child.lineno
        yield from _lines(child, inner)


def _pins_sentence(node: ast.AST, texts: Texts) -> bool:
    if isinstance(node, ast.Call):
        name = getattr(node.func, "attr", None) or getattr(node.func, "id", "")
        if name in _DETAILS_FROM:
            details = node.args[_DETAILS_FROM[name] :]
            return any(_is_sentence(detail, texts, words=3) for detail in details)
        return name == "raises" and any(each.arg == "match" for each in node.keywords)
    return isinstance(node, ast.Assert) and any(
        isinstance(part, ast.Compare)
        and isinstance(part.ops[0], (ast.In, ast.Eq))
        and _is_sentence(part.left, texts)
        and any(text in ast.unparse(part.comparators[0]).lower() for text in ERROR_TEXTS)
        for part in ast.walk(node.test)
    )


def _is_sentence(node: ast.expr, texts: Texts, words: int = 2) -> bool:
    held = [
        text
        for part in ast.walk(node)
        if isinstance(part, ast.Name)
        for text in texts.get(part.id, ())
    ]
    return any(len(text.split()) >= words for text in (*_texts(node), *held))


def _held_texts(scope: ast.Module | ast.FunctionDef | ast.AsyncFunctionDef) -> Texts:
    """Return, for each variable of a scope, its texts: by assignment, loop or `parametrize`."""
    found: Texts = {}
    if not isinstance(scope, ast.Module):
        for decorator in scope.decorator_list:
            found |= _parameters(decorator)
    nodes = (node for child in scope.body if not _is_scope(child) for node in ast.walk(child))
    for node in nodes:
        names: Sequence[ast.expr]
        match node:
            case ast.Assign(targets=names, value=value):
                pass
            case ast.AnnAssign(target=name, value=ast.expr() as value):
                names = [name]
            case ast.For(target=name, iter=value):
                names = [name]
            case _:
                continue
        if not isinstance(value, ast.Call):
            found |= {name.id: _texts(value) for name in names if isinstance(name, ast.Name)}
    return found


def _parameters(decorator: ast.expr) -> Texts:
    """Return the texts of each parameter of `pytest.mark.parametrize`."""
    if not (
        isinstance(decorator, ast.Call) and ast.unparse(decorator.func).endswith("parametrize")
    ):
        return {}
    names, *values = decorator.args
    named = ast.literal_eval(names)
    named = named.replace(" ", "").split(",") if isinstance(named, str) else list(named)
    found: dict[str, list[str]] = {name: [] for name in named}
    rows = [row for each in values for row in getattr(each, "elts", ())]
    for row in rows:
        cells = getattr(row, "args", None) or getattr(row, "elts", [row])
        for name, cell in zip(named, cells if len(named) > 1 else [row], strict=False):
            found[name] += _texts(cell)
    return {name: tuple(texts) for name, texts in found.items()}


def _is_scope(node: ast.AST) -> bool:
    return isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef))


def _texts(node: ast.AST) -> tuple[str, ...]:
    return tuple(
        part.value
        for part in ast.walk(node)
        if isinstance(part, ast.Constant) and isinstance(part.value, str)
    )


def main() -> None:
    """Print the number of assertions on sentences per folder; with `--list`, first their places."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--list", action="store_true", help="Print every place.")
    listed = parser.parse_args().list
    places = list(sentence_assertions(ROOT / "tests"))
    lines = [f"{path.relative_to(ROOT)}:{line}" for path, line in places] if listed else []
    folders = Counter(path.relative_to(ROOT / "tests").parts[0] for path, _ in places)
    lines += [f"{folder}: {number}" for folder, number in sorted(folders.items())]
    sys.stdout.write("\n".join([*lines, f"sum: {len(places)}\n"]))


if __name__ == "__main__":
    main()
