"""Write the notebooks from their pages: `python docs/notebooks/make.py`.

A page is Markdown; its blocks of Python are the cells of a notebook. `tests/test_notebooks.py` runs
them, and fails if a notebook differs from its page.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

HERE = Path(__file__).resolve().parent
CELL = re.compile(r"^```python\n(.*?)^```\n", re.MULTILINE | re.DOTALL)


def cells(page: str) -> list[str]:
    """Return the code of the cells of a page."""
    return [found[1] for found in CELL.finditer(page)]


def notebook(page: str) -> str:
    """Return a page as a notebook (nbformat 4.5), without outputs."""
    made: list[dict[str, object]] = []
    for number, part in enumerate(CELL.split(page)):
        lines = part.strip("\n").splitlines(keepends=True)
        cell: dict[str, object] = {"id": f"cell-{number}", "metadata": {}, "source": lines}
        if number % 2:
            made.append({"cell_type": "code", "execution_count": None, "outputs": [], **cell})
        elif lines:
            made.append({"cell_type": "markdown", **cell})
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {
        "cells": made,
        "metadata": {"kernelspec": kernel},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(whole, ensure_ascii=False, indent=1) + "\n"


def main() -> None:
    """Write a notebook beside each page."""
    for page in HERE.glob("*.md"):
        text = notebook(page.read_text(encoding="utf-8"))
        page.with_suffix(".ipynb").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
