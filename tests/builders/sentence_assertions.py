"""Count assertions on sentences of errors; tests should pin error codes instead.

`python -m tests.builders.sentence_assertions` prints the number for each test folder, and the sum;
`--list` prints each place. It counts `match=` of `pytest.raises`, assertions with a literal of two
or more words about an error's text or a command's stderr, and details of three or more words of
`raises_code` and `raises_invalid`.
"""

from __future__ import annotations

import argparse
import ast
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
ERROR_TEXTS: Final = ("str(", "message", "err", "refus", "caught", ".output")
_DETAILS_FROM: Final = {"raises_code": 2, "raises_invalid": 1}


def sentence_assertions(tests: Path) -> Iterator[tuple[Path, int]]:
    """Yield file and line of each assertion on a sentence below a folder."""
    for path in sorted(tests.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if _pins_sentence(node):
                assert isinstance(node, (ast.Call, ast.Assert))
                yield path, node.lineno


def _pins_sentence(node: ast.AST) -> bool:
    if isinstance(node, ast.Call):
        name = ast.unparse(node.func)
        if name in _DETAILS_FROM:
            details = node.args[_DETAILS_FROM[name] :]
            return any(_is_sentence(detail, words=3) for detail in details)
        return name.endswith("raises") and any(each.arg == "match" for each in node.keywords)
    return isinstance(node, ast.Assert) and any(
        isinstance(part, ast.Compare)
        and isinstance(part.ops[0], (ast.In, ast.Eq))
        and _is_sentence(part.left)
        and any(text in ast.unparse(part.comparators[0]).lower() for text in ERROR_TEXTS)
        for part in ast.walk(node.test)
    )


def _is_sentence(node: ast.expr, words: int = 2) -> bool:
    return any(
        isinstance(part, ast.Constant)
        and isinstance(part.value, str)
        and len(part.value.split()) >= words
        for part in ast.walk(node)
    )


def main() -> None:
    """Print the numbers, or the places."""
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
