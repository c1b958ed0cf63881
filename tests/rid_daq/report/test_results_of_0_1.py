"""Results that version 0.1 wrote: each is read without loss and gives the page that it gave.

The folder `results` holds one of each kind, as its commands wrote them on the bundled cells, long
curves cut to twelve values, and the text of the page that version 0.1 made of it.
"""

from __future__ import annotations

import html
import json
import re
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


def text_of(page: str) -> str:
    """Return the words and numbers of a page, a line a row or sentence, without its drawings."""
    page = re.sub(r"<(style|svg|script)\b.*?</\1>", "", page, flags=re.DOTALL)
    page = re.sub(r"</t[dh]>", " | ", page.replace("\n", " "))
    page = re.sub(r"<(?=(h1|h2|h3|p|tr|figcaption|li|div|section|header)\b)", "\n<", page)
    lines = (re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", line)) for line in page.split("\n"))
    return "".join(f"{html.unescape(line.strip())}\n" for line in lines if line.strip())


def with_kinds(value: Any) -> Any:
    """Return a document in which 1 and 1.0 differ."""
    if isinstance(value, dict):
        return {key: with_kinds(child) for key, child in value.items()}
    if isinstance(value, list):
        return [with_kinds(child) for child in value]
    return (type(value).__name__, value)


def test_every_section_is_there() -> None:
    found = {key for kind in KINDS for key in json.loads((WRITTEN / f"{kind}.json").read_text())}
    known = {field.alias or name for name, field in Result.model_fields.items()}
    assert known - found == {"notes", "model"}


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_read_and_written_without_loss_and_its_page_says_what_it_said(
    kind: str, tmp_path: Path
) -> None:
    folder = RunFolder.create(tmp_path, "old")
    old = (WRITTEN / f"{kind}.json").read_bytes()
    folder.write("result.json", old)
    page = write_result(folder, read_result(folder)).read_text(encoding="utf-8")
    assert with_kinds(json.loads(folder.read("result.json"))) == with_kinds(json.loads(old))
    assert text_of(page) == (WRITTEN / f"{kind}.txt").read_text(encoding="utf-8")
