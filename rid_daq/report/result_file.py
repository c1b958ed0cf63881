"""`result.json` and `report.html`: a result read from a run folder, and written into it."""

from __future__ import annotations

import json
import re
from datetime import UTC, datetime
from pathlib import Path

from pydantic import ValidationError

from acquisition.runs.folder import RunFolder
from config.errors import ConfigError, RecordingError
from config.formats.json_file import parse_json
from rid_daq.report.render import render_report
from rid_daq.report.result import SCHEMA, Result
from rid_daq.report.sections.timing import Timing

RESULT = "result.json"
REPORT = "report.html"


def read_result(folder: RunFolder) -> Result:
    """Return a run's result.

    Parameters
    ----------
    folder : RunFolder
        The run.

    Raises
    ------
    RecordingError
        The run has none yet, or the file is not one, or is of a newer version.
    """
    path = folder.file(RESULT)
    if not path.exists():
        raise RecordingError(f"{folder.path}: no {RESULT} yet; the run ended before it had one")
    data = folder.read(RESULT)
    try:
        document = parse_json(data)
    except ConfigError as error:
        raise RecordingError(f"{path}: {error}; was it edited?") from None
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        found = document.get("schema") if isinstance(document, dict) else None
        if isinstance(found, str) and re.fullmatch(r"rid-daq result \d{1,9}", found):
            raise RecordingError(
                f"{path}: is {found!r}, of a newer rid-daq; this one reads {SCHEMA!r}: install the"
                " newer one to read it"
            )
        raise RecordingError(f"{path}: not a result of rid-daq ({SCHEMA!r} expected)")
    try:
        return Result.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise RecordingError(
            f"{path}: {where}: {first['msg']}; was it edited, or is it of a newer rid-daq?"
        ) from None


def write_result(folder: RunFolder, result: Result) -> Path:
    """Write `result.json` and `report.html` into a run folder; return the report's path.

    A section that is new, or not as it was, gets the present time.

    Parameters
    ----------
    folder : RunFolder
        The run.
    result : Result
        Its result.

    Raises
    ------
    RecordingError
        A file cannot be written; or a section, which was read from a file, cannot be shown.
    """
    result = _dated(folder, result)
    document = result.model_dump(mode="json", by_alias=True)
    text = json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False) + "\n"
    path = folder.write(RESULT, text.encode())
    try:
        page = render_report(result)
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from error
    return folder.write(REPORT, page.encode())


def _dated(folder: RunFolder, result: Result) -> Result:
    """Return a result that says when each of its sections was made."""
    before = read_result(folder) if folder.file(RESULT).exists() else None
    known = {} if before is None or before.timing is None else before.timing.made or {}
    now = datetime.now(UTC).isoformat(timespec="seconds")
    made = {}
    for name, section in result.sections():
        as_before = before is not None and getattr(before, name) == section
        made[name] = known.get(name) if as_before else now
    known_times = {name: when for name, when in made.items() if when and name != "timing"}
    if not known_times:
        return result
    timing = (result.timing or Timing()).model_copy(update={"made": known_times})
    return result.updated(timing=timing)
