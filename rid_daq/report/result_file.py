"""`read_result`: reads the result of a run folder."""

from __future__ import annotations

import re

from pydantic import ValidationError

from acquisition.runs.folder import RunFolder
from config.errors import ConfigError, RecordingError
from config.formats.json_file import OTHER_FORMAT, other_format, parse_json
from config.wrong_value import explain_error
from rid_daq.report.result import SCHEMA, Result

RESULT = "result.json"
REPORT = "report.html"


def read_result(folder: RunFolder) -> Result:
    """Return the result of a run.

    Raises:
        RecordingError: The run has no result yet, the file is not a result or was changed, or
            another version of the program wrote it.
    """
    path = folder.file(RESULT)
    if not path.exists():
        raise RecordingError(
            f"{folder.path}: the run has no {RESULT}: it ended before a result was computed",
            code="RID-RUN-NO-RESULT",
        )
    data = folder.read(RESULT)
    try:
        document = parse_json(data)
    except ConfigError as error:
        raise RecordingError(
            f"{path}: {error}: the file may have been edited; compute the result again",
            code="RID-RESULT-UNSOUND",
        ) from None
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        found = document.get("schema") if isinstance(document, dict) else None
        if isinstance(found, str) and re.fullmatch(r"rid-daq result \d{1,9}", found):
            refused = other_format(f"{path}: a run's result", found, SCHEMA)
            raise RecordingError(str(refused), code=OTHER_FORMAT)
        raise RecordingError(
            f"{path}: the file is not a result of rid-daq (expected schema {SCHEMA!r})",
            code="RID-RESULT-UNSOUND",
        )
    try:
        return Result.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise RecordingError(
            f"{path}: {where}: {explain_error(first)}: the file was edited, or a newer version"
            " of rid-daq wrote it",
            code="RID-RESULT-UNSOUND",
        ) from None
