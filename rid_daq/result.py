"""`result.json`: every number of a run's report, in one document that commands add sections to.

Sections, all optional but the first four: `title`, `robot`, `verdict`, `software`; `cell`, `seed`,
`runs`, `average`, `estimate`, `truth`, `validation`, `curves`. What differs from one execution to
the next (run ids, clock times, loop timing) stands under `timing` and nowhere else, so that two
simulated runs with the same seed agree in all the rest, bit for bit.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from config.errors import RecordingError
from rid_daq.report.render import render_report
from rid_daq.versions import software_versions

SCHEMA = "rid-daq result 1"

Result = dict[str, Any]


def new_result(title: str, robot: str) -> Result:
    """Return a result document without a verdict yet."""
    return {
        "schema": SCHEMA,
        "title": title,
        "robot": robot,
        "verdict": verdict([], "Nothing to judge", "No limit was set for this run."),
        "software": software_versions(),
    }


def check(text: str, value: float, relation: str, limit: float, unit: str = "") -> dict[str, Any]:
    """Return one line of a verdict: what was reached, and what was required.

    Parameters
    ----------
    text
        What is held to a limit.
    value, limit
        Reached and required.
    relation
        "≤" or "≥": how `value` must stand to `limit`.
    unit
        Of both.
    """
    passed = value <= limit if relation == "≤" else value >= limit
    return {
        "text": text,
        "value": value,
        "relation": relation,
        "limit": limit,
        "unit": unit,
        "passed": bool(passed),
    }


def verdict(checks: Sequence[dict[str, Any]], headline: str, sentence: str) -> dict[str, Any]:
    """Return the verdict section: passed, failed, or (without checks) none."""
    passed = all(line["passed"] for line in checks) if checks else None
    return {
        "passed": passed,
        "headline": headline,
        "sentence": sentence,
        "checks": list(checks),
    }


def read_result(folder: Path) -> Result:
    """Return a run's result document.

    Raises
    ------
    RecordingError
        The run has none yet, or the file is not one.
    """
    path = folder / "result.json"
    try:
        document = json.loads(path.read_bytes())
    except FileNotFoundError:
        raise RecordingError(
            f"{folder}: no result.json; is this a run folder? `rid-daq runs` lists them"
        ) from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot read: {error.strerror}") from None
    except ValueError:
        raise RecordingError(f"{path}: not valid JSON; was it edited?") from None
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise RecordingError(f"{path}: not a result of this version ({SCHEMA!r} expected)")
    return document


def write_result(folder: Path, result: Result) -> Path:
    """Write `result.json` and `report.html` into a folder; return the report's path.

    Raises
    ------
    RecordingError
        A file cannot be written.
    """
    text = json.dumps(result, ensure_ascii=False, indent=1, allow_nan=False)
    write_text(folder / "result.json", text + "\n")
    report = folder / "report.html"
    write_text(report, render_report(result))
    return report


def write_text(path: Path, text: str) -> None:
    """Write a file so that it is whole or not there at all.

    Raises
    ------
    RecordingError
        The file cannot be written.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink()
        raise RecordingError(f"{path}: cannot write: {error.strerror}") from None
