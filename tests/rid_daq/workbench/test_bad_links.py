"""Alarms, navigation and leases of the pages over bad links, and their timing."""

from __future__ import annotations

import contextlib
import re
import time
from datetime import UTC, datetime, timedelta
from functools import partial

import pytest
from playwright.sync_api import BrowserContext, Error, Page, expect

from tests.builders.bad_link import BadLink
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.service.moving import until
from tests.rid_daq.workbench.conftest import OpenByLink, go_to
from tests.rid_daq.workbench.stopped_motion import CELL, SOON_S, moving, press

pytestmark = [pytest.mark.slow, pytest.mark.alone]

NOTHING_MOVES = "This service moves nothing in cell ir361 now."
SLOW_3G = {"latency": 400, "downloadThroughput": 50_000, "uploadThroughput": 50_000}
TABS = ("Experiment", "Runs", "Identify", "Payload", "Settings", "Cell")
HAS_STOP = """before => performance.timeOrigin > before
  && document.getElementById("stop")?.checkVisibility()"""
NOTE_ALARMS = """() => {
  const reach = document.getElementById("reach");
  window.alarms = [];
  new MutationObserver(() => reach.hidden || window.alarms.push(reach.textContent)).observe(
    reach, { attributes: true, childList: true });
}"""


def throttled(page: Page) -> None:
    """Limit the page's link to slow 3G: 400 ms for each request, 50 kB per second."""
    session = page.context.new_cdp_session(page)
    session.send("Network.enable")
    session.send("Network.emulateNetworkConditions", {"offline": False, **SLOW_3G})


def has_stop(page: Page, before: float) -> bool:
    """Return True if a page that started after `before` is shown and has STOP."""
    with contextlib.suppress(Error):  # the page can change during the evaluation
        return bool(page.evaluate(HAS_STOP, before))
    return False


@pytest.mark.promise("alarms-end-with-their-cause")
def test_an_alarm_ends_when_the_service_answers_again(
    open_by_link: OpenByLink, link: BadLink
) -> None:
    page = open_by_link()
    words, reach = page.locator("#stop-words"), page.locator("#reach")
    expect(page.locator("#now")).not_to_have_text("…")
    link.cut()
    press(page)
    expect(words).to_contain_text("use the emergency stop", timeout=3000)
    expect(reach).to_contain_text("use the emergency stop")
    expect(page.locator("#now")).to_contain_text("Unknown")
    link.mend()
    expect(words).to_have_text(NOTHING_MOVES, timeout=10_000)
    expect(reach).to_be_hidden(timeout=10_000)
    expect(page.locator("#joints-words")).not_to_contain_text("NOT LIVE")
    expect(words).to_be_empty(timeout=15_000)


NEW_TAB = """() => document.querySelector("main").insertAdjacentHTML(
    "afterbegin", '<a id="apart" target="_blank" href="/api/v1/health">Health</a>')"""


@pytest.mark.promise("page-stays-with-stop")
def test_a_link_is_not_followed_while_the_service_is_out_of_reach(
    open_by_link: OpenByLink, link: BadLink
) -> None:
    page = open_by_link()
    expect(page.locator("#now")).not_to_have_text("…")
    runs, reach = page.get_by_role("link", name="Runs", exact=True), page.locator("#reach")
    link.cut()
    expect(reach).to_be_visible()
    runs.click()
    expect(reach).to_contain_text("stays open")
    page.evaluate(NEW_TAB)
    page.locator("#apart").click()
    expect(page).to_have_url(re.compile(f"/cells/{CELL}$"))
    expect(page.locator("#stop")).to_be_visible()
    assert len(page.context.pages) == 1
    link.mend()
    expect(reach).to_be_hidden(timeout=10_000)
    go_to(page, "Runs")


