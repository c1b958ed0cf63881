"""Repeat the thesis's experiments, compare the results, and write `docs/thesis.md`.

Run it with ``python -m benchmarks.thesis [--quick] [--only PART,...] [--page] [--results FILE]``.

- The experiments have five parts: robot (chapters 3, 4 and 6), friction,
  payload, warming (section 5.6.3) and sensitivity. With `--only`, the stored results of the other
  parts are kept.
- The results are stored in `docs/thesis.json`, part by part. Then the page and its pictures are
  written.
- `--quick` runs short experiments. Page and results say which parts were short.
- `--page` runs nothing, and writes the page from the stored results.
- `--results FILE` stores the results in another file, and writes no page.

The exit code is 1 if a relation that the thesis states does not hold in our results, and no cause
is known.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from benchmarks.thesis.page import page_text
from benchmarks.thesis.payload_experiment import (
    friction_results,
    payload_results,
    sensitivity_results,
    wrong_prediction_results,
)
from benchmarks.thesis.pictures import write_pictures
from benchmarks.thesis.records import Tree, load_facts, load_results, write_results
from benchmarks.thesis.relations import relations
from benchmarks.thesis.robot_experiment import path_results, reversal_results, robot_results
from benchmarks.thesis.warming_experiment import warming_results

DOCS: Final = Path(__file__).resolve().parents[2] / "docs"
RESULTS: Final = DOCS / "thesis.json"
PAGE: Final = DOCS / "thesis.md"
PICTURES: Final = DOCS / "pictures" / "thesis"


def robot_part(folder: Path, quick: bool) -> Tree:
    """Return the results of chapters 3, 4 and 6, which use the same excitation run."""
    return {
        "robot": robot_results(folder, quick),
        "path": path_results(folder, quick),
        "reversal": reversal_results(folder),
    }


PARTS: Final[dict[str, Callable[[Path, bool], Tree]]] = {
    "robot": robot_part,
    "friction": lambda folder, _quick: {"friction": friction_results(folder)},
    "payload": lambda folder, quick: {"payload": payload_results(folder, quick)},
    "warming": lambda folder, quick: {"warming": warming_results(folder, quick)},
    "sensitivity": lambda folder, _quick: {
        "sensitivity": sensitivity_results(folder),
        "wrong_prediction": wrong_prediction_results(),
    },
}
"""Experiments by the names of their parts."""

ALWAYS_FULL: Final = ("friction", "sensitivity")
"""Parts that `--quick` does not change."""


def run_parts(names: list[str], quick: bool, path: Path) -> Tree:
    """Run parts of the experiments, and store the results after each part.

    Args:
        names: Names of the parts.
        quick: True for short experiments.
        path: File of the results; results of other parts in it are kept.
    """
    results = load_results(path) if path.exists() else {"minutes": {}, "short": []}
    for name in names:
        began_s = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="thesis") as folder:
            results |= PARTS[name](Path(folder), quick)
        minutes = (time.monotonic() - began_s) / 60.0
        results["minutes"][name] = round(minutes, 1)
        is_short = quick and name not in ALWAYS_FULL
        short = {each for each in results["short"] if each != name}
        results["short"] = sorted(short | {name} if is_short else short)
        write_results(results, path)
        print(f"{name}: {minutes:.1f} min", flush=True)
    return results


def main() -> int:
    """Measure, write the page, and print the relations; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description="Compare simulated experiments with the thesis.")
    parser.add_argument("--quick", action="store_true", help="run short experiments")
    parser.add_argument("--only", default=",".join(PARTS), help="parts to run (default: all)")
    parser.add_argument("--page", action="store_true", help="write the page from stored results")
    parser.add_argument("--results", type=Path, help="store results in this file; write no page")
    options = parser.parse_args()
    names = options.only.split(",")
    if unknown := set(names) - set(PARTS):
        parser.error(f"--only: {', '.join(sorted(unknown))} is not one of {', '.join(PARTS)}")
    stored = options.results or RESULTS
    results = load_results(stored) if options.page else run_parts(names, options.quick, stored)
    facts = load_facts()
    if missing := [name for name in PARTS if name not in results]:
        print(f"no results of {', '.join(missing)} yet: run these parts too")
        return 1
    if options.results is None:
        PAGE.write_text(page_text(facts, results), encoding="utf-8")
        write_pictures(results, PICTURES)
    found = relations(facts, results)
    for relation in found:
        print(f"{'holds' if relation.holds else 'DOES NOT HOLD'}: {relation.text}")
    holds = not any(relation.is_unexplained for relation in found)
    circle = results["path"]["circle_classical"]
    print(
        json.dumps(
            {
                "name": "thesis",
                "value": circle["mean_mm"],
                "unit": "mm mean distance from the circle of 40 cm, with compensation",
                "ratios": {"thesis": facts["path"]["compensated_mean_mm"]},
                "bar": f"{len(found)} relations of the thesis",
                "holds": holds,
            }
        )
    )
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
