"""Figures in a real browser with the strict content policy: no error, not wider than the page."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page

from rid_daq.blocks.plot import Plot
from rid_daq.figures.palette import DARK, LIGHT
from rid_daq.figures.plot_tables import as_csv
from tests.builders.drawn_figures import all_figures
from tests.builders.figure_page import served_figures
from tests.rid_daq.conftest import PATIENCE_MS

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def figures() -> dict[str, Plot]:
    return all_figures()


@pytest.fixture(scope="module")
def address(figures) -> Iterator[str]:
    with served_figures(figures) as served:
        yield served


def open_page(browser: Browser, address: str, width: int, scheme: str, errors: list[str]) -> Page:
    page = browser.new_page(
        viewport={"width": width, "height": 900},
        color_scheme="dark" if scheme == "dark" else "light",
        has_touch=width < 500,
    )

    def log_error(message: ConsoleMessage) -> None:
        if message.type != "info":
            errors.append(message.text)

    page.on("console", log_error)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(address)
    return page


def wait_until_shown(page: Page) -> None:
    for place in page.locator("[data-figure]").all():
        name = place.get_attribute("data-figure")
        page.wait_for_selector(
            f'[data-figure="{name}"]:is([data-figure-state=shown],[data-figure-state=failed])',
            timeout=PATIENCE_MS,
        )


@pytest.mark.parametrize(
    ("scheme", "width"), [("light", 360), ("light", 390), ("light", 1280), ("dark", 390)]
)
def test_all_figures_are_shown_without_an_error(
    browser: Browser, address: str, figures, width: int, scheme: str
) -> None:
    errors: list[str] = []
    page = open_page(browser, address, width, scheme, errors)
    wait_until_shown(page)
    states = [
        each.get_attribute("data-figure-state") for each in page.locator("[data-figure]").all()
    ]
    assert states == ["shown"] * len(figures)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    panels = sum(len(plot.panels) for plot in figures.values())
    assert page.locator("[data-figure] canvas").count() == panels
    assert errors == []
    page.close()


def test_a_figure_is_saved_as_svg_and_as_csv(browser: Browser, figures) -> None:
    errors: list[str] = []
    with served_figures({"payload": figures["payload"]}) as address:
        page = open_page(browser, address, 1280, "light", errors)
        wait_until_shown(page)
        with page.expect_download() as saved:
            page.get_by_role("link", name="SVG").click()
        assert saved.value.suggested_filename == "payload.svg"
        drawing = ElementTree.parse(saved.value.path()).getroot()
        texts = "".join(drawing.itertext())
        assert drawing.tag.endswith("svg")
        assert "x of the flange [mm]" in texts
        with page.expect_download() as table:
            page.get_by_role("link", name="CSV").click()
        assert table.value.path().read_text(encoding="utf-8") == as_csv(figures["payload"])
        page.close()
    assert errors == []


@pytest.fixture
def payload_page(browser: Browser, figures) -> Iterator[Page]:
    """Yield the page of the payload's figure; no error may be logged."""
    errors: list[str] = []
    with served_figures({"payload": figures["payload"]}) as address:
        page = open_page(browser, address, 1280, "light", errors)
        wait_until_shown(page)
        yield page
        page.close()
    assert errors == []


COLOURS = """(canvas) => {
  const { width, height } = canvas;
  const copy = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
  copy.drawImage(canvas, 0, 0);
  const { data } = copy.getImageData(0, 0, width, height);
  const found = new Set();
  for (let i = 0; i < data.length; i += 4)
    if (data[i + 3] === 255) found.add([data[i], data[i + 1], data[i + 2]].join());
  return [...found];
}"""


def hex_to_rgb(colour: str) -> str:
    return ",".join(str(int(colour[i : i + 2], 16)) for i in (1, 3, 5))


def test_a_figure_turns_dark_with_the_page(payload_page: Page) -> None:
    canvas = payload_page.locator("[data-figure] canvas").first
    assert hex_to_rgb(LIGHT["ink"]) in canvas.evaluate(COLOURS)
    payload_page.emulate_media(color_scheme="dark")
    payload_page.wait_for_function(
        f"(canvas) => ({COLOURS})(canvas).includes('{hex_to_rgb(DARK['ink'])}')",
        arg=canvas.element_handle(),
    )
    assert hex_to_rgb(LIGHT["ink"]) not in canvas.evaluate(COLOURS)


def test_the_pointer_shows_the_values_of_the_nearest_point(payload_page: Page) -> None:
    middle = payload_page.locator("[data-figure] .u-over").first
    box = middle.bounding_box()
    assert box is not None
    payload_page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    tip = payload_page.locator(".figure-tip").first
    assert tip.is_visible()
    payload_page.mouse.move(5, 5)
    assert not tip.is_visible()


def test_a_click_on_a_name_hides_its_lines(payload_page: Page) -> None:
    canvas = payload_page.locator("[data-figure] canvas").first
    name = payload_page.get_by_role("button", name="centre").first
    assert name.get_attribute("aria-pressed") == "true"
    before = canvas.evaluate("(each) => each.toDataURL()")
    name.click()
    assert name.get_attribute("aria-pressed") == "false"
    payload_page.wait_for_function(
        "([canvas, before]) => canvas.toDataURL() !== before", arg=[canvas.element_handle(), before]
    )


def test_a_drag_zooms_and_the_button_shows_the_whole_figure_again(payload_page: Page) -> None:
    canvas = payload_page.locator("[data-figure] canvas").first
    before = canvas.evaluate("(each) => each.toDataURL()")
    box = payload_page.locator("[data-figure] .u-over").first.bounding_box()
    assert box is not None
    whole = payload_page.get_by_role("button", name="Whole")
    assert not whole.is_visible()
    payload_page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.4 * box["height"])
    payload_page.mouse.down()
    payload_page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.6 * box["height"], steps=4)
    payload_page.mouse.up()
    whole.click()
    assert not whole.is_visible()
    payload_page.mouse.move(5, 5)
    payload_page.wait_for_function(
        "([canvas, before]) => canvas.toDataURL() === before", arg=[canvas.element_handle(), before]
    )


def test_a_figure_that_cannot_be_loaded_shows_the_reason(browser: Browser, figures) -> None:
    with served_figures({"payload": figures["payload"]}) as address:
        page = browser.new_page(viewport={"width": 390, "height": 900})
        page.route("**/figures/payload*", lambda route: route.fulfill(status=404))
        page.goto(address)
        wait_until_shown(page)
        (message,) = page.get_by_role("status").all_inner_texts()
        assert "404" in message
        page.close()
