"""Path errors with and without on-line compensation: five circles and a path, simulated.

Model and velocity loops are identified in the same session; no motion is used for tuning. Each
motion is recorded without compensation, then streamed with compensation in the cyclic task.

Run it with ``python -m benchmarks.path_error [--quick]``.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.paths import CIRCLES, FIRST, PATH, SPLINE, JobRunner, circle_text, is_held, ratios
from benchmarks.short_form import is_short

FIRST_BAR, PATH_BAR, OTHERS_BAR = (8.0, 5.0), (10.0, 8.0), (6.0, 4.0)


def compare_live(workshop: JobRunner, label: str, text: str) -> dict[str, Any]:
    """Record a motion without compensation, and stream it with it; return both tracking errors."""
    motion = Path(workshop.path(f"{label}.yaml"))
    motion.write_text(text)
    workshop("record", workshop.cell, str(motion), "--label", f"{label}-plain")
    workshop("stream", workshop.cell, str(motion), *workshop.model_options(), "--label", label)
    found: dict[str, Any] = workshop("tracking", label, "--against", f"{label}-plain")
    motion_found: dict[str, Any] = found["motions"][0]
    return motion_found


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    quick = is_short(__doc__)
    found: dict[str, dict[str, Any]] = {}
    with tempfile.TemporaryDirectory() as name:
        workshop = JobRunner(Path(name), quick)
        workshop.identify()
        for number, (title, own) in enumerate(CIRCLES.items()):
            if quick and number > 0:
                break
            found[title] = compare_live(workshop, f"c{number}", circle_text(own, 4))
        if not quick:
            found[SPLINE] = compare_live(workshop, "spline", PATH)
    holds = True
    for title, motion in found.items():
        bar = {FIRST: FIRST_BAR, SPLINE: PATH_BAR}.get(title, OTHERS_BAR)
        holds = is_held(f"{title:36s}", motion, bar) and holds
    result = {
        "name": "path_error",
        "value": round(1e3 * found[FIRST]["mean_m"], 4),
        "unit": "mm mean distance from the circle of 40 cm, with on-line compensation",
        "ratios": ratios(found),
        "bar": "error reduced in the mean and at worst: the circle 8 and 5 times, the path"
        " from rest 10 and 8, others 6 and 4",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
