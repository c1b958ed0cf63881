"""A force plate's zero is written into the cell file by clicks, after a comparison."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from config.cell.plate import PlateZero
from config.load import load_cell
from tests.rid_daq.service.conftest import ServedProcess, serving
from tests.rid_daq.service.editing import write_cell
from tests.rid_daq.service.test_zero_change import ZERO, zero_run
from tests.rid_daq.workbench.conftest import OpenPage

pytestmark = pytest.mark.slow

WRITE = "Write the zero into the cell file"


@pytest.fixture(scope="module")
def served_pages(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedProcess]:
    """Run a service of a cell whose file is outside the service's folder."""
    folder = tmp_path_factory.mktemp("zeroed")
    (folder / "files").mkdir()
    (folder / "lab").mkdir()
    write_cell(folder / "files")
    with serving(folder / "lab", cell=str(cell_file(folder / "lab"))) as running:
        yield running


def cell_file(folder: Path) -> Path:
    return folder.parent / "files" / "cell.yaml"


def zero_in(path: Path) -> PlateZero | None:
    plate = load_cell(str(path)).config.plate
    assert plate is not None
    return plate.zero


def open_run(page: Page, served: ServedProcess, zero: PlateZero = ZERO) -> None:
    """Open the page of a run that has measured a zero."""
    run = zero_run(served.folder, cell_file(served.folder).read_bytes(), zero)
    page.goto(f"{served.url.split('/?')[0]}/cells/ir361/runs/{run}")


def test_old_and_new_values_are_compared_and_then_written(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    page, path = open_page(width=390), cell_file(served_pages.folder)
    open_run(page, served_pages)
    for answer in ("Cancel", "Write the zero"):
        assert zero_in(path) is None
        page.get_by_role("button", name=WRITE).click()
        row = page.locator(".dialog tr", has_text="fz4").locator("td")
        expect(row).to_have_text(["fz4", "none", "−1250.250", "none", "0.0"])
        width = page.locator(".dialog").evaluate("e => e.getBoundingClientRect().right")
        assert width <= 390
        page.get_by_role("button", name=answer, exact=True).click()
    check = page.get_by_role("button", name="Check the cell before the next motion")
    expect(check).to_be_visible()
    expect(page.get_by_role("button", name=WRITE)).to_be_hidden()
    assert zero_in(path) == ZERO
    open_run(page, served_pages, ZERO.model_copy(update={"offset_n": (7.0,) * 8}))
    page.get_by_role("button", name=WRITE).click()
    expect(page.locator(".dialog tr", has_text="fz4").locator("td").nth(1)).to_have_text(
        "−1250.250"
    )
    page.get_by_role("button", name="Cancel").click()
    open_run(page, served_pages)
    page.get_by_role("button", name=WRITE).click()
    expect(page.locator(".zero .verdict")).to_have_class(re.compile("good"))  # it is there already


def test_a_change_by_someone_else_is_told_and_kept(
    open_page: OpenPage, served_pages: ServedProcess, problems: list[str]
) -> None:
    page, path = open_page(), cell_file(served_pages.folder)
    open_run(page, served_pages, ZERO.model_copy(update={"offset_n": (9.0,) * 8}))
    page.get_by_role("button", name=WRITE).click()
    expect(page.locator(".dialog")).to_be_visible()
    changed = path.read_text() + "# of the other shift\n"
    path.write_text(changed)
    page.get_by_role("button", name="Write the zero", exact=True).click()
    expect(page.locator(".zero .problem")).not_to_be_empty()
    assert path.read_text() == changed
    problems.clear()
