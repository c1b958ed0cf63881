"""A report contains sections of one model only; a newer model removes those of an older one."""

from __future__ import annotations

import json
from pathlib import Path

from acquisition.runs.folder import RunFolder
from rid_daq.report.model_file import BY_MODEL, ModelFile
from rid_daq.report.result import Result
from rid_daq.report.result_file import read_result
from rid_daq.report_page.write import write_result
from tests.builders.invented import whole_result


def full_result() -> Result:
    """Return a result with three of the sections that belong to a model."""
    return Result.model_validate_json(json.dumps(whole_result())).with_sections(
        model=ModelFile(name="model.json", sha256="1" * 64)
    )


def test_a_newer_model_removes_all_sections_of_the_older_one() -> None:
    old = full_result()
    new = old.with_model_sections(
        ModelFile(name="model.json", sha256="2" * 64), estimate=old.estimate
    )
    assert [name for name in BY_MODEL if getattr(new, name) is not None] == ["estimate"]
    assert new.verdict.passed is None
    assert new.verdict.headline == "Nothing to judge"
    assert new.title == f"Model of {old.robot}"
    assert new.notes is not None
    assert (
        "the sections of model.json (11111111) were removed (validation, curves)" in new.notes[-1]
    )
    assert (new.runs, new.average, new.tracking) == (old.runs, old.average, old.tracking)


def test_the_same_model_keeps_its_sections() -> None:
    old = full_result()
    assert old.model is not None
    assert old.with_model_sections(old.model, plate=None) == old.with_sections(plate=None)


def test_every_section_has_its_creation_time(tmp_path: Path) -> None:
    undrawn = full_result().with_sections(curves=None, truth=None, tracking=None)
    folder, result = RunFolder.create(tmp_path, "one"), undrawn
    timing = result.timing
    assert timing is not None
    write_result(folder, result)
    assert "model.json (11111111).</p>" in folder.read("report.html").decode()  # one time for all
    first = read_result(folder).timing
    assert first is not None
    assert first.made is not None
    assert set(first.made) == {name for name, _ in result.sections()} - {"timing"}
    early = dict.fromkeys(first.made, "2026-01-02T03:04:05+00:00")
    stored = json.loads(folder.read("result.json"))
    stored["timing"]["made"] = early
    folder.write("result.json", json.dumps(stored).encode())
    write_result(folder, result.with_sections(average=None))
    write_result(folder, result)
    again = read_result(folder).timing
    assert again is not None
    assert again.made is not None
    assert {n for n, when in again.made.items() if when != early[n]} == {"average"}
    page = folder.read("report.html").decode()
    assert "model.json (11111111), 2026-01-02 03:04 UTC." in page
