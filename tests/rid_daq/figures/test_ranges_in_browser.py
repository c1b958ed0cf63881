"""Ranges of a figure's axes in a real browser: zooms beyond the values, and hidden lines."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Locator, Page

from rid_daq.blocks.plot import Axis, Line, Panel, Plot
from rid_daq.figures.palette import LIGHT
from tests.builders.figure_page import served_figures
from tests.rid_daq.figures.test_in_browser import (
    COLOURS,
    hex_to_rgb,
    open_page,
    wait_until_shown,
)

pytestmark = pytest.mark.slow

FREQUENCY = Axis("frequency", "Hz", log=True)
SHORT = Line("short", (1.0, 100.0), (20.0, 21.0), "blue", width=4.0)
LONG = Line("long", (1.0, 10_000.0), (20.0, 21.0), "orange", width=4.0)
NOISE = Line("noise", (1.0, 100.0), (0.0018826, 17.42), "blue", width=4.0)
"""Line whose range, with its margin, begins at 0.00099."""
PERIODS = Line("power", (1.0, 2.0, 3.0), (20.0, 21.0, 22.0), "blue")
RESIDUAL = Line("residual", (0.0, 1.0, 2.0), (-0.27, 0.1, 0.3), "orange")
PLOT = Plot(
    name="gains",
    panels=(
        Panel(x=FREQUENCY, y=Axis("gain", "dB"), lines=(SHORT, LONG)),
        Panel(x=FREQUENCY, y=Axis("loss", "dB"), lines=(SHORT,), zooms_with_previous=True),
        Panel(x=FREQUENCY, y=Axis("torque", "N m", log=True), lines=(NOISE,)),
        Panel(x=Axis("period", counts=True), y=Axis("power", "W"), lines=(PERIODS,)),
        Panel(x=Axis("time", "s"), y=Axis("residual", "N m"), lines=(RESIDUAL,), height_px=150),
    ),
)

RECORD_TEXTS = """(panel) => {
  const { prototype } = CanvasRenderingContext2D, { fillText } = prototype;
  window.written = [];
  prototype.fillText = function (text, ...rest) {
    if (this.canvas === document.querySelectorAll("canvas")[panel]) window.written.push(text);
    fillText.call(this, text, ...rest);
  };
}"""
PINCH = """(over) => {
  const { left, top, width } = over.getBoundingClientRect();
  const send = (type, pointerId, part) => over.dispatchEvent(new PointerEvent(type,
    { pointerType: "touch", pointerId, clientX: left + part * width, clientY: top + 20 }));
  send("pointerdown", 1, 0.6);
  send("pointerdown", 2, 0.8);
  send("pointermove", 1, 0.7);
  send("pointermove", 1, 0.75);
}"""


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    errors: list[str] = []
    with served_figures({"gains": PLOT}) as address:
        page = open_page(browser, address, 1280, "light", errors)
        wait_until_shown(page)
        yield page
        page.close()
    assert errors == []


def shows_blue(canvas: Locator) -> bool:
    return hex_to_rgb(LIGHT["blue"]) in canvas.evaluate(COLOURS)


def test_a_line_stays_visible_in_a_range_between_two_of_its_points(page: Page) -> None:
    box = page.locator(".u-over").first.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.5 * box["height"], steps=4)
    page.mouse.up()
    page.get_by_role("button", name="Whole").wait_for()
    assert shows_blue(page.locator("canvas").first)


def test_two_fingers_zoom_a_logarithmic_axis_out(page: Page) -> None:
    page.locator(".u-over").first.evaluate(PINCH)
    page.get_by_role("button", name="Whole").wait_for()
    assert shows_blue(page.locator("canvas").first)


def test_a_logarithmic_axis_can_begin_just_below_a_power_of_ten(page: Page) -> None:
    assert shows_blue(page.locator("canvas").nth(2))


def written_texts(page: Page, panel: int) -> list[str]:
    """Return the texts that a panel writes when the figure is drawn again."""
    page.evaluate(RECORD_TEXTS, panel)
    page.set_viewport_size({"width": 1300, "height": 900})
    while not (written := page.evaluate("window.written")):
        page.wait_for_timeout(20)
    return list(written)


def test_an_axis_that_counts_marks_whole_numbers_only(page: Page) -> None:
    numbers = {text for text in written_texts(page, 3) if text.replace(".", "").isdigit()}
    assert {text for text in numbers if float(text) < 10.0} == {"1", "2", "3"}


def test_a_low_panel_has_numbers_beside_zero_at_its_y_axis(page: Page) -> None:
    assert {"-0.2", "0.0", "0.2"} <= set(written_texts(page, 4))


@pytest.mark.parametrize("turn", [-100, 100])
def test_the_wheel_stops_at_ranges_that_an_axis_cannot_show(page: Page, turn: int) -> None:
    page.locator(".u-over").first.evaluate(
        """(over, deltaY) => {
          const { left, width } = over.getBoundingClientRect();
          for (let i = 0; i < 300; i += 1)
            over.dispatchEvent(new WheelEvent("wheel",
              { deltaY, ctrlKey: true, clientX: left + width / 5, cancelable: true }));
        }""",
        turn,
    )
    page.get_by_role("button", name="Whole").click()
    assert shows_blue(page.locator("canvas").first)


def test_panels_that_zoom_together_keep_one_range_when_a_line_is_hidden(page: Page) -> None:
    below = page.locator("canvas").nth(1)
    before = below.evaluate("(each) => each.toDataURL()")
    page.get_by_role("button", name="long").click()
    page.wait_for_function(
        "([canvas, before]) => canvas.toDataURL() !== before", arg=[below.element_handle(), before]
    )
