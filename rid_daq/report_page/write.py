"""`write_result`: writes `result.json` and `report.html` into a run folder."""

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
    """Write `result.json` and `report.html` into a run folder and return the report's path.

    If the report cannot be rendered, neither file is written. Sections that are new or changed are
    marked with the present time.

    Raises:
        RecordingError: A file cannot be written, or a section cannot be shown.
    """
    # Imported late, because these imports take half a second.
    from rid_daq.report_page.render import render_report
    from rid_daq.report_page.run_head import run_head_blocks
    from rid_daq.report_page.run_robot import run_robot_blocks

    path = folder.file(RESULT)
    before = read_result(folder) if path.exists() else None
    result = _with_section_times(result, before)
    document = result.model_dump(mode="json", by_alias=True)
    text = json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False) + "\n"
    try:
        page = render_report(
            result, before, run_robot_blocks(folder, result), run_head_blocks(folder, result)
        )
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}", code=error.refusal) from error
    folder.write(RESULT, text.encode(), result.facts)
    return folder.write(REPORT, page.encode())


def _with_section_times(result: Result, before: Result | None) -> Result:
    """Return the result with the time at which each of its sections was made."""
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
    return result.with_sections(timing=timing)
