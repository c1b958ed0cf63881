"""Third-party robots from URDF to validated model: `python -m benchmarks.strangers --urdf DIR`.

Every URDF below DIR goes through the commands with default options, each in a new process:
`init --urdf`, `check`, `design`, `record` of the excitation and of the validation motion on the
simulated cell that init wrote, `identify`, `validate`. If `init` reports several possible tips of
the arm, the benchmark uses the first one. `--only NAME` (repeatable) selects the files whose names
contain NAME; `--json` omits the table.

`python -m benchmarks.strangers --meshes [--robots DIR]` runs only `init --urdf`, for arms with
meshes from packages that pip installs into DIR (default: a temporary folder). Bars: 95 % of the
arms have bodies on every link that has meshes, all distances of the bodies are computed, no vertex
of a mesh is outside of the bodies, and the median time is at most 90 s.

The last line is one JSON object with the median wall time and processor time of the robots that
passed. The limit (bar) applies to the processor time, which depends little on other load.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from benchmarks.meshed_arms import try_meshes
from benchmarks.program_run import ended_programs_s, run_program

INITIALISED_BAR: Final = 0.95
VALIDATED_BAR: Final = 0.90
MEDIAN_BAR_S: Final = 90.0
LONGEST_STEP_CPU_S: Final = 360
STEPS: Final = ("init", "check", "design", "excitation", "validation", "identify", "validate")


@dataclass
class UrdfResult:
    """Result for one robot: the time of each step, and the error that ended it.

    Attributes:
        name: Path of the file below the folder.
        took_s: Wall time of each step [s].
        cpu_s: Processor time of all steps [s].
        stopped_by: Last line of the failing command's output; empty if all steps passed.
    """

    name: str
    took_s: dict[str, float] = field(default_factory=dict)
    cpu_s: float = 0.0
    stopped_by: str = ""

    @property
    def initialised(self) -> bool:
        """True if init wrote a cell."""
        return len(self.took_s) > 1 or not self.stopped_by

    @property
    def validated(self) -> bool:
        """True if the model passed its validation."""
        return not self.stopped_by

    @property
    def total_s(self) -> float:
        """Wall time of all steps together [s]."""
        return sum(self.took_s.values())


def run_commands(name: str, urdf: Path, folder: Path) -> UrdfResult:
    """Run the commands for one robot until a command fails."""
    result = UrdfResult(name)
    cell, runs = str(folder / "cell.yaml"), ["--runs", str(folder / "runs")]
    init = ["init", str(folder), "--urdf", str(urdf)]
    motion, model = str(folder / "motion.yaml"), ""
    words: dict[str, list[str]] = {
        "init": init,
        "check": ["check", cell, *runs],
        "design": ["design", cell, "-o", motion],
        "excitation": ["record", cell, motion, *runs],
        "validation": ["record", cell, str(folder / "validation.yaml"), *runs],
        "identify": ["identify", "motion", *runs],
    }
    before_s = ended_programs_s()
    for step in STEPS:
        if step == "validate":
            models = sorted((folder / "runs").glob("*/model.json"))
            model = str(models[0]) if models else "no model"
            words[step] = ["validate", model, "validation", *runs]
        began_s = time.perf_counter()
        code, output = _run(words[step])
        if step == "init" and code and (tip := re.search(r"--tip[ =](?!LINK)([\w.\-/]+)", output)):
            code, output = _run([*init, "--tip", tip[1]])
        result.took_s[step] = time.perf_counter() - began_s
        if code:
            lines = [line for line in output.splitlines() if line.strip()]
            reason = next(
                (line for line in reversed(lines) if not line.startswith(("Report:", "Kept:"))), ""
            )
            result.stopped_by = f"{step}, exit {code}: {reason}"
            break
    result.cpu_s = ended_programs_s() - before_s
    return result


def _run(words: list[str]) -> tuple[int, str]:
    """Run a command; return its exit status, and its output with its messages."""
    code, output, messages = run_program(words, LONGEST_STEP_CPU_S)
    return code, output + messages


def urdfs(folder: Path, only: list[str]) -> list[Path]:
    """Return the URDFs below a folder; with `only`, those whose names contain one of its words."""
    found = sorted(folder.rglob("*.urdf"))
    return [path for path in found if not only or any(word in path.name for word in only)]


def main() -> int:
    """Test every robot and print; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--urdf", type=Path, metavar="DIR")
    source.add_argument("--meshes", action="store_true")
    parser.add_argument("--robots", type=Path, metavar="DIR")
    parser.add_argument("--only", action="append", default=[], metavar="NAME")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if options.meshes:
        return try_meshes(options.robots, options.only, with_table=not options.json)
    results: list[UrdfResult] = []
    for path in urdfs(options.urdf, options.only):
        with tempfile.TemporaryDirectory() as folder:
            name = str(path.relative_to(options.urdf))
            results.append(run_commands(name, path.resolve(), Path(folder) / "cell"))
        if not options.json:
            _print(results[-1], heading=len(results) == 1)
    if not results:
        print(f"no URDF below {options.urdf} whose name contains {options.only or 'anything'}")
        return 2
    n = len(results)
    initialised = sum(each.initialised for each in results)
    validated = sum(each.validated for each in results)
    passed_s = [each.total_s for each in results if each.validated]
    passed_cpu_s = [each.cpu_s for each in results if each.validated]
    median_cpu_s = statistics.median(passed_cpu_s) if passed_cpu_s else float("inf")
    holds = (
        initialised >= INITIALISED_BAR * n
        and validated >= VALIDATED_BAR * n
        and median_cpu_s <= MEDIAN_BAR_S
    )
    result = {
        "name": "strangers",
        "n": n,
        "initialised": initialised,
        "validated": validated,
        "median_s": round(statistics.median(passed_s), 1) if passed_s else None,
        "median_cpu_s": round(median_cpu_s, 1) if passed_cpu_s else None,
        "load": round(os.getloadavg()[2], 1),
        "bar": f"{INITIALISED_BAR:.0%} initialised, {VALIDATED_BAR:.0%} validated, median CPU time"
        f" at most {MEDIAN_BAR_S:g} s",
        "holds": holds,
        "robots": [
            {
                "urdf": each.name,
                "took_s": {step: round(took_s, 1) for step, took_s in each.took_s.items()},
                "cpu_s": round(each.cpu_s, 1),
                "validated": each.validated,
                "stopped_by": each.stopped_by,
            }
            for each in results
        ],
    }
    print(json.dumps(result))
    return 0 if holds else 1


def _print(result: UrdfResult, *, heading: bool) -> None:
    if heading:
        steps = "".join(f"{step:>11}" for step in STEPS)
        print(f"{'robot':32}{steps}{'total':>9}{'CPU':>9}")
    times = "".join(
        f"{result.took_s[step]:>9.1f} s" if step in result.took_s else f"{'-':>11}"
        for step in STEPS
    )
    both = f"{result.total_s:>7.0f} s{result.cpu_s:>7.0f} s"
    verdict = result.stopped_by or "passed"
    print(f"{result.name[:31]:32}{times}{both}  {verdict}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
