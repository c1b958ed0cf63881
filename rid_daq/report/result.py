"""`result.json`: every number of a run's report, in one document that commands add sections to.

Sections, all optional but the first four: `title`, `robot`, `verdict`, `software`; `cell`, `seed`,
`runs`, `average`, `estimate`, `truth`, `validation`, `curves`. What differs from one execution to
the next (run ids, clock times, loop timing) stands under `timing` and nowhere else, so that two
simulated runs with the same seed agree in all the rest, bit for bit.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from acquisition.runs.folder import RunFolder
from config.errors import ConfigError, RecordingError
from config.formats.json_file import parse_json
from rid_daq.report.render import render_report
from rid_daq.session.versions import software_versions

SCHEMA = "rid-daq result 1"
RESULT = "result.json"
REPORT = "report.html"

Result = dict[str, Any]


class _Verdict(BaseModel):
    model_config = ConfigDict(strict=True)

    passed: bool | None
    headline: str
    sentence: str
    checks: list[dict[str, Any]]


class _Head(BaseModel):
    """What every document has; other sections are judged where they are shown."""

    model_config = ConfigDict(strict=True)

    title: str
    robot: str
    verdict: _Verdict
    software: dict[str, Any]
    runs: list[dict[str, Any]] = []
    timing: dict[str, Any] = {}


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


def read_result(folder: RunFolder) -> Result:
    """Return a run's result document.

    Raises
    ------
    RecordingError
        The run has none yet, or the file is not one.
    """
    path = folder.file(RESULT)
    if not path.exists():
        raise RecordingError(f"{folder.path}: no {RESULT} yet; the run ended before it had one")
    try:
        document = parse_json(folder.read(RESULT))
    except ConfigError as error:
        raise RecordingError(f"{path}: {error}; was it edited?") from None
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise RecordingError(f"{path}: not a result of this version ({SCHEMA!r} expected)")
    try:
        _Head.model_validate(document)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise RecordingError(f"{path}: {where}: {first['msg']}; was it edited?") from None
    return document


def write_result(folder: RunFolder, result: Result) -> Path:
    """Write `result.json` and `report.html` into a run folder; return the report's path.

    Raises
    ------
    RecordingError
        A file cannot be written; or a section, which was read from a file, cannot be shown.
    """
    text = json.dumps(result, ensure_ascii=False, indent=1, allow_nan=False) + "\n"
    path = folder.write(RESULT, text.encode())
    try:
        page = render_report(result)
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from error
    return folder.write(REPORT, page.encode())
