"""The page of live signals in a browser: its plots follow the time, can be paused and zoomed, and
show values.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.rid_daq.service.conftest import ServedProcess, periodic
from tests.rid_daq.service.moving import begin_motion, leased_cell
from tests.rid_daq.workbench.conftest import OpenPage
from tests.rid_daq.workbench.test_every_page import (
    CUT_OFF,
    LARGE_ENOUGH_PX,
    SMALL_TARGETS,
    require_axe,
)

pytestmark = pytest.mark.slow

PAGE = "/cells/ir361/signals"
NEWEST = "() => document.getElementById('signals').signals.store.newest"
RANGE = "() => document.getElementById('signals').signals.plots.range"
WIDEST_LINE = """() => Math.max(...document.getElementById("signals").signals.plots.plots[0]
  .plot.data.slice(1).map((line) => line.filter((value) => value !== null).length))"""
MORE = "(before) => document.getElementById('signals').signals.store.newest > before + 20"


@pytest.fixture(scope="module")
def moving(served_pages: ServedProcess) -> Iterator[None]:
    """Run a motion of twenty minutes in the served cell during the tests that need one."""
    with leased_cell(served_pages, periodic(1000, period_s=1.2)) as lease:
        begin_motion(served_pages, lease)
        yield


def open_signals(open_page: OpenPage, served: ServedProcess, **options: object) -> Page:
    page = open_page(**options)
    page.goto(served.url.split("/?")[0] + PAGE)
    return page


def visible_s(page: Page) -> float:
    start, end = page.evaluate(RANGE)
    return float(end - start)


def test_a_page_without_values_says_so(open_page_of: OpenPage, served: ServedProcess) -> None:
    page = open_page_of(served.url)
    page.goto(served.url.split("/?")[0] + PAGE)
    state = page.locator("#signal-state")
    expect(state).to_have_attribute("data-kind", "old")
    expect(state).to_contain_text("No values are measured now.")
    expect(page.locator("#values-time")).to_contain_text("no values yet")
    page.get_by_role("link", name="Cell ir361").click()
    page.get_by_role("link", name="Plots over time").click()
    expect(page.locator("h1")).to_have_text("Live signals")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_the_live_page_is_accessible_and_fits_all_widths(
    open_page: OpenPage, served_pages: ServedProcess, moving: None, screenshots: Path, dark: bool
) -> None:
    page = open_signals(open_page, served_pages, dark=dark)
    expect(page.locator("#signal-state")).to_have_attribute("data-kind", "live")
    page.wait_for_function(MORE, arg=60)
    page.get_by_text("About these plots").click()
    require_axe(page)
    for width in (390, 820, 1440):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate(CUT_OFF) == 0
        assert page.evaluate(SMALL_TARGETS, LARGE_ENOUGH_PX) == []
        colours = "dark" if dark else "light"
        page.screenshot(path=screenshots / f"signals-live-{width}-{colours}.png", full_page=True)


def test_plots_move_pause_and_continue(
    open_page: OpenPage, served_pages: ServedProcess, moving: None
) -> None:
    page = open_signals(open_page, served_pages)
    state = page.locator("#signal-state")
    expect(state).to_have_text("LIVE: values of the present motion.")
    before = page.evaluate(NEWEST)
    page.wait_for_function(MORE, arg=before)
    assert page.evaluate(WIDEST_LINE) > 20
    page.locator("#pause").click()
    expect(state).to_contain_text("PAUSED at")
    expect(page.locator("#pause")).to_have_text("Continue")  # the fixed range is drawn
    frozen, newest = page.evaluate(RANGE), page.evaluate(NEWEST)
    page.wait_for_function(MORE, arg=newest)
    assert page.evaluate(RANGE) == frozen
    page.get_by_role("button", name="Continue").click()
    expect(state).to_have_text("LIVE: values of the present motion.")
    page.wait_for_function(f"(end) => ({RANGE})()[1] > end + 0.9", arg=frozen[1])


def test_zoom_by_buttons_mouse_and_fingers(
    open_page: OpenPage, served_pages: ServedProcess, moving: None
) -> None:
    page = open_signals(open_page, served_pages)
    expect(page.locator("#signal-state")).to_have_attribute("data-kind", "live")
    page.locator("#zoom-in").click()
    expect(page.locator("#span")).to_have_text("15 s visible")
    assert visible_s(page) == pytest.approx(15.0)
    page.locator("#zoom-out").click()
    page.locator("#zoom-out").click()
    expect(page.locator("#span")).to_have_text("60 s visible")
    page.locator("#earlier").click()
    expect(page.locator("#signal-state")).to_contain_text("PAUSED")
    page.locator("#reset").click()
    expect(page.locator("#span")).to_have_text("30 s visible")

    plot = page.locator(".u-over").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    y = box["y"] + box["height"] / 2
    start, _ = page.evaluate(RANGE)
    page.mouse.move(box["x"] + 0.25 * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], y, steps=5)
    page.mouse.move(box["x"] + 0.75 * box["width"], y)
    page.mouse.up()
    expect(page.locator("#span")).to_have_text("15 s visible")
    part = page.evaluate(RANGE)
    assert part == pytest.approx([start + 7.5, start + 22.5], abs=0.2)

    session = page.context.new_cdp_session(page)
    pinch(session_send=session.send, box=box, first=0.1, last=0.4)
    expect(page.locator("#span")).to_have_text(re.compile(r"^3\.[678] s visible$"))


def pinch(session_send: object, box: object, first: float, last: float) -> None:
    """Set two fingers on a plot and move them, symmetrically to its centre.

    `first` and `last` are their distances from the centre, relative to the width of the plot.
    """
    assert callable(session_send)
    assert isinstance(box, dict)

    def points(half: float) -> list[dict[str, float]]:
        y = box["y"] + box["height"] / 2
        centre = box["x"] + box["width"] / 2
        return [
            {"x": centre + sign * half * box["width"], "y": y, "id": number}
            for number, sign in enumerate((-1, 1))
        ]

    session_send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": points(first)})
    for step in range(1, 6):
        half = first + (last - first) * step / 5
        session_send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": points(half)})
    session_send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def test_the_table_shows_the_values_at_the_cursor(
    open_page: OpenPage, served_pages: ServedProcess, moving: None
) -> None:
    page = open_signals(open_page, served_pages)
    expect(page.locator("#signal-state")).to_have_attribute("data-kind", "live")
    page.wait_for_function(MORE, arg=page.evaluate(NEWEST))
    cursor = page.locator("#cursor")
    cursor.focus()
    cursor.press("ArrowLeft")
    expect(page.locator("#signal-state")).to_contain_text("PAUSED")
    expect(page.locator("#values-time")).to_contain_text("Values at the cursor: ")
    row = page.locator("#values tbody tr").first
    expect(row).to_contain_text("axis1")
    expect(row.locator("td").first).to_have_text(re.compile(r"^-?\d"))
    expect(page.locator("#values thead")).to_contain_text("Position [°]")
    expect(page.locator("#values thead")).to_contain_text("Torque [N m]")
    for name in ("zoom-out",) * 6 + ("earlier",) * 2:  # to a time before the service was started
        page.locator(f"#{name}").click()
    cursor.press("Home")
    expect(cursor).to_have_attribute("aria-valuetext", re.compile("^no values at"))
    expect(row.locator("td").first).to_have_text("–")


def test_a_joint_can_be_hidden(
    open_page: OpenPage, served_pages: ServedProcess, moving: None
) -> None:
    page = open_signals(open_page, served_pages)
    expect(page.locator("#signal-state")).to_have_attribute("data-kind", "live")
    button = page.get_by_role("button", name="axis2")
    button.click()
    expect(button).to_have_attribute("aria-pressed", "false")
    plot = "document.getElementById('signals').signals.plots.plots[0].plot"
    page.wait_for_function(f"() => {plot}.data[2].every((value) => value === null)")
    assert page.evaluate(f"() => {plot}.data[1].some((value) => value !== null)")
