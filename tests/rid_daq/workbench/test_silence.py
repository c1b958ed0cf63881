"""A service that stops answering on one channel: time until the page reports it (fake clock)."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, expect

from tests.rid_daq.workbench.conftest import OpenPage

pytestmark = pytest.mark.slow


FAKE = """
const sockets = new Set();
window.WebSocket = class extends EventTarget {
  static OPEN = 1;
  readyState = 1;
  constructor() {
    super();
    sockets.add(this);
    setTimeout(() => this.dispatchEvent(new Event("open")), 0);
  }
  send() {}
  close() {
    sockets.delete(this);
  }
};
window.tell = (told) => {
  for (const each of sockets)
    each.dispatchEvent(new MessageEvent("message", { data: JSON.stringify(told) }));
};
window.answering = true;
window.fake = async (moving) => {
  const { now } = await import("/static/service.js");
  const job = moving ? { id: "j1", kind: "record", state: "running", owner: "a test" } : null;
  const status = { ...now.status, state: moving ? "moving" : "closed", job };
  window.fetch = (url, { signal }) => new Promise((resolve, reject) => {
    const answers = { "/cells/ir361": status, "/preflight": null, "/jobs/j1": job };
    const end = Object.keys(answers).find((each) => url.endsWith(each));
    const answer = end === undefined ? [] : answers[end];
    if (window.answering) resolve(new Response(JSON.stringify(answer)));
    signal.addEventListener("abort", () => reject(signal.reason));
  });
  tell({ type: "cell", cell: status });
};
"""
"""A simulated service that sends the test's messages (`tell`) and can stop answering."""

PICTURE = """{ type: "samples", cell: "ir361", job: "j1", picture: {
  words: "Measuring", moving: true, age_s: 0, joints: [], share: 0.5, count: "", left_s: null,
} }"""


def pass_time(page: Page, seconds: float, message: str | None) -> None:
    """Let the page's time pass; the WebSocket sends a message ten times a second, or none."""
    for _ in range(round(10 * seconds)):
        page.clock.run_for(100)
        if message is not None:
            page.evaluate(f"tell({message})")


@pytest.mark.promise("stale-values-are-marked")
@pytest.mark.parametrize("moving", [False, True], ids=["idle", "moving"])
@pytest.mark.parametrize(
    ("values", "requests", "words"),
    [
        (False, True, "NOT LIVE"),
        (True, False, "does not answer requests"),
        (False, False, "use the emergency stop"),
    ],
    ids=["values", "requests", "both"],
)
def test_a_silent_channel_and_its_recovery_are_shown_within_seconds(
    open_page: OpenPage, values: bool, requests: bool, words: str, moving: bool
) -> None:
    page = open_page()
    page.add_init_script(FAKE)
    page.clock.install()
    page.reload()
    expect(page.locator("#lease-take")).to_be_visible()
    page.clock.pause_at(page.evaluate("Date.now() + 60_000"))
    page.evaluate("moving => fake(moving)", moving)
    message = PICTURE if moving else '{ type: "beat" }'
    reach, live = page.locator("#reach"), page.locator("#joints-words")
    pass_time(page, 3.0, message)
    expect(reach).to_be_hidden()
    shown = live.inner_text()

    page.evaluate("answering => { window.answering = answering; }", requests)
    pass_time(page, 2.0, message if values else None)
    expect(reach).to_contain_text(words)
    expect(page.locator("#state")).to_have_text(
        ("moving" if moving else "not ready") if values or requests else "unknown"
    )
    if moving and not values:
        expect(live).to_contain_text("NOT LIVE")
    page.evaluate("window.answering = true")
    pass_time(page, 2.5, message)
    expect(reach).to_be_hidden()
    expect(live).to_have_text(shown)
