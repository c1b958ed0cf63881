"""A service that falls silent: how soon a page says so, by a clock that the test turns."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.rid_daq.workbench.conftest import OpenPage

pytestmark = pytest.mark.slow


SILENT = """
window.WebSocket = class extends EventTarget {
  static OPEN = 1;
  readyState = 1;
  constructor() {
    super();
    window.tell = (told) =>
      this.dispatchEvent(new MessageEvent("message", { data: JSON.stringify(told) }));
    setTimeout(() => this.dispatchEvent(new Event("open")), 0);
  }
};
AbortSignal.timeout = (ms) => {
  const ending = new AbortController();
  setTimeout(() => ending.abort(), ms);
  return ending.signal;
};
window.fall = () => {
  window.asked = 0;
  window.fetch = (url, { signal }) => new Promise((_, reject) => {
    window.asked += 1;
    signal.addEventListener("abort", () => reject(signal.reason));
  });
};
"""
"""A service that tells what a test says (`tell`), and answers until it falls silent (`fall`)."""

PICTURE = """{ type: "samples", cell: "ir361", job: "j1", picture: {
  words: "Measuring", moving: true, age_s: 0, joints: [], share: 0.5, count: "", left_s: null,
} }"""


def test_a_service_that_falls_silent_in_a_motion_is_told_within_two_seconds(
    open_page: OpenPage,
) -> None:
    page = open_page()
    page.add_init_script(SILENT)
    page.clock.install()
    page.reload()
    expect(page.locator("#lease-take")).to_be_visible()
    expect(page.locator("#now")).to_contain_text("Not ready")
    page.evaluate("fall()")
    page.clock.pause_at(page.evaluate("Date.now() + 60_000"))
    page.evaluate("""async () => {
      const { now } = await import("/static/service.js");
      const job = { id: "j1", kind: "record", state: "running", owner: "a test" };
      tell({ type: "cell", cell: { ...now.status, state: "moving", job } });
    }""")
    asked = page.evaluate("asked")
    for _ in range(20):
        page.clock.run_for(100)
        page.evaluate(f"tell({PICTURE})")
    expect(page.locator("#reach")).to_be_hidden()
    expect(page.locator("#joints-words")).to_have_text("Measuring.")
    assert page.evaluate("asked") <= asked + 1  # its beat alone: it hears enough
    page.clock.run_for(2000)
    expect(page.locator("#reach")).to_contain_text("The service does not answer")
    expect(page.locator("#joints-words")).to_have_text("NOT LIVE: the service does not answer.")
    page.evaluate(f"tell({PICTURE})")
    expect(page.locator("#reach")).to_be_hidden()
    expect(page.locator("#joints-words")).to_have_text("Measuring.")
