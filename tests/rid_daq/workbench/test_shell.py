"""The shell of the pages, operated by clicks: lease, STOP, pairing, foreign pages, lost service."""

from __future__ import annotations

import functools
import http.server
import re
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from acquisition.runs.folder import RunFolder
from tests.builders.bad_link import BadLink
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.workbench.conftest import (
    OpenByLink,
    OpenPage,
    checked,
    give_back,
    ready,
    take_cell,
)

pytestmark = pytest.mark.slow

CELL = "ir361"
RECORD = """async () => {
  const { CELL, ask } = await import("/static/service.js");
  const request = { motion: "motion.yaml", simulation: { pace: 1 } };
  return await ask("POST", `${CELL}/jobs`, { kind: "record", request, cleared: true });
}"""
"""Start `motion.yaml` with the page's module and lease."""


NEEDS = """async ([ready, held]) => {
  const { missing } = await import("/static/shell.js");
  const { now } = await import("/static/service.js");
  now.status = { ...now.status, not_ready_because: ready, not_held_because: held };
  return [missing("ready"), missing("held")];
}"""
"""Return the missing conditions of buttons for a motion and for a held motion."""


def test_a_new_user_leases_the_cell_and_checks_it(open_page: OpenPage) -> None:
    page = open_page()
    expect(page).to_have_url(re.compile(f"/cells/{CELL}$"))
    expect(page).to_have_title(re.compile("simulated"))
    expect(page.locator(".simulated")).to_contain_text("SIMULATED")
    expect(page.locator("#stop")).to_contain_text("software, not an emergency stop")
    expect(page.locator("#check")).to_be_disabled()
    expect(page.locator("[data-why]")).to_have_text("Take the cell first.")
    take_cell(page)
    checked(page)
    expect(page.locator("#now")).to_contain_text("Ready to move. Preflight")
    expect(page.locator("#preflight-words")).to_contain_text("Green")
    expect(page.locator("#preflight table")).not_to_have_count(0)
    give_back(page)
    expect(page.locator("#lease-words")).to_have_text("No one holds this cell.")


def test_stop_ends_a_motion_even_while_a_dialog_is_open(
    open_page: OpenPage, served_pages: ServedProcess, long_motion: str
) -> None:
    page = open_page()
    (served_pages.folder / "motion.yaml").write_text(long_motion)
    take_cell(page)
    ready(page, served_pages)
    job = page.evaluate(RECORD)
    expect(page.locator("#state")).to_have_text("moving")
    page.evaluate(
        'import("/static/dialog.js").then(({ confirmClear }) => void confirmClear("Another"))'
    )
    expect(page.get_by_role("dialog")).to_be_visible()
    expect(page.locator("#job .count")).to_contain_text("measuring")
    page.locator("#stop").click()  # STOP is neither covered nor inert
    expect(page.locator("#stop-words")).to_have_text(re.compile("Stop requested"))
    expect(page.locator("#job .verdict.end")).to_contain_text("Record: stopped")
    page.get_by_role("dialog").get_by_role("button", name="Cancel").click()
    with served_pages.client as client:
        over = client.follow(client.job(job["id"]))
    assert over.document is not None
    assert over.document["stop"]["code"] == "STOP_BUTTON"
    assert over.job.run is not None
    run = served_pages.folder / "runs" / over.job.run
    assert RunFolder(run, over.job.run).manifest().status == "stopped"
    assert "Stopped by the page's stop button" in (run / "result.json").read_text()
    give_back(page)


