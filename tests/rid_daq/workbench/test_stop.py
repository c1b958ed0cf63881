"""STOP of the pages over stalled or slow links, and on incomplete pages.

Most tests press STOP during a motion, and measure when the driving process receives it.
"""

from __future__ import annotations

import re
import time

import pytest
from playwright.sync_api import BrowserContext, Route, expect

from tests.builders.bad_link import BadLink
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.workbench.conftest import OpenByLink, go_to
from tests.rid_daq.workbench.stopped_motion import SOON_S, moving, press, words_of

pytestmark = [pytest.mark.slow, pytest.mark.alone]

STOPPED = re.compile("Stop requested")
NOTHING_MOVES = "This service moves nothing in cell ir361 now."


@pytest.mark.promise("page-stop-any-channel")
@pytest.mark.parametrize(
    "stalled",
    [
        "^/api/v1/ws$",
        "^/api/v1/stop-line$",
        "^/api/v1/(cells|jobs|runs)",
        "^/api/v1/(cells|jobs|runs|stop-line)",
        "^/api/v1/(ws|stop-line)$",
    ],
    ids=["values", "stop-line", "requests", "stop-line and requests", "both WebSockets"],
)
def test_stop_arrives_over_any_channel_that_works(
    open_by_link: OpenByLink,
    link: BadLink,
    served_pages: ServedProcess,
    program_lease: str,
    stalled: str,
) -> None:
    page = open_by_link()
    with moving(served_pages, program_lease) as motion:
        expect(page.locator("#state")).to_have_text("moving")
        link.stall(stalled)
        if stalled != "^/api/v1/stop-line$":
            expect(page.locator("#reach")).to_be_visible(timeout=5000)
        motion.require_stopped(press(page))
        expect(page.locator("#stop-words")).to_have_text(STOPPED)


@pytest.mark.promise("page-stop-before-requests")
def test_hanging_searches_do_not_delay_stop(
    open_by_link: OpenByLink, link: BadLink, served_pages: ServedProcess, program_lease: str
) -> None:
    page = open_by_link()
    go_to(page, "Runs")
    expect(page.locator("#runs")).not_to_be_empty()
    link.stall("^/api/v1/run|^/api/v1/stop-line$|^/api/v1/ws$")  # STOP can only use requests
    with moving(served_pages, program_lease) as motion:
        for letter in "ninewords":
            page.locator("#search").press(letter)
            page.wait_for_timeout(300)
        searches = [path for path in link.paths if path.startswith("/api/v1/run-groups?search=n")]
        assert len(searches) > 3
        motion.require_stopped(press(page))
        expect(page.locator("#stop-words")).to_have_text(STOPPED)


@pytest.mark.promise("page-stop-alone")
@pytest.mark.parametrize("missing", ["dialog", "awake", "service", "dom", "shell", "requests"])
def test_stop_works_on_an_incomplete_page_which_shows_a_warning(
    context: BrowserContext,
    open_by_link: OpenByLink,
    served_pages: ServedProcess,
    program_lease: str,
    missing: str,
) -> None:
    context.route(f"**/{missing}.js", lambda route: route.abort())
    page = open_by_link()
    expect(page.locator("#page-broken")).to_contain_text("reload")
    with moving(served_pages, program_lease) as motion:
        motion.require_stopped(press(page))
        expect(page.locator("#stop-words")).to_have_text(STOPPED)


@pytest.mark.promise("page-stop-alone")
def test_stop_works_if_another_script_fails(
    context: BrowserContext,
    open_by_link: OpenByLink,
    served_pages: ServedProcess,
    program_lease: str,
) -> None:
    def fail(route: Route) -> None:
        route.fulfill(content_type="text/javascript", body='throw new Error("made by the test");')

    context.route("**/shell.js", fail)
    page = open_by_link()
    expect(page.locator("#page-broken")).to_contain_text("reload")
    with moving(served_pages, program_lease) as motion:
        motion.require_stopped(press(page))


@pytest.mark.promise("page-stop-alone")
def test_a_page_without_its_stop_script_shows_a_warning(
    context: BrowserContext, open_by_link: OpenByLink
) -> None:
    context.route("**/stop.js", lambda route: route.abort())
    page = open_by_link()
    expect(page.locator("#stop-missing")).to_contain_text("use the emergency stop")
    expect(page.locator("#stop")).to_be_hidden()


