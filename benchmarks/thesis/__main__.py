"""Repeat the thesis's experiments, compare the results, and write `docs/thesis.md`.

Run it with ``python -m benchmarks.thesis [--quick] [--page] [--results FILE]``.

- Without options all experiments are run; `docs/thesis.json`, the page and its pictures are
  written.
- `--quick` runs short experiments, and writes no page.
- `--page` writes the page and its pictures from the stored results.
- `--results FILE` writes the results to another file, without a page.

The exit code is 1 if a relation that the thesis states does not hold in our results.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

from benchmarks.thesis.page import page_text
from benchmarks.thesis.payload_experiment import (
    friction_results,
    payload_results,
    sensitivity_results,
)
from benchmarks.thesis.pictures import write_pictures
from benchmarks.thesis.records import Tree, load_facts, load_results, write_results
from benchmarks.thesis.relations import relations
from benchmarks.thesis.robot_experiment import path_results, robot_results

DOCS: Final = Path(__file__).resolve().parents[2] / "docs"
RESULTS: Final = DOCS / "thesis.json"
PAGE: Final = DOCS / "thesis.md"
PICTURES: Final = DOCS / "pictures" / "thesis"


def run_experiments(quick: bool) -> Tree:
    """Return the results of all experiments."""
    results: Tree = {"quick": quick}
    began_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="thesis") as name:
        folder = Path(name)
        for key, experiment in (("robot", robot_results), ("path", path_results)):
            results[key] = experiment(folder, quick)
            print(f"{key}: {time.monotonic() - began_s:.0f} s", flush=True)
    with tempfile.TemporaryDirectory(prefix="thesis") as name:
        folder = Path(name)
        for key, experiment in (("friction", friction_results), ("payload", payload_results)):
            results[key] = experiment(folder, quick)
            print(f"{key}: {time.monotonic() - began_s:.0f} s", flush=True)
        results["sensitivity"] = sensitivity_results(folder)
    results["elapsed_min"] = round((time.monotonic() - began_s) / 60.0, 1)
    return results


def main() -> int:
    """Measure, write the page, and print the relations; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description="Compare simulated experiments with the thesis.")
    parser.add_argument("--quick", action="store_true", help="run short experiments; no page")
    parser.add_argument("--page", action="store_true", help="write the page from stored results")
    parser.add_argument("--results", type=Path, help="write results to this file, and no page")
    options = parser.parse_args()
    results = load_results(RESULTS) if options.page else run_experiments(options.quick)
    facts = load_facts()
    if options.results is not None:
        write_results(results, options.results)
    elif not options.quick:
        write_results(results, RESULTS)
        PAGE.write_text(page_text(facts, results), encoding="utf-8")
        write_pictures(results, PICTURES)
    found = relations(facts, results)
    for relation in found:
        print(f"{'holds' if relation.holds else 'DOES NOT HOLD'}: {relation.text}")
    holds = all(relation.holds for relation in found)
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