def test_a_button_moves_a_joint_while_it_is_held(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    page = open_page()
    take_cell(page)
    ready(page, served_pages)
    page.locator("#jog").click()
    page.get_by_role("dialog").get_by_role("button", name="is clear").click()
    expect(page.locator(".said")).to_contain_text("Ready: hold the button")
    forth = page.get_by_role("button", name="hold to move in positive direction")
    position = page.locator('[data-joint="axis1"] [data-show="position"]')
    expect(position).to_contain_text("°")
    at_rest = degrees(position.inner_text())
    forth.hover()
    while degrees(position.inner_text()) < at_rest + 1.0:
        page.mouse.down()
        for _ in range(40):  # on a slow page the press stops counting: press again
            page.wait_for_timeout(50)
            if degrees(position.inner_text()) >= at_rest + 1.0:
                break
        page.mouse.up()
    speed = page.locator('[data-joint="axis1"] [data-show="velocity"]')
    expect(speed).to_have_text(re.compile(r"^-?0\.0"))
    page.get_by_role("button", name="axis2", exact=True).click()
    expect(page.locator(".said")).to_contain_text("Chosen: axis2.")
    expect(page.get_by_role("button", name="Finish")).to_be_visible()
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    expect(page.locator("#stop-words")).to_have_text(re.compile("Stop requested"))
    expect(page.locator("#job .verdict.end")).to_contain_text("Jog: stopped")
    give_back(page)


def test_a_motion_with_a_held_key_offers_no_choice_for_a_lost_connection(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    page = open_page()
    take_cell(page)
    ready(page, served_pages)
    for button, choices in (("#jog", 0), ("#axes", 0), ("#plate", 1)):
        page.locator(button).click()
        expect(page.get_by_role("dialog").locator("#on-lost")).to_have_count(choices)
        page.get_by_role("dialog").get_by_role("button", name="Cancel").click()
    give_back(page)


def test_jog_and_axis_test_are_enabled_if_only_the_axis_test_is_missing(
    open_page: OpenPage,
) -> None:
    page = open_page()
    take_cell(page)
    untested = "axis test: never made"
    assert page.evaluate(NEEDS, [untested, ""]) == [f"Not ready: {untested}", ""]
    assert (
        page.evaluate(NEEDS, [untested, "drives: no answer"])[1] == "Not ready: drives: no answer"
    )
    give_back(page)


@pytest.mark.promise("held-key-slow-link")
def test_a_key_held_over_a_slow_link_moves_nothing_with_a_reason(
    open_by_link: OpenByLink, link: BadLink, served_pages: ServedProcess
) -> None:
    page = open_by_link()
    take_cell(page)
    ready(page, served_pages)
    page.locator("#jog").click()
    page.get_by_role("dialog").get_by_role("button", name="is clear").click()
    messages = page.locator(".said")
    expect(messages).to_contain_text("Ready: hold the button")
    position = page.locator('[data-joint="axis1"] [data-show="position"]')
    expect(position).to_contain_text("°")
    at_rest = position.inner_text()
    link.make_late(1.0, 0.4, 0.45)
    page.get_by_role("button", name="hold to move in positive direction").hover()
    too_slow = re.compile(r"link too slow: .*\d+ ms")
    page.mouse.down()
    for _ in range(20):  # a gap ends the press, perhaps for another reason: press again
        page.wait_for_timeout(2000)
        if too_slow.search(messages.inner_text()):
            break
        page.mouse.up()
        page.mouse.down()
    expect(messages).to_contain_text(too_slow)
    link.mend()
    page.wait_for_timeout(
        1000
    )  # the key is still held, now over a good link: another press is needed
    assert position.inner_text() == at_rest
    page.mouse.up()
    page.get_by_role("button", name="Finish").click()
    expect(page.locator("#job .verdict.end")).to_contain_text("Jog")
    give_back(page)


def degrees(text: str) -> float:
    return float(text.split()[0])


def test_a_page_is_inert_until_its_script_has_loaded(open_page: OpenPage) -> None:
    page = open_page()
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/shell.js", hold)
    with page.expect_request("**/shell.js"):
        page.get_by_role("link", name="Settings").click()
    name = page.locator("#pairing-name")
    expect(name).to_be_visible()
    assert name.evaluate("field => field.closest('[inert]')?.id") == "main"
    assert held
    for route in held:
        route.continue_()
    expect(page.locator("#lease-take")).to_be_visible()
    name.click()
    expect(name).to_be_focused()


def test_a_second_browser_is_paired_and_takes_over_the_cell(
    open_page: OpenPage, problems: list[str]
) -> None:
    first, second = open_page(), open_page(known=False)
    code = second.locator("#code")
    expect(code).to_have_text(re.compile(r"\d{3} \d{3}"))
    first.get_by_role("link", name="Settings").click()
    first.locator("#pairing-name").fill("the tablet")
    first.locator("#pairing-code").fill(code.inner_text())
    first.get_by_role("button", name="Grant access").click()
    expect(first.locator("#pairing-words")).to_have_text("the tablet has access as operator.")
    expect(second).to_have_url(re.compile(f"/cells/{CELL}$"))

    take_cell(first, "calibration")
    expect(second.locator("#lease-words")).to_contain_text("holds this cell (calibration).")
    expect(second.locator("#lease-take")).to_be_hidden()
    expect(second.locator("#check")).to_be_disabled()
    second.locator("#lease-over").click()
    second.locator("#name").fill("ir36")
    second.get_by_role("dialog").get_by_role("button", name="Take over").click()
    expect(second.get_by_role("dialog").get_by_role("alert")).to_have_text("Type ir361.")
    second.locator("#name").fill(CELL)
    second.keyboard.press("Enter")
    expect(second.locator("#lease-back")).to_be_visible()
    expect(first.locator("#lease-words")).to_contain_text("You no longer hold this cell.")
    expect(first.locator("#lease-words")).to_contain_text("the tablet holds this cell")
    assert all(
        "409 (Conflict)" in problem for problem in problems
    )  # the first browser cannot renew its lease
    problems.clear()
    give_back(second)
    expect(first.locator("#lease-take")).to_be_visible()


def test_a_hanging_service_raises_an_alarm_and_stop_is_still_answered(
    open_page: OpenPage, served_pages: ServedProcess, problems: list[str]
) -> None:
    page = open_page()
    expect(page.locator("#lease-take")).to_be_visible()
    served_pages.process.send_signal(signal.SIGSTOP)
    try:
        page.locator("#stop").click()  # the front process answers
        expect(page.locator("#stop-words")).to_have_text(
            "This service moves nothing in cell ir361 now."
        )
        expect(page.locator("#reach")).to_contain_text("use the emergency stop")
        expect(page.locator("#state")).to_have_text("unknown")
    finally:
        served_pages.process.send_signal(signal.SIGCONT)
    expect(page.locator("#reach")).to_be_hidden()
    problems.clear()


STRANGER = """<!doctype html><title>stranger</title><body><script>
const there = "SERVICE";
const image = new Image();
const came = (what) => (error) => [what, "refused"];
const tries = [
  fetch(there + "/api/v1/cells").then((a) => a.text()).then((t) => ["read", t], came("read")),
  fetch(there + "/api/v1/cells", { credentials: "include" }).then((a) => a.text())
    .then((t) => ["with cookie", t], came("with cookie")),
  fetch(there + "/api/v1/cells/ir361/stop",
    { method: "POST", mode: "no-cors", credentials: "include" })
    .then((a) => ["blind stop", a.type], came("blind stop")),
  fetch(there + "/api/v1/cells/ir361/lease", { method: "POST", credentials: "include", body: "{}",
    headers: { "content-type": "application/json", "x-rid-daq": "stop" } })
    .then((a) => a.text()).then((t) => ["lease", t], came("lease")),
  new Promise((done) => {
    const socket = new WebSocket(there.replace("http", "ws") + "/api/v1/ws");
    socket.onmessage = (m) => done(["socket", m.data]);
    socket.onclose = () => done(["socket", "refused"]);
  }),
  new Promise((done) => {
    image.onload = () => done(["image", "shown"]);
    image.onerror = () => done(["image", "refused"]);
    image.src = there + "/static/icon.svg";
  }),
];
Promise.all(tries).then((all) => { document.title = "tried"; window.all = all; });
</script>
<iframe name="hole"></iframe>
<form target="hole" method="post" enctype="text/plain"><input name="a" value="b"></form>
"""


@pytest.fixture
def stranger(served_pages: ServedProcess, tmp_path: Path) -> Iterator[str]:
    """Serve a foreign page on this computer, and yield its address."""
    service = served_pages.url.split("/?")[0]
    (tmp_path / "index.html").write_text(STRANGER.replace("SERVICE", service))

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: object) -> None:
            del format, args

    handler = functools.partial(Quiet, directory=str(tmp_path))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        serving = threading.Thread(target=server.serve_forever)
        serving.start()
        yield f"http://127.0.0.1:{server.server_port}/index.html"
        server.shutdown()
        serving.join()


def test_a_foreign_page_in_the_same_browser_gets_no_access(
    open_page: OpenPage, served_pages: ServedProcess, stranger: str, problems: list[str]
) -> None:
    page = open_page()
    expect(page.locator("#lease-take")).to_be_visible()
    before = audit(served_pages)
    other: Page = page.context.new_page()
    other.goto(stranger)
    expect(other).to_have_title("tried")
    found = dict(other.evaluate("window.all"))
    assert found.pop("blind stop") in (
        "opaque",
        "refused",
    )  # the page cannot read the answer, and the service refuses the request
    assert found == dict.fromkeys(("read", "with cookie", "lease", "socket", "image"), "refused")
    service = served_pages.url.split("/?")[0]
    with other.expect_response(re.compile("/stop$")) as response:
        other.evaluate(
            "(to) => { const f = document.forms[0]; f.action = to; f.submit(); }",
            f"{service}/api/v1/cells/{CELL}/stop",
        )
    assert response.value.status in (403, 415)
    assert audit(served_pages) == before
    expect(page.locator("#lease-words")).to_have_text("No one holds this cell.")
    problems.clear()


def audit(served_pages: ServedProcess) -> object:
    with served_pages.client as client:
        return client.ask("GET", "/audit")