@pytest.mark.promise("page-stop-words-are-true")
def test_an_unanswered_stop_is_repeated_until_it_is_acknowledged(
    open_by_link: OpenByLink, link: BadLink, served_pages: ServedProcess, program_lease: str
) -> None:
    page = open_by_link()
    words = page.locator("#stop-words")
    with moving(served_pages, program_lease) as motion:
        link.stall("/api/")
        pressed_s = press(page)
        assert words_of(page) == "Sending the stop request…"
        expect(words).to_contain_text("use the emergency stop. This page repeats", timeout=3000)
        assert time.monotonic() - pressed_s >= 1.9
        assert not motion.stopped.is_set()
        mended_s = time.monotonic()
        link.mend()
        motion.require_stopped(mended_s, 1.0)
        expect(words).to_have_text(STOPPED)
    expect(words).to_be_empty(timeout=15_000)


@pytest.mark.promise("page-stop-words-are-true")
def test_an_unanswered_stop_continues_on_the_next_page(
    open_by_link: OpenByLink, link: BadLink, served_pages: ServedProcess, program_lease: str
) -> None:
    page = open_by_link()
    with moving(served_pages, program_lease) as motion:
        link.stall("^/api/v1/(cells/[^/]+/stop|stop-line|ws)$")
        press(page)
        go_to(page, "Runs")
        assert not motion.stopped.is_set()
        mended_s = time.monotonic()
        link.mend()
        motion.require_stopped(mended_s, 1.5)
        expect(page.locator("#stop-words")).to_have_text(STOPPED)


@pytest.mark.promise("page-stop-words-are-true")
def test_delayed_data_do_not_make_an_acknowledged_stop_fail(
    open_by_link: OpenByLink, link: BadLink, served_pages: ServedProcess, program_lease: str
) -> None:
    page = open_by_link()
    expect(page.locator("#now")).not_to_have_text("…")
    link.make_late(0.25, 0.3, 2.4)
    with moving(served_pages, program_lease) as motion:
        motion.require_stopped(press(page), SOON_S + 2.4)
        expect(page.locator("#stop-words")).to_have_text(STOPPED, timeout=10_000)
    for _ in range(4):
        expect(page.locator("#stop-words")).to_be_empty(timeout=15_000)
        press(page)
        shown = set()
        while (words := words_of(page)) != NOTHING_MOVES:
            shown.add(words)
            page.wait_for_timeout(20)
        assert not any("Not stopped" in each for each in shown)


@pytest.mark.promise("page-stop-everywhere")
def test_pages_of_a_revoked_device_and_unknown_addresses_stop_all_cells(
    open_by_link: OpenByLink, link: BadLink, served_pages: ServedProcess, program_lease: str
) -> None:
    page = open_by_link()
    base = f"http://127.0.0.1:{link.port}"
    with served_pages.client as client:
        newest = max(client.ask("GET", "/tokens"), key=lambda token: float(token["created_s"]))
        client.ask("DELETE", f"/tokens/{newest['id']}")
    expect(page).to_have_url(re.compile("/pair$"))
    for address in (None, "/no/such/page"):
        if address is not None:
            page.goto(base + address)
        expect(page.locator("#stop")).to_contain_text("STOP all cells")
        with moving(served_pages, program_lease) as motion:
            motion.require_stopped(press(page))
            expect(page.locator("#stop-words")).to_have_text(STOPPED)


@pytest.mark.promise("page-stop-everywhere")
def test_a_page_has_stop_while_it_loads_with_a_session_secret(
    open_by_link: OpenByLink, link: BadLink, served_pages: ServedProcess, program_lease: str
) -> None:
    page = open_by_link()
    before = len(link.paths)
    link.stall_after(1, "^/cells/ir361/runs$")  # the first request, without the secret, passes
    page.get_by_role("link", name="Runs", exact=True).click()
    expect(page.locator("#login-words")).to_have_text("Loading…")
    assert link.paths[before:].count("/cells/ir361/runs") >= 1
    with moving(served_pages, program_lease) as motion:
        motion.require_stopped(press(page))
        expect(page.locator("#stop-words")).to_have_text(STOPPED)
    link.mend()
    expect(page.locator('nav a[aria-current]:text-is("Runs")')).to_be_visible()
