"""A result of each kind: read without loss, and drawn on a page.

The folder `results` contains a result of each kind, written by its command on a bundled cell.
Long curves are shortened to twelve values.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from acquisition.runs.folder import RunFolder
from rid_daq.report.result import Result
from rid_daq.report.result_file import read_result
from rid_daq.report_page.write import write_result

pytestmark = pytest.mark.slow

WRITTEN = Path(__file__).parent / "results"
KINDS = sorted(path.stem for path in WRITTEN.glob("*.json"))


def with_kinds(value: Any) -> Any:
    """Return a document in which the numbers 1 and 1.0 are distinguishable."""
    if isinstance(value, dict):
        return {key: with_kinds(child) for key, child in value.items()}
    if isinstance(value, list):
        return [with_kinds(child) for child in value]
    return (type(value).__name__, value)


def test_the_results_cover_every_section() -> None:
    found = {key for kind in KINDS for key in json.loads((WRITTEN / f"{kind}.json").read_text())}
    known = {field.alias or name for name, field in Result.model_fields.items()}
    assert known - found == {"notes", "model"}


@pytest.mark.parametrize("kind", KINDS)
def test_a_result_is_restored_exactly_and_its_page_shows_the_verdict(
    kind: str, tmp_path: Path
) -> None:
    folder = RunFolder.create(tmp_path, "kept")
    kept = (WRITTEN / f"{kind}.json").read_bytes()
    folder.write("result.json", kept)
    page = write_result(folder, read_result(folder)).read_text(encoding="utf-8")
    document = json.loads(kept)
    assert with_kinds(json.loads(folder.read("result.json"))) == with_kinds(document)
    assert document["title"] in page
    assert document["verdict"]["headline"] in page
