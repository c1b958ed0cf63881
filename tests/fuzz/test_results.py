"""A result.json that was changed at one place: its report is written, or refused with our error."""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path

from hypothesis import example, given, settings

from acquisition.runs.folder import RunFolder
from config.errors import RidDaqError
from rid_daq.report.result import read_result, write_result
from tests.builders.changed_json import changed
from tests.builders.invented import whole_result


def report_of(data: bytes) -> str:
    """Return what became of a report: done, or what was said."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # figures of absurd numbers
        run = RunFolder.create(Path(folder), "changed")
        run.write("result.json", data)
        try:
            write_result(run, read_result(run))
        except RidDaqError as error:
            return str(error)
    return "done"


@settings(max_examples=25, deadline=None, derandomize=True)
@given(changed(whole_result()))
@example(b"")
@example(b"[]")
@example(b"\xff")
@example(b"[" * 100_000)
def test_nothing_but_our_errors_comes_of_a_changed_result(data: bytes) -> None:
    said = report_of(data)
    assert said == "done" or "result.json" in said
