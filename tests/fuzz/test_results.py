"""A result.json with one changed value gives a report, or one of the project's own errors."""

from __future__ import annotations

import json
import tempfile
import warnings
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings

from acquisition.runs.folder import RunFolder
from config.errors import RidDaqError
from rid_daq.report.result import Result
from rid_daq.report.result_file import read_result
from rid_daq.report_page.write import write_result
from tests.builders.changed_json import changes
from tests.builders.invented import whole_result

pytestmark = pytest.mark.slow

WHOLE = whole_result()
HEAD = {"title", "robot", "verdict", "software"}


def report_of(data: bytes) -> str:
    """Return the outcome of a report: done, or the error message.

    Each section has a separate page and drawings; unchanged sections are not drawn again.
    """
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # drawings of absurd numbers cause warnings
        run = RunFolder.create(Path(folder), "changed")
        run.write("result.json", data)
        try:
            result = read_result(run)
            write_result(run, result.with_sections(**dict.fromkeys(unchanged_sections(result))))
        except RidDaqError as error:
            return str(error)
    return "done"


def unchanged_sections(result: Result) -> set[str]:
    """Return the names of the sections that equal those of the unchanged result."""
    document: dict[str, Any] = result.model_dump(mode="json", by_alias=True)
    return {name for name in document.keys() - HEAD - {"schema"} if document[name] == WHOLE[name]}


@settings(max_examples=60)
@given(changes(WHOLE))
@example(b"")
@example(b"[]")
@example(b"\xff")
@example(b"[" * 100_000)
@example(json.dumps(WHOLE).encode())
def test_a_changed_result_causes_only_our_errors(data: bytes) -> None:
    outcome = report_of(data)
    assert outcome == "done" or "result.json" in outcome
