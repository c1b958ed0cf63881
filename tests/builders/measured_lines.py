"""Measure which lines of the packages the tests execute; it costs 5 s per pytest process.

`tests/conftest.py` imports this module before all others. If the environment variable
`RID_DAQ_LINES` names a folder, each pytest process writes a file there when it ends. The library
SlipCover counts the lines: its probes remove themselves after their first execution; a tracer would
double the time. Lines that numba compiles, or that
other processes such as the cyclic task execute, are not counted.

`python -m tests.builders.measured_lines FOLDER` adds the files, compares each package with its
minimum, and lists the worst files with `--worst N`.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parents[2]
FLOORS: Final = {
    "acquisition": 93.0,
    "compensation": 85.0,
    "config": 95.0,
    "drivers": 92.0,
    "dynamics": 98.0,
    "identification": 94.0,
    "mock_hw": 84.0,
    "rid_daq": 76.0,
}
"""Minimum percentage of a package's lines that the fast tests reach in their own processes.

The minima are slightly below the measured values (94, 86, 97, 94, 99, 95, 85, 77); if a value
rises, raise its minimum too.
"""

COMPILED: Final = ("dynamics.kernels.simd import", "from numba import")


def measure_lines(folder: Path) -> Callable[[], None]:
    """Start to count lines; return a function that writes the counts to the folder."""
    from slipcover import FileMatcher, ImportManager, Slipcover

    omitted = {str(path) for path in _sources()} - {str(path) for path in _counted()}
    counter = Slipcover()
    ImportManager(counter, FileMatcher([ROOT / name for name in FLOORS], omitted)).__enter__()

    def write() -> None:
        with contextlib.chdir(ROOT):  # SlipCover reports file names relative to this folder
            counts = json.dumps(counter.get_coverage())
        (folder / f"{os.getpid()}.json").write_text(counts, encoding="utf-8")

    return write


def added(folder: Path) -> dict[str, tuple[int, int]]:
    """Return the reached and the total number of lines of every file.

    A file that no process has imported counts as unreached.
    """
    reached: dict[str, set[int]] = {}
    lines: dict[str, set[int]] = {}
    for path in folder.glob("*.json"):
        files: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["files"]
        for name, counts in files.items():
            reached.setdefault(name, set()).update(counts["executed_lines"])
            lines.setdefault(name, set()).update(counts["executed_lines"], counts["missing_lines"])
    found = {}
    for path in _counted():
        name = str(path.relative_to(ROOT))
        if name in lines:
            found[name] = (len(reached[name]), len(lines[name]))
        else:
            found[name] = (0, _lines_of(path))
    return found


def shares(found: dict[str, tuple[int, int]]) -> dict[str, float]:
    """Return the percentage of reached lines of each package."""
    sums = {package: [0, 0] for package in FLOORS}
    for name, counts in found.items():
        own = sums[name.split("/")[0]]
        own[0] += counts[0]
        own[1] += counts[1]
    return {package: 100.0 * hit / max(1, of) for package, (hit, of) in sums.items()}


def _sources() -> list[Path]:
    return [path for package in FLOORS for path in sorted((ROOT / package).rglob("*.py"))]


def _counted() -> list[Path]:
    """Return the source files except those that numba compiles, which cannot be measured."""
    texts = {path: path.read_text(encoding="utf-8") for path in _sources()}
    return [path for path, text in texts.items() if not any(word in text for word in COMPILED)]


def _lines_of(path: Path) -> int:
    """Return the number of code lines of a file."""
    from slipcover import Slipcover

    counter = Slipcover()
    counter.instrument(compile(path.read_text(encoding="utf-8"), str(path), "exec"))
    return sum(len(lines) for lines in counter.code_lines.values())


def main(arguments: Sequence[str]) -> int:
    """Print the reached lines; return 1 if a package is below its minimum."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--worst", type=int, default=0, metavar="N")
    given = parser.parse_args(arguments)
    out = sys.stdout.write
    found = added(given.folder)
    below = 0
    for package, percent in shares(found).items():
        held = percent >= FLOORS[package]
        below += not held
        mark = "" if held else ": BELOW"
        out(f"{package:15} {percent:5.1f} %, floor {FLOORS[package]:g} %{mark}\n")
    missed = sorted(found.items(), key=lambda item: item[1][0] - item[1][1])
    for name, (hit, of) in missed[: given.worst]:
        out(f"{of - hit:5} of {of:4} lines not reached: {name}\n")
    if below:
        out("Add tests for the new lines, or state in the commit why these tests cannot be fast.\n")
    return 1 if below else 0


write_lines = measure_lines(Path(folder)) if (folder := os.environ.get("RID_DAQ_LINES")) else None
"""Function that writes the counts of this process; None if `RID_DAQ_LINES` is not set."""

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
