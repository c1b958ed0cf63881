"""Live signals are old after the end of a motion or of the service.

They are live while drives at rest are watched.
"""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import expect

from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.service.moving import begin_motion, leased_cell
from tests.rid_daq.workbench.conftest import OpenPage, take_cell

pytestmark = pytest.mark.slow

GAPS = """() => document.getElementById("signals").signals.plots.plots[0].plot.data[1]
  .filter((value) => value === null).length"""


def test_values_are_old_after_the_end_of_the_motion_and_of_the_service(
    served: ServedProcess, long_motion: str, open_page_of: OpenPage
) -> None:
    page = open_page_of(served.url)
    page.get_by_role("link", name="Plots over time").click()
    state = page.locator("#signal-state")
    with leased_cell(served, long_motion) as lease:
        job = begin_motion(served, lease)
        expect(state).to_have_attribute("data-kind", "live")
        with served.client as client:
            client.stop("ir361")
            client.follow(job)
        expect(state).to_have_attribute("data-kind", "old")
        expect(state).to_contain_text("No values are measured now. Newest values: ")
        page.locator("#zoom-out").click()
        begin_motion(served, lease)
        expect(state).to_have_attribute("data-kind", "live")
        page.wait_for_function(f"() => ({GAPS})() >= 1")  # no line between the two motions
    expect(state).to_have_attribute("data-kind", "old")
    served.process.kill()
    expect(state).to_contain_text("NOT LIVE: no values arrive from the service.")


def test_drives_are_watched_at_rest(served: ServedProcess, open_page_of: OpenPage) -> None:
    page = open_page_of(served.url)
    page.get_by_role("link", name="Plots over time").click()
    take_cell(page)
    page.locator("#watch").click()
    state = page.locator("#signal-state")
    expect(state).to_have_text("LIVE: values of the drives at rest.")
    expect(page.locator("#state")).to_have_text("checking")
    row = page.locator("#values tbody tr").first
    expect(row.locator("td").nth(0)).to_have_text(re.compile(r"^5\.7"))
    expect(row.locator("td").nth(1)).to_have_text(re.compile(r"^0\.0"))
    expect(row.locator("td").nth(3)).to_have_text("–")  # without set-points, no following error
    page.get_by_role("button", name="End this job").click()
    expect(page.locator("#job .verdict.end")).to_contain_text("Watch at rest: ")
    expect(state).to_have_attribute("data-kind", "old")
