"""Numbers of the thesis and results of the simulated experiments, as trees of numbers."""

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


def run_result(folder: Path, label: str) -> Tree:
    """Return the results of the run with a label."""
    for manifest in (folder / "runs").glob("*/manifest.json"):
        if json.loads(manifest.read_text(encoding="utf-8"))["label"] == label:
            found: Tree = json.loads(manifest.with_name("result.json").read_text(encoding="utf-8"))
            return found
    raise SystemExit(f"{folder}: no run {label!r}")


def torque_curves(result: Tree, first_axis: int = 0) -> Tree:
    """Return measured and predicted torque of the axes from one on, from the results of a run."""
    torque = result["curves"]["torque"]
    axes = torque["axes"][first_axis:]
    return {
        "time_s": curve(torque["time_s"]),
        "measured": [curve(axis["measured"]) for axis in axes],
        "predicted": [curve(axis["predicted"]) for axis in axes],
    }


def wrench_curves(reaction: Tree) -> Tree:
    """Return the measured and predicted base wrench from the results of a run."""
    return {
        "time_s": curve(reaction["time_s"]),
        "measured": [curve(part["measured"]) for part in reaction["components"]],
        "predicted": [curve(part["predicted"]) for part in reaction["components"]],
    }
