"""The panel of a job, which receives each event of the job once."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, expect

from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.workbench.conftest import OpenPage, checked, give_back, take_cell

pytestmark = pytest.mark.slow

PANEL = """
  const { JobPanel } = await import("/static/job_panel.js");
  const others = window.fetch;
  const events = [], asked = [];
  let held = Promise.resolve();
  window.fetch = async (url, options) => {
    if (!url.includes("/jobs/j1/events")) return await others(url, options);
    const after = Number(new URL(url, location).searchParams.get("after"));
    asked.push(after);
    const told = events.slice(after);
    await held;
    return new Response(JSON.stringify(told));
  };
  const section = document.createElement("section");
  document.body.append(section);
  const panel = new JobPanel(section);
  const said = (i) => ({ kind: "said", text: `sentence ${i}.` });
  const shown = () => [...section.querySelectorAll(".said p")].map((each) => each.textContent);
  const job = { id: "j1", kind: "check", state: "running" };
"""
"""A panel of a job whose requests for events are counted and answered by the test."""


LINKED = """async () => {
  const { linked } = await import("/static/commands.js");
  const { render } = await import("/static/lit.js");
  const place = document.createElement("p");
  render(linked("zero it (`rid-daq plate zero`), `rid-daq loop RUN`, `rid-daq mock`."), place);
  const links = [...place.querySelectorAll("a")].map((each) => each.getAttribute("href"));
  return [place.textContent, ...links];
}"""


@pytest.fixture
def page(open_page: OpenPage) -> Page:
    """Open a page whose modules have started."""
    opened = open_page()
    expect(opened.locator("#lease-take")).to_be_visible()
    return opened


def test_commands_in_messages_are_links_to_the_page_with_their_button(page: Page) -> None:
    text, *links = page.evaluate(LINKED)
    assert text.count("rid-daq") == 1  # no page can do `mock`
    assert "`" not in text
    assert links == ["/cells/ir361", "/cells/ir361/compensation"]


def test_only_missed_events_are_requested(page: Page) -> None:
    asked, sentences = page.evaluate(f"""async () => {{ {PANEL}
  for (let i = 0; i < 3; i++) events.push(said(i));  // before the panel was shown
  let release;
  held = new Promise((resolve) => (release = resolve));
  panel.show(job);
  for (const i of [3, 4]) panel.receive(said(i), i);  // while the request runs
  release();
  await panel.load();
  for (const i of [4, 5]) panel.receive(said(i), i);  // one repeated
  for (const i of [3, 4, 5, 6, 7]) events.push(said(i));
  panel.receive(said(7), 7);  // number 6 is missing
  await panel.load();
  await panel.drawing;
  window.fetch = others;
  return [asked, shown()];
}}""")
    assert asked == [0, 6]
    assert sentences == [f"sentence {i}." for i in range(8)]


def test_a_long_log_is_laid_out_in_parts_and_measured_once_per_batch(page: Page) -> None:
    """Otherwise the time for a line grows with the log: 2,000 lines blocked a page for 21 s."""
    counts = page.evaluate(f"""async () => {{ {PANEL}
  for (let i = 0; i < 10000; i++) events.push(said(i));
  panel.show(job);
  const log = section.querySelector(".said");
  let measured = 0;
  Object.defineProperty(log, "clientHeight", {{ get: () => (measured++, 100) }});
  await panel.load();
  await panel.drawing;
  window.fetch = others;
  const parts = [...log.children];
  const hidden = parts.filter((each) => getComputedStyle(each).contentVisibility === "auto");
  const most = Math.max(...parts.map((each) => each.childElementCount));
  return [shown().length, measured, most, parts.length - hidden.length];
}}""")
    assert counts == [10000, 1, 200, 1]  # only the last part is always laid out


@pytest.mark.parametrize("state", ["measuring", "run-out"])
def test_the_state_of_a_motion_is_shown_once_and_no_other_text_is_removed(
    page: Page, state: str
) -> None:
    """The live values have a newer state than the events."""
    before, after = page.evaluate(f"""async () => {{ {PANEL}
  const line = "measuring; 3 %; 2 kg";
  events.push({{ kind: "progress", title: "Run", done: 1, total: 4, unit: "periods", line }});
  panel.show(job);
  await panel.load();
  await panel.drawing;
  const estimate = () => section.querySelector(".estimate").textContent;
  const before = estimate();
  panel.showPicture({{ title: "Run", words: "{state}" }});
  await panel.drawing;
  window.fetch = others;
  return [before, estimate()];
}}""")
    assert (before, after) == ("measuring; 3 %; 2 kg", "3 %; 2 kg")


def test_a_stopping_motion_has_no_time_left_and_the_next_begins_without_progress(
    page: Page,
) -> None:
    counts = page.evaluate(f"""async () => {{ {PANEL}
  panel.show(job);
  await panel.load();
  const counts = [];
  const note = async () => {{
    await panel.drawing;
    const way = section.querySelector(".way");
    counts.push([way.querySelector(".count").textContent, way.querySelector("progress").value]);
  }};
  const picture = {{ title: "Run", words: "measuring", share: 0.5, count: "1 of 2", left_s: 24 }};
  panel.showPicture(picture);
  await note();
  panel.showPicture({{ ...picture, stop: "STOP" }});
  await note();
  panel.receive({{ kind: "state", state: "attach", text: "Attach it." }}, 0);
  await note();
  panel.receive({{ kind: "motion", title: "Loaded" }}, 1);
  await note();
  window.fetch = others;
  return counts;
}}""")
    assert counts == [
        ["measuring · 1 of 2 · 24 s left", 0.5],
        ["measuring · 1 of 2 · STOP", 0.5],
        ["Attach it.", 0],
        ["Attach it.", 0],
    ]


def test_a_long_step_shows_its_time_left_and_a_job_without_steps_its_beginning(page: Page) -> None:
    told = page.evaluate(f"""async () => {{ {PANEL}
  const of = {{ kind: "progress", unit: "%", line: "" }};
  const step = (at_s, title, done, total) => ({{ ...of, at_s, title, done, total }});
  const told = [], count = () => section.querySelector(".count").textContent;
  panel.show({{ ...job, began_s: 1.8e9 }});
  await panel.load();
  await panel.drawing;
  told.push(count(), section.querySelector("progress").hasAttribute("value"));
  const first = [step(10, "Reading", 0, 100), step(20, "Reading", 25, 100)];
  for (const each of [...first, step(21, "Searching", 0, null)]) {{
    panel.receive(each, panel.view.known);
    await panel.drawing;
    told.push(count());
  }}
  window.fetch = others;
  return told;
}}""")
    running, has_share, first, later, unknown = told
    assert running.startswith("Running since")
    assert not has_share
    assert (first, later) == ("Reading · 0 of 100 %", "Reading · 25 of 100 % · 30 s left")
    assert unknown == "Searching"


def test_a_question_with_buttons_has_no_text_field(page: Page) -> None:
    fields = page.evaluate(f"""async () => {{ {PANEL}
  const asked_ = {{ kind: "asked", form: "text", question: 1, text: "Name?", choices: [] }};
  events.push(asked_, {{ ...asked_, question: 2, choices: [{{ label: "Yes", text: "ir361" }}] }});
  panel.show(job);
  const count = () => ["input", ".answer"].map((each) => section.querySelectorAll(each).length);
  const fields = [];
  await panel.load();
  await panel.drawing;
  fields.push(count());
  panel.askPerson(asked_);
  fields.push(count());
  window.fetch = others;
  return fields;
}}""")
    assert fields == [[0, 1], [1, 0]]


def test_a_check_requests_its_events_once(open_page: OpenPage, served_pages: ServedProcess) -> None:
    page = open_page()
    take_cell(page)
    asked: list[str] = []
    page.on("request", lambda sent: asked.append(sent.url) if "/events?" in sent.url else None)
    checked(page)
    assert len(asked) == 1
    give_back(page)
