"""Count the lines of the eight packages: the lines of code, and all lines.

`python -m tests.builders.code_lines` prints both numbers for each package, and their sums. Blank
lines, docstrings, comments and imports are not lines of code.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
PACKAGES: Final = (
    "config",
    "dynamics",
    "drivers",
    "acquisition",
    "identification",
    "compensation",
    "mock_hw",
    "rid_daq",
)
_NO_CODE: Final = (
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE),
    *(tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER),
)


def code_lines(source: str) -> int:
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    kept = (each for each in tokens if each.type not in _NO_CODE)
    lines = {line for each in kept for line in range(each.start[0], each.end[0] + 1)}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.stmt) and _is_no_code(node):
            lines -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


def _is_no_code(node: ast.stmt) -> bool:
    """Return True if a statement is an import or a docstring."""
    if isinstance(node, ast.Import | ast.ImportFrom):
        return True
    value = node.value if isinstance(node, ast.Expr) else None
    return isinstance(value, ast.Constant) and isinstance(value.value, str)


def main() -> None:
    """Print the lines of each package and their sums."""
    sums = [0, 0]
    for package in PACKAGES:
        sources = [path.read_text() for path in (ROOT / package).rglob("*.py")]
        counts = (sum(map(code_lines, sources)), sum(each.count("\n") for each in sources))
        sums = [total + count for total, count in zip(sums, counts, strict=True)]
        sys.stdout.write(f"{package:16} {counts[0]:8,} {counts[1]:8,}\n")
    sys.stdout.write(f"{'code, all lines':16} {sums[0]:8,} {sums[1]:8,}\n")


if __name__ == "__main__":
    main()
