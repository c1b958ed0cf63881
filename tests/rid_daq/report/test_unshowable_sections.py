"""Sections that are hard to draw have a page.

If a section cannot be drawn, no report is written.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from config.errors import RecordingError
from rid_daq.report.result import Result
from rid_daq.report.section_blocks.tracking import path_plots
from rid_daq.report.sections.tracking import PathCurves, TrackingSection
from rid_daq.report_page.write import write_result
from tests.builders.invented import whole_result
from tests.builders.raised_codes import raises_code

Columns = tuple[tuple[float, ...], ...]
FLAT: Columns = ((0.0,) * 100, (0.1,) * 100)
"""An invalid path: it has only two coordinates [m]."""


def empty_result() -> Result:
    whole = whole_result()
    kept = {key: whole[key] for key in ("schema", "title", "robot", "verdict", "software")}
    return Result.model_validate_json(json.dumps(kept))


def tracking(wanted_m: Columns) -> TrackingSection:
    """Return a tracking section with invented numbers for one motion and this path of the tool."""
    section = Result.model_validate_json(json.dumps(whole_result())).tracking
    assert section is not None
    motion = section.motions[0]
    drawn = motion.drawn
    assert drawn.before is not None

    def along(curves: PathCurves) -> PathCurves:
        return curves.model_copy(update={"wanted_m": wanted_m})

    changed = {"after": along(drawn.after), "before": along(drawn.before)}
    other = motion.model_copy(update={"drawn": drawn.model_copy(update=changed)})
    return section.model_copy(update={"motions": (other,)})


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    return RunFolder.create(tmp_path, "test")


@pytest.mark.parametrize("shake_m", [0.0, 1e-16])
def test_a_tool_point_at_rest_has_a_page_without_a_scale_bar(
    folder: RunFolder, shake_m: float
) -> None:
    """Only one joint moves, and the tool point is on the axis of this joint."""
    still = tracking(tuple((at, at + shake_m) * 50 for at in (0.0, 0.5, 1.7)))
    for panel in path_plots(still.motions[0], still.joints)[0].panels:
        assert not panel.marks
        assert "scale" not in [line.label for line in panel.lines]
    page = write_result(folder, empty_result().with_sections(tracking=still)).read_text()
    assert "Path errors" in page
    assert "of deviation" not in page


def test_a_new_section_that_cannot_be_drawn_leaves_the_run_unchanged(folder: RunFolder) -> None:
    write_result(folder, empty_result())
    before = {name: folder.read(name) for name in ("result.json", "report.html")}
    with raises_code(RecordingError, "RID-RESULT-UNSOUND", "result.json", "tracking") as caught:
        write_result(folder, empty_result().with_sections(tracking=tracking(FLAT)))
    assert str(caught.value).endswith("; nothing was written")
    assert {name: folder.read(name) for name in before} == before


def test_an_existing_section_that_cannot_be_drawn_is_reported_as_edited(folder: RunFolder) -> None:
    edited = empty_result().with_sections(tracking=tracking(FLAT))
    folder.write("result.json", edited.model_dump_json(by_alias=True).encode())
    with raises_code(RecordingError, "RID-RESULT-UNSOUND", "tracking: ", "edited"):
        write_result(folder, edited)
