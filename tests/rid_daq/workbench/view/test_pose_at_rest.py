"""The pose of a robot at rest is live while the drives are read without power."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.builders.browser_drawing import wait_for_picture
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.workbench.conftest import OpenPage, give_back, take_cell

pytestmark = pytest.mark.slow


def test_the_pose_is_live_while_the_drives_are_read(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    page = open_page()
    wait_for_picture(page)
    take_cell(page)
    state = page.locator("#view .view-state")
    expect(state).to_contain_text("NO LIVE DATA")
    page.locator("#watch").click()
    expect(state).to_have_text("LIVE: measured pose")
    expect(page.locator("#state")).to_have_text("checking")  # nothing moves
    page.locator("#stop").click()
    expect(state).to_contain_text("NO LIVE DATA: last measured pose")
    with served_pages.client as client:
        assert client.ask("GET", "/runs") == []  # nothing is recorded
    give_back(page)
