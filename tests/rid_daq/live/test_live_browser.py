"""The live page in a browser: it shows the joints, keeps its policy, and stops the motion."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Browser, expect

from acquisition.supervision.stop_reason import StopCode, StopReason
from rid_daq.web.access import Access
from tests.rid_daq.conftest import PATIENCE_MS
from tests.rid_daq.live.test_live_server import TOKEN, Served

pytestmark = pytest.mark.slow


def test_the_page_shows_the_joints_and_its_button_stops_the_motion(browser: Browser) -> None:
    live = Served(Access("127.0.0.1", 0, TOKEN))
    problems: list[str] = []
    page = browser.new_page()
    try:
        page.set_default_timeout(PATIENCE_MS)
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("console", lambda message: problems.append(message.text))
        page.goto(live.access.url)
        expect(page.locator("article")).to_have_count(3)
        expect(page.locator("#title")).to_contain_text("A <b>motion</b>")
        assert TOKEN not in page.url
        page.locator("#stop").click()
        expect(page.locator("#banner")).to_contain_text(re.compile("Stop requested"))
        assert live.control.program.stop_code == StopCode.STOP_BUTTON
        live.control.task.report_stop(StopReason(StopCode.STOP_BUTTON, "stopped by the page"))
        expect(page.locator("#banner")).to_contain_text("Stopped by the page")
    finally:
        page.close()
        live.close()
    assert problems == []


def test_a_dead_task_is_not_shown_as_drives_that_are_off(browser: Browser) -> None:
    live = Served(Access("127.0.0.1", 0, TOKEN))
    page = browser.new_page()
    try:
        page.set_default_timeout(PATIENCE_MS)
        page.goto(live.access.url)
        expect(page.locator("article")).to_have_count(3)
        live.control.program.declare_task_gone()
        expect(page.locator("#banner.bad")).to_contain_text("not confirmed")
    finally:
        page.close()
        live.close()
