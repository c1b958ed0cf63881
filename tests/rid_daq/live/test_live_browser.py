"""The live page in a browser: it shows the joints, keeps its policy, and stops the motion."""

from __future__ import annotations

import re
import shutil

import pytest
from playwright.sync_api import expect, sync_playwright

from acquisition.supervision.stop_reason import StopCode, StopReason
from rid_daq.live.access import Access
from tests.rid_daq.live.test_live_server import TOKEN, Served

pytestmark = pytest.mark.slow

PATIENCE_MS = 120_000
QUIET = (
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)


def test_the_page_shows_the_joints_and_its_button_stops_the_motion() -> None:
    chromium = shutil.which("chromium")
    assert chromium is not None, "this test needs chromium; on Debian: apt install chromium"
    live = Served(Access("127.0.0.1", 0, TOKEN))
    problems: list[str] = []
    try:
        with sync_playwright() as driver:
            browser = driver.chromium.launch(executable_path=chromium, args=list(QUIET))
            page = browser.new_page()
            page.set_default_timeout(PATIENCE_MS)
            expect.set_options(timeout=PATIENCE_MS)
            page.on("pageerror", lambda error: problems.append(str(error)))
            page.on("console", lambda said: problems.append(said.text))
            page.goto(live.access.url)
            expect(page.locator("article")).to_have_count(3)
            expect(page.locator("#title")).to_contain_text("A <b>motion</b>")
            assert TOKEN not in page.url
            page.locator("#stop").click()
            expect(page.locator("#banner")).to_contain_text(re.compile("Asked to stop"))
            assert live.control.program.stop_code == StopCode.STOP_BUTTON
            live.control.task.report_stop(StopReason(StopCode.STOP_BUTTON, "stopped by the page"))
            expect(page.locator("#banner")).to_contain_text("Stopped by the page")
            browser.close()
    finally:
        live.close()
    assert problems == []
