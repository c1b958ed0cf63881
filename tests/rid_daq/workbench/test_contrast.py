"""Every alarm, badge and button has a contrast of at least 4.5 to 1 in both themes."""

from __future__ import annotations

import pytest

from rid_daq.service.records import CellState
from tests.rid_daq.workbench.conftest import OpenPage

pytestmark = pytest.mark.slow

LEAST = 4.5
"""Minimum contrast of text: WCAG 2.2, success criterion 1.4.3."""

KINDS = (
    *('<p class="banner">words</p>', '<p class="banner bad">words</p>'),
    *('<p class="banner good">words</p>', '<p class="banner wait">words</p>'),
    *('<p class="problem">words</p>', '<p class="soft">words</p>', '<p class="hint">words</p>'),
    *('<p class="verdict">words</p>', '<p class="verdict end bad">words</p>'),
    *('<p class="verdict good">words</p>', '<p class="verdict wait">words</p>'),
    '<section class="card"><p class="problem">words</p><p class="soft">words</p></section>',
    '<section class="card wait"><h2>words</h2><button>words</button></section>',
    '<ul class="findings"><li class="bad"><b>words</b></li><li class="good"><b>words</b></li></ul>',
    '<table><tr class="red"><td>words</td></tr><tr><th>words</th></tr></table>',
    '<details><summary class="bad">words</summary></details>',
    '<p class="simulated">words</p>',
    *("<button>words</button>", '<button class="main">words</button>'),
    '<button class="danger">words</button>',
    '<button disabled>words</button><button class="main" disabled>words</button>',
    '<button class="danger" disabled>words</button><a class="button main" href="#">words</a>',
    '<button class="hold">words</button><button class="hold held">words</button>',
    '<button class="joint" aria-pressed="true">words</button>',
    '<div class="job"><p class="count">words</p></div>',
    '<div class="job"><div class="said"><p class="problem">words</p></div></div>',
    '<pre class="source"><span class="line wrong"><b class="number">words</b>words</span></pre>',
    '<ol class="stages"><li data-state="bad"><a href="#">words <span>words</span></a></li></ol>',
    *(
        f'<p><span class="state" data-state="{state}">words</span></p>'
        for state in (*CellState, "unknown")
    ),
)
"""HTML of one element of each kind of alarm, badge and button, as the pages create it."""

CONTRASTS = """async (kinds) => {
  const link = document.createElement("link");
  Object.assign(link, { rel: "stylesheet", href: "/static/work.css" });
  document.head.append(link);
  await new Promise((loaded) => (link.onload = loaded));
  const main = document.querySelector("main");
  main.insertAdjacentHTML("beforeend", kinds.join(""));
  document.querySelector("#reach").hidden = false;
  document.querySelector("#reach").textContent = "words";
  for (const kind of ["bad", "good", "wait"])
    document.querySelector("#stop-words").insertAdjacentHTML(
      "afterend", `<p class="banner ${kind}">words</p>`);
  document.querySelector("#page-broken").hidden = false;
  for (const each of document.querySelectorAll("[inert]")) each.inert = false;
  await new Promise((drawn) => setTimeout(drawn, 300));

  const parsed = (colour) => colour.match(/[\\d.]+/g).map(Number);
  const over = ([red, green, blue, alpha = 1], below) =>
    [red, green, blue].map((each, i) => alpha * each + (1 - alpha) * below[i]);
  const ground = (part) => {
    if (!part) return [128, 128, 128];
    const style = getComputedStyle(part);
    return over(parsed(style.backgroundColor), ground(part.parentElement));
  };
  const light = (colour) => colour.map((each) => each / 255)
    .map((each) => (each <= 0.04045 ? each / 12.92 : ((each + 0.055) / 1.055) ** 2.4))
    .reduce((sum, each, i) => sum + [0.2126, 0.7152, 0.0722][i] * each, 0);
  const found = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const part = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || !part.checkVisibility()) continue;
    if (part.closest("script, option, .hidden, .skip")) continue;
    let opacity = 1;
    for (let each = part; each; each = each.parentElement)
      opacity *= getComputedStyle(each).opacity;
    const below = ground(part);
    const [red, green, blue, alpha = 1] = parsed(getComputedStyle(part).color);
    const ink = over([red, green, blue, alpha * opacity], below);
    const [dark, bright] = [light(ink), light(below)].sort((a, b) => a - b);
    const what = `${part.tagName} ${part.className} in ${part.parentElement.className}`;
    found.push([what, (bright + 0.05) / (dark + 0.05)]);
  }
  return found;
}"""
"""Function that returns the contrast of each text on the page with its background."""


@pytest.mark.promise("alarms-can-be-read")
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_every_alarm_badge_and_button_has_enough_contrast(open_page: OpenPage, dark: bool) -> None:
    page = open_page(dark=dark)
    page.locator("#lease-take").wait_for()
    found = page.evaluate(CONTRASTS, list(KINDS))
    assert sum("banner" in what for what, _ in found) >= 9
    assert {what: round(ratio, 2) for what, ratio in found if ratio < LEAST} == {}
