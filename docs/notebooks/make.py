"""Write a Jupyter notebook from each Markdown page in this folder: `python docs/notebooks/make.py`.

The Python blocks of a page become the code cells of its notebook. `tests/test_notebooks.py` runs
these cells, and fails if a notebook differs from its page.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

HERE = Path(__file__).resolve().parent
CELL = re.compile(r"^```python\n(.*?)^```\n", re.MULTILINE | re.DOTALL)


def find_cells(page: str) -> list[str]:
    """Return the Python blocks of a Markdown page."""
    return [found[1] for found in CELL.finditer(page)]


def to_notebook(page: str) -> str:
    """Return a Markdown page as a Jupyter notebook (nbformat 4.5), without outputs."""
    notebook_cells: list[dict[str, object]] = []
    for number, part in enumerate(CELL.split(page)):
        lines = part.strip("\n").splitlines(keepends=True)
        cell: dict[str, object] = {"id": f"cell-{number}", "metadata": {}, "source": lines}
        if number % 2:
            notebook_cells.append(
                {"cell_type": "code", "execution_count": None, "outputs": [], **cell}
            )
        elif lines:
            notebook_cells.append({"cell_type": "markdown", **cell})
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    document = {
        "cells": notebook_cells,
        "metadata": {"kernelspec": kernel},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(document, ensure_ascii=False, indent=1) + "\n"


def main() -> None:
    """Write a notebook next to each page."""
    for page in HERE.glob("*.md"):
        text = to_notebook(page.read_text(encoding="utf-8"))
        page.with_suffix(".ipynb").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