@pytest.mark.promise("page-stop-slow-link")
def test_stop_can_be_pressed_within_a_second_after_a_tab_change_on_slow_3g(
    open_by_link: OpenByLink, served_pages: ServedProcess, program_lease: str
) -> None:
    page = open_by_link()
    for tab in TABS:  # each page was opened once, so its files are cached
        go_to(page, tab)
        page.wait_for_load_state()
    throttled(page)
    took_s = {}
    for tab in TABS:
        old = page.evaluate("performance.timeOrigin")
        page.get_by_role("link", name=tab, exact=True).evaluate("link => { link.click(); }")
        clicked_s = time.monotonic()
        until(partial(has_stop, page, old))
        took_s[tab] = time.monotonic() - clicked_s
        expect(page.locator(f'nav a[aria-current]:text-is("{tab}")')).to_be_visible()
    assert max(took_s.values()) <= 1.0, took_s
    with moving(served_pages, program_lease) as motion:
        page.get_by_role("link", name="Experiment", exact=True).evaluate(
            "link => { link.click(); }"
        )
        page.wait_for_url("**/experiment", wait_until="commit")
        page.locator("#stop").wait_for()
        motion.require_stopped(press(page), SOON_S + 0.4)


@pytest.mark.promise("no-false-alarms")
def test_slow_3g_alone_raises_no_alarm_and_draws_the_figure(
    open_by_link: OpenByLink, served_pages: ServedProcess, program_lease: str
) -> None:
    page = open_by_link()
    throttled(page)
    with moving(served_pages, program_lease):
        go_to(page, "Experiment")
        page.evaluate(NOTE_ALARMS)
        page.locator("#motion").select_option("motion.yaml")
        shown = page.locator("#picture > [data-figure=motion][data-figure-state=shown]")
        expect(shown).to_be_visible(timeout=60_000)
        expect(page.locator("#picture")).to_contain_text("Duration")
        assert page.evaluate("window.alarms") == []


@pytest.mark.promise("ages-by-the-services-clock")
def test_a_tablet_with_a_wrong_clock_shows_correct_ages_and_its_time_zone(
    context: BrowserContext, served_pages: ServedProcess, program_lease: str
) -> None:
    with moving(served_pages, program_lease):  # now a preflight and a run exist
        pass
    context.clock.install(time=datetime.now(UTC) + timedelta(hours=2))
    page = context.new_page()
    page.goto(served_pages.url)
    expect(page.locator("#now")).to_have_text(re.compile(r"\b\d+ (s|min) ago"))
    zone = page.evaluate("""() => new Intl.DateTimeFormat("sv-SE", {
      timeZoneName: "short", timeZone: document.body.dataset.zone }).formatToParts()
      .find((part) => part.type === "timeZoneName").value""")
    expect(page.locator("#last-runs tbody tr").first).to_contain_text(zone)


@pytest.mark.promise("one-tab-has-the-lease")
def test_a_copy_of_a_tab_does_not_have_its_lease(
    context: BrowserContext, served_pages: ServedProcess
) -> None:
    first = context.new_page()
    first.goto(served_pages.url)
    first.locator("#lease-take, #lease-over").locator("visible=true").click()
    if first.locator("#name").is_visible():  # the program of earlier tests has the lease
        first.locator("#name").fill(CELL)
    first.get_by_role("dialog").locator("button[type=submit]").click()
    expect(first.locator("#lease-back")).to_be_visible()
    with context.expect_page() as opened:
        first.evaluate(
            "() => { window.open(location.href); }"
        )  # the new tab copies the storage of the first
    second = opened.value
    expect(second.locator("#lease-words")).to_contain_text(
        "Another page that is open on this device holds"
    )
    expect(second.locator("#lease-back")).to_be_hidden()
    first.reload()
    expect(first.locator("#lease-back")).to_be_visible()
    second.reload()
    expect(second.locator("#lease-over")).to_be_visible()
    first.locator("#lease-back").click()
    expect(second.locator("#lease-take")).to_be_visible()
