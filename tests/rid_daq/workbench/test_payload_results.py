"""Results of a payload session are reachable by clicks, after a reload and a restart too."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta, timezone
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from acquisition.runs.catalogue import list_runs
from tests.builders.certified import certified_session
from tests.rid_daq.service.conftest import serve, serving
from tests.rid_daq.workbench.conftest import go_to

pytestmark = pytest.mark.slow

LABEL = "gripper 4"
OpenAddress = Callable[[str], Page]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a service's folder with a finished session."""
    certified_session(tmp_path / "runs", LABEL)
    return tmp_path


def expect_results(page: Page) -> None:
    """Check that the page shows verdict, certificate, load data and comparison of the session."""
    expect(page.locator("#result .verdict").first).to_contain_text("✓ Passed: the payload's mass")
    expect(page.get_by_role("link", name="Save the certificate")).to_be_visible()
    expect(page.locator("#load-data pre")).to_contain_text("LOAD_DATA[1]")
    expect(page.locator("#compared .verdict")).to_contain_text("✓ Passed")


def test_results_survive_a_reload_and_a_restart_of_the_service(
    folder: Path, open_page_of: OpenAddress
) -> None:
    first = serve(folder, cell="kr15")
    try:
        page = open_page_of(first.url)
        go_to(page, "Runs")
        page.get_by_role("link", name=LABEL, exact=True).click()
        page.get_by_role("link", name="Result, certificate and load data").click()
        page.locator("#certify").click()
        page.locator("#export").click()  # before the certificate is written
        expect(page.get_by_role("link", name="Save the certificate")).to_be_visible()
        page.locator("#typed").fill(page.locator("#load-data pre").inner_text())
        page.locator("#read-back").click()
        expect(page.locator("#now-next a.main")).to_have_attribute("href", "#compared")
        expect_results(page)
        page.reload()
        expect_results(page)
    finally:
        first.leave_nothing()
    with serving(folder, cell="kr15") as second:
        page = open_page_of(second.url)
        go_to(page, "Payload")
        expect(page.locator("#result-card")).to_be_hidden()
        page.locator("#finished").get_by_role("link", name=LABEL).click()
        expect_results(page)


def test_a_result_that_loads_or_fails_says_so_and_can_be_requested_again(
    folder: Path, open_page_of: OpenAddress
) -> None:
    with serving(folder, cell="kr15") as served:
        page = open_page_of(served.url)
        go_to(page, "Payload")
        held: list[Route] = []

        def hold(route: Route) -> None:
            held.append(route)

        page.route("**/blocks/runs/**", hold)
        with page.expect_request("**/blocks/runs/**"):
            page.locator("#finished").get_by_role("link", name=LABEL).click()
        expect(page.locator("#result [role=status]")).to_be_visible()
        expect(page.locator("#papers")).to_be_hidden()
        held.pop().fulfill(status=500, body="")
        expect(page.locator("#result [role=alert]")).to_contain_text("500")
        page.unroute("**/blocks/runs/**")
        page.locator("#result").get_by_role("button", name="Try again").click()
        expect(page.locator("#result .verdict").first).to_contain_text("✓ Passed")
        expect(page.locator("#result [role=alert]")).to_have_count(0)
        expect(page.locator("#papers")).to_be_visible()


def test_times_are_those_of_the_service_with_their_zone(
    folder: Path, browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    ((_, session),) = [run for run in list_runs(folder / "runs") if run[1].label == LABEL]
    started = datetime.fromisoformat(session.created_utc)
    monkeypatch.setenv("TZ", "Asia/Kolkata")
    with serving(folder, cell="kr15") as served:
        context = browser.new_context(timezone_id="America/New_York")
        page = context.new_page()
        page.goto(served.url)
        local = started.astimezone(timezone(timedelta(hours=5, minutes=30)))
        expected = f"{local:%Y-%m-%d %H:%M}"
        go_to(page, "Runs")
        row = page.locator("#runs tbody tr", has=page.get_by_role("link", name=LABEL, exact=True))
        expect(row).to_contain_text(f"{expected} GMT+5:30")
        page.get_by_role("link", name=LABEL, exact=True).click()
        expect(page.locator("dl.facts")).to_contain_text(f"{expected} IST")
        context.close()
