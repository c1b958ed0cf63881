"""Every page in light and dark at three widths: no errors of the browser or of axe.

axe is a program that checks the accessibility of pages.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from rid_daq.report.result import Result
from rid_daq.report_page.write import write_result
from rid_daq.workbench.menu import MENU
from tests.builders.invented import whole_result
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.service.test_file_edits import MOTION
from tests.rid_daq.workbench.conftest import (
    OpenPage,
    checked,
    estimated,
    give_back,
    go_to,
    take_cell,
)

pytestmark = pytest.mark.slow

WIDTHS = (390, 820, 1440)
NARROWEST, WIDEST = 360, 1600
LARGE_ENOUGH_PX = 48
TARGETS = "button, .button, select, nav a, summary"
SMALL_TARGETS = f"""(least) => [...document.querySelectorAll({TARGETS!r})]
  .filter((each) => each.offsetParent !== null && each.getBoundingClientRect().height < least - 0.5)
  .map((each) => each.textContent.trim())"""
MENU_ROWS = """() => { const menu = document.querySelector("nav"), links = [...menu.children];
  if (menu.scrollWidth > menu.clientWidth) return 0;
  return new Set(links.map((each) => each.offsetTop)).size; }"""
ROWS = {390: 2, 820: 1, 1440: 1}
COMMAND = r"rid-daq [a-z]+"
SIDEWAYS = """() => [...document.querySelectorAll(".scroll:has(.stacked)")]
  .filter((each) => each.scrollWidth > each.clientWidth).length"""
UNEVEN = """() => [...document.querySelectorAll(".form")].flatMap((form) => {
  const heights = {};
  for (const control of form.querySelectorAll("label:not(.tick) > :is(input, select)")) {
    const top = control.closest("label").offsetTop;
    if (control.offsetParent) (heights[top] ??= new Set()).add(control.offsetTop);
  }
  return Object.values(heights).filter((each) => each.size > 1);
}).length"""
CUT_OFF = "() => document.documentElement.scrollWidth - document.documentElement.clientWidth"


def require_axe(page: Page) -> None:
    found = Axe().run(page)
    assert found.violations_count == 0, found.generate_report()


@pytest.fixture(scope="module")
def a_run(served_pages: ServedProcess) -> str:
    """Record an axis test and write two runs with estimates; return the id of the axis test."""
    client = served_pages.client
    with client, client.lease("ir361") as cell:
        cell.run("check").require_done()
        done = cell.run(
            "axes", {"unattended": True, "joints": ["axis1"]}, cleared=True
        ).require_done()
    assert done.job.run is not None
    for label, value in (("spring", 3.0), ("autumn", 4.0)):
        estimated(served_pages.folder / "runs", label, value)
    return done.job.run


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_every_page_is_accessible_and_fits_all_widths(
    open_page: OpenPage, served_pages: ServedProcess, a_run: str, screenshots: Path, dark: bool
) -> None:
    page = open_page(dark=dark)
    base = served_pages.url.split("/?")[0] + "/cells/ir361"
    paths = [entry.path for entry in MENU] + [
        *("/runs/history", f"/runs/{a_run}"),
        *("/operations", "/operations/retime", "/signals", "/edit/poses.yaml"),
    ]
    (served_pages.folder / "poses.yaml").write_text(MOTION)
    wrong = []
    for path in paths:
        page.goto(base + path)
        expect(page.locator("#lease-take")).to_be_visible()
        page.wait_for_load_state("networkidle")
        if path == "/runs/history":
            expect(page.locator('#history .figure[data-figure-state="shown"]')).to_be_visible()
        expect(page.get_by_text("…", exact=True)).to_have_count(0)  # everything is loaded
        told = re.findall(COMMAND, page.locator("main").inner_text())
        if told and not path.startswith(("/operations", "/settings")):  # settings: a new cell
            wrong.append(f"{path}: a terminal command instead of a button: {told}")
        name = (path.strip("/") or "cell").replace(a_run, "one").replace("/", "-")
        found = Axe().run(page)
        if found.violations_count:
            wrong.append(f"{name}: {found.generate_report()}")
        for width in (NARROWEST, WIDEST, *WIDTHS):
            page.set_viewport_size({"width": width, "height": 900})
            if page.evaluate(CUT_OFF):
                wrong.append(f"{name}: wider than {width} px")
            if width not in WIDTHS:
                continue
            if page.evaluate(SIDEWAYS):
                wrong.append(f"{name}: the table of runs scrolls sideways at {width} px")
            if page.evaluate(UNEVEN) and not path.startswith("/operations/"):
                wrong.append(f"{name}: fields of a row are not aligned at {width} px")
            if page.evaluate(MENU_ROWS) != ROWS[width]:
                wrong.append(f"{name}: unexpected number of menu rows at {width} px")
            small = page.evaluate(SMALL_TARGETS, LARGE_ENOUGH_PX)
            if small:
                wrong.append(
                    f"{name}: these controls are too small for gloves at {width} px: {small}"
                )
            colours = "dark" if dark else "light"
            page.screenshot(path=screenshots / f"{name}-{width}-{colours}.png", full_page=True)
    assert wrong == []


def test_dialogs_and_job_panels_are_accessible(open_page: OpenPage, screenshots: Path) -> None:
    page = open_page(width=820)
    take_cell(page)
    checked(page)
    page.screenshot(path=screenshots / "checked-820-light.png", full_page=True)
    require_axe(page)
    page.locator("#jog").click()
    expect(page.get_by_role("dialog")).to_be_visible()
    page.screenshot(path=screenshots / "clear-820-light.png")
    require_axe(page)
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_have_count(0)
    expect(page.locator("#jog")).to_be_focused()
    give_back(page)


def test_the_pairing_page_is_accessible(open_page: OpenPage, screenshots: Path) -> None:
    page = open_page(known=False, width=390)
    expect(page.locator("#words")).to_contain_text("Waiting")
    require_axe(page)
    page.screenshot(path=screenshots / "pair-390-light.png")


@pytest.mark.usefixtures("a_run")
def test_an_axis_test_is_not_offered_as_data_of_a_model(open_page: OpenPage) -> None:
    page = open_page()
    go_to(page, "Identify")
    expect(page.locator("#no-runs")).to_be_visible()
    expect(page.locator("#runs")).to_be_hidden()  # not an empty frame


def test_runs_can_be_searched(open_page: OpenPage, served_pages: ServedProcess, a_run: str) -> None:
    page = open_page()
    page.get_by_role("link", name="Runs", exact=True).click()
    row = page.locator("#runs tr", has_text="complete")
    expect(row).not_to_have_count(0)
    page.locator("#search").fill("nothing is called so")
    expect(page.locator("#runs")).to_have_text("No run matches this filter.")
    page.locator("#search").fill(a_run)
    expect(page.locator("#runs tbody tr")).to_have_count(1)
    page.locator("#runs tbody a").first.click()
    expect(page.get_by_role("link", name="recording.mcap")).to_be_visible()


def test_an_unknown_page_shows_an_error(
    open_page: OpenPage, served_pages: ServedProcess, problems: list[str]
) -> None:
    page = open_page()
    page.goto(served_pages.url.split("/?")[0] + "/cells/nowhere")
    expect(page.locator("main")).to_contain_text(
        "no cell 'nowhere' in this service; its cells are ir361"
    )
    problems.clear()  # the browser reports the 404


def test_a_report_from_the_service_is_interactive_and_has_a_null_origin(
    open_page: OpenPage, served_pages: ServedProcess, problems: list[str]
) -> None:
    folder = RunFolder.create(served_pages.folder / "runs", "reported")
    kept = ("schema", "title", "robot", "verdict", "software", "timing")
    document = {key: part for key, part in whole_result().items() if key in kept}
    write_result(folder, Result.model_validate_json(json.dumps(document)))
    folder.finish(RunStatus.COMPLETE)
    page = open_page()
    base = served_pages.url.split("/?")[0]
    page.goto(f"{base}/cells/ir361/runs/{folder.run_id}")
    with page.context.expect_page() as opened:
        page.get_by_role("link", name="Report", exact=True).click()
    page = opened.value
    page.on("pageerror", lambda error: problems.append(str(error)))
    expect(page.locator('.live[data-figure-state="shown"]')).to_have_count(1)
    assert page.evaluate("origin") == "null"
    assert problems == []
