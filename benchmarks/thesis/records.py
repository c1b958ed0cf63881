"""`Facts` of the thesis and `Results` of the simulated experiments, as trees of numbers."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from numpy.typing import ArrayLike

Tree = dict[str, Any]
"""A tree of numbers: nested dictionaries with numbers, texts and lists at the end."""

DIGITS: Final = 4
CURVE_POINTS: Final = 240


def load_facts() -> Tree:
    """Return the numbers of the thesis."""
    path = Path(__file__).with_name("facts.yaml")
    tree: Tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    return tree


def load_results(path: Path) -> Tree:
    """Return stored results."""
    found: Tree = json.loads(path.read_text(encoding="utf-8"))
    return found


def write_results(results: Tree, path: Path) -> None:
    """Write results as JSON, with each list of numbers on one line."""
    text = json.dumps(results, indent=1, ensure_ascii=False)
    text = re.sub(r"\[\s+([^][{}]*?)\s+\]", lambda found: f"[{_joined(found[1])}]", text)
    path.write_text(text + "\n", encoding="utf-8")


def _joined(lines: str) -> str:
    return " ".join(lines.split())


def rounded(value: float) -> float:
    """Return a number with few digits, as it is stored."""
    return float(f"{value:.{DIGITS}g}")


def numbers(values: ArrayLike) -> list[Any]:
    """Return numbers with few digits."""
    array = np.asarray(values, dtype=float)
    if array.ndim > 1:
        return [numbers(row) for row in array]
    return [rounded(value) for value in array]


def curve(values: ArrayLike) -> list[float]:
    """Return a curve with at most `CURVE_POINTS` points and few digits."""
    array = np.asarray(values, dtype=float)
    return numbers(array[:: max(1, -(-len(array) // CURVE_POINTS))])
