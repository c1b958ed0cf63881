"""The panel of a job, which requests the job's events from the service."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.rid_daq.workbench.conftest import OpenPage

pytestmark = pytest.mark.slow

FOLLOW = """async () => {
  const { JobPanel } = await import("/static/job_panel.js");
  const [events, asked, others] = [[], [], window.fetch];
  const [first, held] = [Promise.withResolvers(), Promise.withResolvers()];
  window.fetch = async (url, options) => {
    if (!url.includes("/jobs/j1/events")) return await others(url, options);
    asked.push(url);
    const told = events.slice(Number(new URL(url, location).searchParams.get("after")));
    first.resolve();
    await held.promise;
    return new Response(JSON.stringify(told));
  };
  const panel = new JobPanel(document.createElement("section"));
  panel.show({ id: "j1", kind: "check", state: "running" });
  await first.promise;
  let last;
  for (let i = 0; i < 20; i++) {
    events.push({ kind: "said", text: `sentence ${i}.` });
    last = panel.follow();
  }
  held.resolve();
  await last;
  events.push({ kind: "said", text: "sentence 20." });
  panel.show({ id: "j1", kind: "check", state: "running" });  // the same one anew
  await panel.follow();
  window.fetch = others;
  return [asked.length, [...panel.said.children].map((each) => each.textContent)];
}"""


def test_many_simultaneous_events_are_loaded_by_one_request(open_page: OpenPage) -> None:
    page = open_page()
    expect(page.locator("#lease-take")).to_be_visible()  # the page's modules have started
    requests, sentences = page.evaluate(FOLLOW)
    assert (
        requests == 2 + 1
    )  # the first request, one for all events meanwhile, and one after showing the panel again
    assert sentences == [f"sentence {i}." for i in range(21)]
