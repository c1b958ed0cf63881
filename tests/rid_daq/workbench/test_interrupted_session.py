"""A payload session whose page is reloaded and whose service is killed at every step."""

from __future__ import annotations

import shutil
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from rid_daq.service.records import CellState
from tests.rid_daq.service.conftest import ServedProcess, serve, serving
from tests.rid_daq.service.moving import until
from tests.rid_daq.workbench.conftest import checked, go_to, take_cell
from tests.rid_daq.workbench.test_work import fill_session

pytestmark = [pytest.mark.slow, pytest.mark.long]

CELL = "kr15"
OpenAddress = Callable[[str], Page]
STAGES = ("rehearse", "warm_up_without", "record_without", "attach", "warm_up_with record_with")
PATIENCE_S = 300.0


def open_payload_page(served: ServedProcess, open_page_of: OpenAddress) -> Page:
    """Open the Payload page of a user who holds the cell, which is ready to move."""
    page = open_page_of(served.url)
    with served.client as client:
        until(lambda: client.cell(CELL).lease is None)  # that of the killed service ends
    take_cell(page)
    if page.locator("#state").inner_text() == CellState.FAULT.value:
        page.locator("#reset").click()
        expect(page.locator("#job .verdict.end")).to_have_text("Reset: done")
    go_to(page, "Payload")
    checked(page)
    return page


def begin(page: Page) -> None:
    """Start a new session, or resume the interrupted one."""
    if page.locator(".resume").count():
        page.locator(".resume").click()
    else:
        page.locator("#motion").select_option("motion.yaml")
        page.locator("#practise").check()
        fill_session(page)
    page.locator("#begin").click()
    page.get_by_role("dialog").get_by_role("button", name="is clear: start").click()


def answer_until(page: Page, selector: str) -> None:
    """Answer every question with its first button until an element appears."""
    end_s = time.monotonic() + PATIENCE_S
    while page.locator(selector).count() == 0:
        assert time.monotonic() < end_s, page.locator("#job").inner_text()
        if page.locator("#job .answer").count():
            question = page.locator("#job .question").inner_text()
            page.locator("#job .answer").first.click()
            expect(page.locator("#job .question", has_text=question)).to_have_count(0)
        page.wait_for_timeout(100)


def test_no_step_is_lost(
    tmp_path: Path, open_page_of: OpenAddress, six_axis_motion: Callable[[int], Path]
) -> None:
    shutil.copy(six_axis_motion(3), tmp_path / "motion.yaml")
    for name in STAGES:
        served = serve(tmp_path, cell=CELL)
        try:
            page = open_payload_page(served, open_page_of)
            begin(page)
            answer_until(page, f"[data-stage='{name}'][data-state=now]")
            page.reload()
            expect(page.locator(f"[data-stage='{name}']")).to_have_attribute("data-state", "now")
            expect(page.locator("#now-next")).to_contain_text("Payload session")
            assert served.end(signal.SIGKILL) == -signal.SIGKILL
        finally:
            served.leave_nothing()
    with serving(tmp_path, cell=CELL) as served:
        page = open_payload_page(served, open_page_of)
        begin(page)
        answer_until(page, "#result .verdict")
        page.reload()
        page.locator("#certify").click()
        expect(page.get_by_role("link", name="Save the certificate")).to_be_visible()
