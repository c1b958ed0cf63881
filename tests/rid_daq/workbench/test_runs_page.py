"""The page Runs: runs of the cell, in groups, with verdict and stop reason."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Page, expect
from pydantic import JsonValue

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from rid_daq.service.api.run_index import REPORT
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.workbench.conftest import OpenPage, go_to
from tests.rid_daq.workbench.test_every_page import SIDEWAYS

MANY = 120
HEADLINE = "The mass of the payload is 9.60 kg ± 0.11 kg"
TABLET_PX = 820


def recorded(
    root: Path, label: str, status: RunStatus = RunStatus.COMPLETE, **facts: JsonValue
) -> None:
    """Write a run of the served cell, or of the cell in `facts`."""
    RunFolder.create(root, label).finish(status, {"robot": "ir361", "cell": "ir361", **facts})


@pytest.fixture(scope="module")
def runs(served_pages: ServedProcess) -> Path:
    """Write old runs, an experiment, a run with only a report, a stopped run, and foreign runs."""
    root = served_pages.folder / "runs"
    for i in range(MANY):
        recorded(root, f"old {i}")
    recorded(root, "monday rehearsal", session="1", verdict="passed", headline="Good")
    recorded(root, "monday", session="1", verdict="not judged", headline=HEADLINE)
    earlier = RunFolder.create(root, "earlier")
    earlier.file(REPORT).write_text("<!doctype html>")
    earlier.finish(RunStatus.COMPLETE, {"robot": "ir361", "cell": "ir361"})
    recorded(root, "too fast", RunStatus.STOPPED, verdict="failed", why="axis2 is too fast")
    recorded(root, "imported", cell="")
    recorded(root, "of the other cell", cell="kr15", robot="kr15")
    recorded(root, "of the other robot", cell="", robot="kr15")
    return root


@pytest.fixture
def page(open_page: OpenPage, runs: Path) -> Page:
    page = open_page()
    go_to(page, "Runs")
    expect(page.locator("#runs tbody tr")).to_have_count(100)
    return page


def test_runs_of_other_cells_are_shown_only_on_request(page: Page) -> None:
    expect(page.get_by_role("link", name="imported", exact=True)).to_be_visible()
    others = page.get_by_role("link", name="of the other")
    expect(others).to_have_count(0)
    page.locator("#cell").select_option(label="all cells")
    expect(others).to_have_count(2)
    expect(page.locator("#runs th", has_text="cell")).to_be_visible()


def test_the_runs_of_an_experiment_can_be_unfolded(page: Page) -> None:
    part = page.get_by_role("link", name="monday rehearsal", exact=True)
    expect(part).to_have_count(0)
    fold = page.get_by_role("button", name="1 run with it, 1 passed")
    expect(fold).to_have_attribute("aria-expanded", "false")
    fold.click()
    expect(part).to_be_visible()
    expect(fold).to_have_attribute("aria-expanded", "true")
    fold.click()
    expect(part).to_have_count(0)


def test_verdict_and_stop_reason_are_words(page: Page) -> None:
    page.locator("#verdict").select_option("failed")
    rows = page.locator("#runs tbody tr")
    expect(rows).to_have_count(1)
    expect(rows).to_contain_text("✗ failed")
    expect(rows).to_contain_text("axis2 is too fast")


def test_a_run_of_an_earlier_version_refers_to_its_report(page: Page) -> None:
    page.locator("#search").fill("earlier")
    row = page.locator("#runs tbody tr")
    expect(row).to_have_count(1)
    expect(row).to_contain_text("unknown")
    row.get_by_role("link", name="earlier").click()
    expect(page.locator("main .verdict")).to_contain_text("report")


def test_more_runs_are_loaded_on_request(page: Page) -> None:
    page.get_by_role("button", name="Show more").click()
    expect(page.locator("#runs tbody tr")).to_have_count(MANY + 4)
    expect(page.get_by_role("button", name="Show more")).to_have_count(0)
    page.locator("#search").fill("old 11")
    expect(page.locator("#runs tbody tr")).to_have_count(11)


def test_a_list_that_did_not_load_can_be_requested_again(page: Page, problems: list[str]) -> None:
    page.route("**/run-groups?*", lambda route: route.abort())
    page.locator("#search").fill("old 11")
    expect(page.locator("#runs .problem")).to_be_visible()
    page.unroute("**/run-groups?*")
    page.get_by_role("button", name="Try again").click()
    expect(page.locator("#runs tbody tr")).to_have_count(11)
    problems.clear()  # the browser reports the aborted request


def test_the_table_fits_on_a_tablet(page: Page) -> None:
    page.set_viewport_size({"width": TABLET_PX, "height": 1180})
    page.get_by_role("button", name="1 run with it, 1 passed").click()
    assert not page.evaluate(SIDEWAYS)
