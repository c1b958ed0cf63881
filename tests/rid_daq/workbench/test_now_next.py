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
HIDDEN_PX = """() => document.querySelector("header").getBoundingClientRect().bottom
  + innerHeight - document.querySelector("footer").getBoundingClientRect().top"""
"""Height of the window that the header and STOP cover after scrolling [px]."""


def scroll_down(page: Page) -> None:
    page.evaluate("scrollTo(0, document.documentElement.scrollHeight)")
    page.wait_for_timeout(100)


@pytest.mark.parametrize("width", [390, 820, 1440])
def test_state_and_next_step_stay_visible_wherever_the_page_is_scrolled(
    open_page: OpenPage, width: int
) -> None:
    page = open_page(width=width)
    page.set_viewport_size({"width": width, "height": HEIGHT})
    line = page.locator("#now-next")
    expect(line).to_be_hidden()  # who does not hold the cell has no next step but to take it
    take_cell(page)
    expect(line).to_contain_text("Not ready: ")
    scroll_down(page)
    for part in (line, page.locator("#state"), page.locator("#stop")):
        expect(part).to_be_in_viewport(ratio=1.0)
    line.get_by_role("button", name="Check").click()
    expect(line).to_contain_text("Check: done")
    scroll_down(page)
    step = line.get_by_role("link", name="Record a motion")
    expect(step).to_be_in_viewport(ratio=1.0)
    assert page.evaluate(HIDDEN_PX) < 0.37 * HEIGHT
    step.click()
    expect(page.locator("h1")).to_have_text("Experiment")
    with page.expect_response(re.compile("/lease$")):
        give_back(page)


def test_a_page_without_the_job_shows_its_progress_and_leads_to_it(
    open_page: OpenPage, served_pages: ServedProcess, program_lease: str
) -> None:
    page = open_page(width=820)
    page.goto(served_pages.url.split("/?")[0] + "/cells/ir361/signals")
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
