"""The line "now and next" of the header: state, progress, time left and the next button."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Page, expect

from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.service.moving import begin_motion
from tests.rid_daq.workbench.conftest import OpenPage, give_back, go_to, take_cell

pytestmark = pytest.mark.slow

HEIGHT = 844
MOST_HIDDEN_PX = 300
HIDDEN_PX = """() => document.querySelector("header").getBoundingClientRect().bottom
  + innerHeight - document.querySelector("footer").getBoundingClientRect().top"""
"""Height of the part of the window that the header and STOP cover [px]."""


SIZES = ((390, 844), (820, 1180), (1440, 900), (844, 390))


def require_visible(page: Page, *parts: str) -> None:
    """Assert that parts of the page are visible at its beginning and end, on four screens."""
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        for place in ("0", "document.documentElement.scrollHeight"):
            page.evaluate(f"scrollTo(0, {place})")
            for part in parts:
                expect(page.locator(part)).to_be_in_viewport(ratio=1.0)
    page.set_viewport_size({"width": 390, "height": HEIGHT})


def test_state_and_next_step_stay_visible_wherever_the_page_is_scrolled(
    open_page: OpenPage,
) -> None:
    page = open_page()
    line = page.locator("#now-next")
    expect(line).to_be_hidden()  # who does not hold the cell has no next step but to take it
    take_cell(page)
    expect(line).to_contain_text("Not ready: ")
    require_visible(page, "#state", "#now-next", "#now-next button", "#stop")
    line.get_by_role("button", name="Check").click()
    expect(line).to_contain_text("Check: done")
    require_visible(page, "#state", "#now-next", "#now-next a", "#stop")
    page.evaluate("scrollTo(0, document.documentElement.scrollHeight)")
    assert page.evaluate(HIDDEN_PX) < MOST_HIDDEN_PX
    line.get_by_role("link", name="Record a motion").click()
    expect(page.locator("h1")).to_have_text("Experiment")
    give_back(page)


@pytest.mark.parametrize(
    ("tab", "target"), [("Experiment", "#drive-title"), ("Payload", "#prepare")]
)
def test_a_check_leads_to_the_start_of_the_motion_on_the_same_page(
    open_page: OpenPage, tab: str, target: str
) -> None:
    page = open_page()
    take_cell(page)
    go_to(page, tab)
    page.locator("#check").click()
    expect(page.locator("#now-next")).to_contain_text("Check: done")
    expect(page.locator("#now-next a.main")).to_have_attribute("href", target)
    give_back(page)


def test_a_page_without_the_job_shows_its_progress_and_leads_to_it(
    open_page: OpenPage, served_pages: ServedProcess, program_lease: str
) -> None:
    page = open_page(width=820)
    page.goto(served_pages.url.split("/?")[0] + "/cells/ir361/settings")
    begin_motion(served_pages, program_lease)
    line = page.locator("#now-next")
    expect(line).to_contain_text("Record")
    expect(line.locator(".left")).to_contain_text(re.compile(r"\d+ (s|min) left"))
    expect(line.locator("progress")).to_have_attribute("value", re.compile(r"0\.\d+"))
    line.get_by_role("link", name="Show").click()
    expect(page.locator("#job .count")).to_contain_text("left")
    expect(line).to_contain_text("left")
    go_to(page, "Settings")
    expect(line).to_contain_text("left")
    page.locator("#stop").click()
    expect(line).to_be_hidden()  # the page has no panel that shows the end of the job
