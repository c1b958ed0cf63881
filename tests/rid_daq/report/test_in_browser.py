"""A report in a browser: zoom, print, dark theme, phone, without scripts, without network."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page
from pypdf import PdfReader

from rid_daq.report.result import Result
from rid_daq.report_page.render import render_report
from tests.builders.invented import whole_result
from tests.rid_daq.conftest import PATIENCE_MS

KEPT = Path(__file__).parent / "results"
LEFT_OUT = ("tracking", "truth", "average", "validation")

CUT_OFF = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
PAPER = "getComputedStyle(document.body).backgroundColor"
CURVES_INK = "getComputedStyle(document.querySelector('.still svg text')).fill"
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the file address of the report of a stopped run, with curves, tables and a payload."""
    document = {key: part for key, part in whole_result().items() if key not in LEFT_OUT}
    payload = json.loads((KEPT / "payload_session.json").read_bytes())["payload"]
    result = Result.model_validate_json(json.dumps({**document, "payload": payload}))
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(render_report(result), encoding="utf-8")
    return path.as_uri()


@pytest.fixture
def complaints() -> list[str]:
    return []


def open_report(
    browser: Browser, report: str, complaints: list[str], *, width: int, dark: bool, scripts: bool
) -> Page:
    context = browser.new_context(
        viewport={"width": width, "height": 900},
        color_scheme="dark" if dark else "light",
        java_script_enabled=scripts,
        offline=True,
    )
    page = context.new_page()
    page.on(
        "console",
        lambda message: complaints.append(message.text) if message.type != "info" else None,
    )
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda sent: complaints.append(sent.url) if sent.url != report else None)
    page.goto(report)
    return page


def wait_until_shown(page: Page) -> None:
    for plot in page.locator("[data-plot]").all():
        plot.scroll_into_view_if_needed()
        plot.locator('.live[data-figure-state="shown"]').wait_for(timeout=PATIENCE_MS)


def test_plots_can_be_zoomed_follow_the_theme_and_print_in_light_colours(
    browser: Browser, report: str, complaints: list[str]
) -> None:
    page = open_report(browser, report, complaints, width=1280, dark=False, scripts=True)
    wait_until_shown(page)
    assert page.locator(".still:visible").count() == 0
    place = page.locator('[data-plot^="fit"]')
    place.evaluate("(plot) => plot.scrollIntoView()")
    box = place.locator(".u-over").first.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 40)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 100, steps=4)
    page.mouse.up()
    place.get_by_role("button", name="Whole").wait_for()
    page.emulate_media(color_scheme="dark")
    wait_until_shown(page)
    assert page.evaluate(PAPER) == "rgb(20, 27, 34)"
    page.emulate_media(color_scheme="dark", media="print")
    assert page.evaluate(PAPER) == "rgb(255, 255, 255)"
    assert page.evaluate(CURVES_INK) == "rgb(27, 37, 48)"
    assert page.locator(".live:visible").count() == 0
    plots = page.locator("[data-plot]").count()
    assert page.locator(".still:visible").count() == plots > 3
    printed = PdfReader(io.BytesIO(page.pdf(prefer_css_page_size=True)))
    text = " ".join(sheet.extract_text() for sheet in printed.pages)
    assert "following error" in text
    assert all(sheet.mediabox.width == pytest.approx(595, abs=1) for sheet in printed.pages)
    assert complaints == []


def test_the_report_fits_a_phone_and_passes_axe(
    browser: Browser, report: str, complaints: list[str]
) -> None:
    page = open_report(browser, report, complaints, width=390, dark=True, scripts=True)
    wait_until_shown(page)
    assert page.evaluate(CUT_OFF) == 0
    assert complaints == []
    found = Axe().run(page)
    assert found.violations_count == 0, found.generate_report()


def test_without_scripts_static_drawings_are_shown(
    browser: Browser, report: str, complaints: list[str]
) -> None:
    page = open_report(browser, report, complaints, width=390, dark=True, scripts=False)
    assert page.locator(".still svg:visible").count() > 4
    assert page.locator(".live:visible").count() == 0
    assert page.locator("body").bounding_box()["width"] == 390  # type: ignore[index]
    assert complaints == []
