"""Figures in a real browser with the strict content policy: no error, not wider than the page."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page

from rid_daq.figures.embedding import as_csv
from tests.builders.drawn_figures import all_figures
from tests.builders.figure_page import served_figures
from tests.rid_daq.conftest import PATIENCE_MS

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def figures() -> dict[str, object]:
    return dict(all_figures())


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
    assert page.evaluate(
        "document.querySelectorAll('[data-figure] > div:last-child > *').length"
    ) == len(figures)
    assert errors == []
    page.close()


def test_a_figure_is_saved_as_svg_and_as_csv(browser: Browser, figures) -> None:
    errors: list[str] = []
    with served_figures({"payload": figures["payload"]}) as address:
        page = open_page(browser, address, 1280, "light", errors)
        wait_until_shown(page)
        with page.expect_download() as saved:
            page.get_by_role("button", name="SVG").click()
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


def test_a_figure_turns_dark_with_the_page(browser: Browser, figures) -> None:
    errors: list[str] = []
    with served_figures({"payload": figures["payload"]}) as address:
        page = open_page(browser, address, 1280, "light", errors)
        wait_until_shown(page)
        with page.expect_response(lambda answer: "dark=true" in answer.url):
            page.emulate_media(color_scheme="dark")
        wait_until_shown(page)
        assert page.locator("[data-figure] > div:last-child > *").count() == 1
        page.close()
    assert errors == []


def test_a_figure_that_cannot_be_loaded_shows_the_reason(browser: Browser, figures) -> None:
    shown = dict(figures)
    with served_figures({"payload": shown["payload"], "friction": shown["friction"]}) as address:
        page = browser.new_page(viewport={"width": 390, "height": 900})
        page.route("**/figures/payload*", lambda route: route.abort())
        page.route(
            "**/figures/friction*",
            lambda route: route.fulfill(
                status=404, content_type="application/json", body='{"detail": "no such run"}'
            ),
        )
        page.goto(address)
        wait_until_shown(page)
        messages = page.get_by_role("status").all_inner_texts()
        assert messages == [
            "The figure cannot be shown: the server does not answer. Check that the service"
            " runs, then reload the page.",
            "The figure cannot be shown: no such run",
        ]
        page.close()
