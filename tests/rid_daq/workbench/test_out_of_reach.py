"""A page that loses its connection while the robot moves, and a page in the background."""

from __future__ import annotations

import contextlib
import os
import re
import signal
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from rid_daq.service.records import Job
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.service.moving import is_in_motion, until
from tests.rid_daq.workbench.conftest import OpenPage, ready, take_cell

pytestmark = pytest.mark.slow

CELL = "ir361"
BEGIN = """async (pace) => {
  const { JobPanel } = await import("/static/job_panel.js");
  const panel = new JobPanel(document.getElementById("job"));
  const request = { motion: "motion.yaml", simulation: { pace } };
  void panel.begin("record", request, { moves: true });
}"""
"""Start a motion with the page's panel, which asks what to do if the connection is lost."""

TIMERS_STAND = "window.setInterval = () => 0;"
"""Make `setInterval` do nothing, which is more than browsers do to a page in the background."""


def start_motion(page: Page, served: ServedProcess, policy: str, pace: float) -> Job:
    """Start a motion with a policy in the page's dialog; return the job when the robot moves."""
    page.evaluate(BEGIN, pace)
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("If the connection to this page is lost").select_option(policy)
    dialog.get_by_role("button", name="is clear: start").click()
    expect(page.locator("#state")).to_have_text("moving")
    with served.client as client:
        job = client.cell(CELL).job
        assert job is not None
        assert job.on_lost_client == policy
        pid = job.pid
        assert pid is not None
        until(lambda: is_in_motion(pid))
    return job


def shorten_lease(page: Page, served: ServedProcess) -> None:
    """Shorten the lease of a page from 15 s to 2 s; the page cannot renew it."""
    key = page.evaluate(f"() => sessionStorage.getItem('rid-daq lease {CELL}')")
    with served.client as client:
        client.ask("PUT", f"/cells/{CELL}/lease", {"seconds": 2.0}, key)


@pytest.mark.parametrize(
    ("policy", "pace", "message", "end"),
    [
        ("stop", 1.0, "The motion stops if", "Record: stopped: "),
        ("finish", 5.0, "The motion continues if", "Record: done"),
    ],
)
def test_a_motion_of_a_disconnected_tablet_follows_its_policy_and_is_shown_later(
    open_page: OpenPage,
    served_pages: ServedProcess,
    request: pytest.FixtureRequest,
    problems: list[str],
    policy: str,
    pace: float,
    message: str,
    end: str,
) -> None:
    motion = request.getfixturevalue("motion" if policy == "finish" else "long_motion")
    (served_pages.folder / "motion.yaml").write_text(motion)
    page = open_page(width=820)
    take_cell(page)
    ready(page, served_pages)
    job = start_motion(page, served_pages, policy, pace)
    expect(page.locator("#lease-words")).to_contain_text(message)

    page.context.set_offline(True)
    shorten_lease(page, served_pages)
    expect(page.locator("#reach")).to_contain_text("The service does not answer")
    expect(page.locator("#reach")).to_contain_text("use the emergency stop")
    with served_pages.client as client:
        over = client.follow(client.job(job.id))
        assert over.job.state.value == {"stop": "stopped", "finish": "done"}[policy]
        assert client.cell(CELL).lease is None
    if policy == "stop":
        assert over.document is not None
        assert over.document["stop"]["code"] == "CLIENT_LOST"

    page.context.set_offline(False)
    expect(page.locator("#reach")).to_be_hidden()
    expect(page.locator("#job .verdict.end")).to_contain_text(end)
    if policy == "stop":
        expect(page.locator("#job .verdict.end")).to_contain_text("has lost the lease")
    words = page.locator("#lease-words")
    expect(words).to_have_text("You no longer hold this cell. No one holds this cell.")
    expect(page.locator("#lease-take")).to_be_visible()
    problems.clear()  # the browser reports failed requests


def test_a_motion_of_a_suspended_tab_is_stopped(
    open_page: OpenPage, served_pages: ServedProcess, long_motion: str, problems: list[str]
) -> None:
    """The process of the tab is suspended, as by a debugger or by a tablet without free memory.

    The connection stays open, but no process remains that could release a key.
    """
    (served_pages.folder / "motion.yaml").write_text(long_motion)
    page = open_page()
    take_cell(page)
    ready(page, served_pages)
    job = start_motion(page, served_pages, "stop", 1.0)
    shorten_lease(page, served_pages)
    with frozen(page), served_pages.client as client:
        over = client.follow(client.job(job.id))
        assert over.job.state.value == "stopped"
        assert over.document is not None
        assert over.document["stop"]["code"] == "CLIENT_LOST"
        assert client.cell(CELL).lease is None
    expect(page.locator("#job .verdict.end")).to_contain_text("has lost the lease")
    words = page.locator("#lease-words")
    expect(words).to_have_text("You no longer hold this cell. No one holds this cell.")
    problems.clear()  # the browser reports requests with the expired lease


@contextlib.contextmanager
def frozen(page: Page) -> Iterator[None]:
    """Suspend the processes that show pages while the `with` block is active."""
    browser = page.context.browser
    assert browser is not None
    session = browser.new_browser_cdp_session()
    processes = session.send("SystemInfo.getProcessInfo")["processInfo"]
    showing = [int(each["id"]) for each in processes if each["type"] == "renderer"]
    assert showing
    try:
        for pid in showing:
            os.kill(pid, signal.SIGSTOP)
        yield
    finally:
        for pid in showing:
            os.kill(pid, signal.SIGCONT)
        session.detach()


def test_a_background_page_keeps_its_lease_and_closing_it_stops_the_motion(
    open_page: OpenPage, served_pages: ServedProcess, long_motion: str
) -> None:
    (served_pages.folder / "motion.yaml").write_text(long_motion)
    page = open_page()
    page.add_init_script(TIMERS_STAND)
    page.reload()
    take_cell(page)
    with served_pages.client as client:
        first = client.cell(CELL).lease
        assert first is not None

        def is_renewed() -> bool:
            lease = client.cell(CELL).lease
            assert lease is not None
            return lease.id == first.id and lease.until_s > first.until_s + 5.0

        until(is_renewed)
        ready(page, served_pages)
        job = start_motion(page, served_pages, "stop", 1.0)
        key = page.evaluate(f"() => sessionStorage.getItem('rid-daq lease {CELL}')")
        page.close()
        client.ask("PUT", f"/cells/{CELL}/lease", {"seconds": 2.0}, key)
        over = client.follow(client.job(job.id)).job
        assert over.state.value == "stopped"
        assert re.search(r"Chrome on Linux, number \d+ has lost the lease", over.reason)


def test_a_reloaded_page_shows_its_running_job(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    page = open_page()
    page.get_by_role("link", name="Experiment", exact=True).click()
    page.locator("#design").evaluate("part => { part.open = true }")
    page.locator("#period").fill("4.8")
    page.locator("#periods").fill("3")
    page.locator("#design-go").click()
    expect(page.locator("#job h2")).to_have_text("Design")
    page.reload()
    expect(page.locator("#job .verdict.end")).to_have_text("Design: done")
    expect(page.locator("#motion")).to_have_value("excitation.yaml")
    page.reload()
    expect(page.locator("#picture")).to_contain_text("Condition number")
    expect(page.locator("#job")).to_be_hidden()  # the end of the job has already been shown
