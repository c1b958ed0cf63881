"""`write_result`: `result.json` and `report.html`, written into a run folder together."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

from acquisition.runs.folder import RunFolder
from config.errors import RecordingError
from rid_daq.report.result import Result
from rid_daq.report.result_file import REPORT, RESULT, read_result
from rid_daq.report.sections.timing import Timing


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
    from rid_daq.report_page.render import render_report  # it loads what draws: half a second

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
