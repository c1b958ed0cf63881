"""`read_result`: a result as a run folder keeps it."""

from __future__ import annotations

import re

from pydantic import ValidationError

from acquisition.runs.folder import RunFolder
from config.errors import ConfigError, RecordingError
from config.formats.json_file import OTHER_FORMAT, other_format, parse_json
from rid_daq.report.result import SCHEMA, Result

RESULT = "result.json"
REPORT = "report.html"


def read_result(folder: RunFolder) -> Result:
    """Return a run's result.

    Args:
        folder: The run.

    Raises:
        RecordingError: The run has none yet, or the file is not one, or is of a newer version.
    """
    path = folder.file(RESULT)
    if not path.exists():
        raise RecordingError(
            f"{folder.path}: no {RESULT} yet; the run ended before it had one",
            code="RID-RUN-NO-RESULT",
        )
    data = folder.read(RESULT)
    try:
        document = parse_json(data)
    except ConfigError as error:
        raise RecordingError(
            f"{path}: {error}; was it edited?", code="RID-RESULT-UNSOUND"
        ) from None
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        found = document.get("schema") if isinstance(document, dict) else None
        if isinstance(found, str) and re.fullmatch(r"rid-daq result \d{1,9}", found):
            refused = other_format(f"{path}: a run's result", found, SCHEMA)
            raise RecordingError(str(refused), code=OTHER_FORMAT)
        raise RecordingError(
            f"{path}: not a result of rid-daq ({SCHEMA!r} expected)", code="RID-RESULT-UNSOUND"
        )
    try:
        return Result.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise RecordingError(
            f"{path}: {where}: {first['msg']}; was it edited, or is it of a newer rid-daq?",
            code="RID-RESULT-UNSOUND",
        ) from None
