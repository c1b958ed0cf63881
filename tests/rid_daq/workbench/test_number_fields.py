"""Number fields of the workbench: a decimal comma is accepted, ambiguous text is refused."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.workbench.conftest import OpenPage, give_back, ready, take_cell

pytestmark = pytest.mark.slow

CELL = "ir361"
READ = """async (texts) => {
  const { parseNumber } = await import("/static/dom.js");
  return texts.map(parseNumber).map((value) => (Number.isNaN(value) ? null : value));
}"""

COLOURS = """() => Object.fromEntries([...document.querySelectorAll("button")].map((each) => [
  each.id || each.textContent.trim(),
  getComputedStyle(each).backgroundColor.match(/[0-9]+/g).slice(0, 3).map(Number),
]))"""


def test_a_decimal_comma_is_read_and_ambiguous_numbers_are_refused(
    open_page: OpenPage,
) -> None:
    read: dict[str, float | None] = {
        "9.6": 9.6,
        "9,6": 9.6,
        " 12 ": 12.0,
        "-0,05": -0.05,
        ",5": 0.5,
        "1e-3": 1e-3,
        **dict.fromkeys(("", "1_5", "0x10", "1,234", "1.234,5", "9,6 kg", "Infinity", "1e999")),
        **dict.fromkeys(("NaN", "1,2,3", "--1", "9 6", ".")),
    }
    assert open_page().evaluate(READ, list(read)) == list(read.values())


@pytest.mark.parametrize(("typed", "mass"), [("9,6", 9.6), ("9.6", 9.6)])
def test_a_mass_with_a_decimal_comma_is_requested_correctly(
    open_page: OpenPage, served_pages: ServedProcess, problems: list[str], typed: str, mass: float
) -> None:
    page = open_page()
    take_cell(page)
    page.get_by_role("link", name="Payload", exact=True).click()
    ready(page, served_pages)
    _type_mass(page, typed)
    assert _sent_request(page)["known"][0]["value"] == mass
    problems.clear()  # the console reports the refused request
    give_back(page)


def test_a_mass_that_is_not_a_number_is_refused_at_its_field(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    page = open_page()
    take_cell(page)
    page.get_by_role("link", name="Payload", exact=True).click()
    ready(page, served_pages)
    _type_mass(page, "1,234")
    page.locator("#begin").click()
    mass, problem = page.locator("#mass"), page.locator("#mass-problem")
    expect(problem).to_contain_text('"1,234"')
    expect(mass).to_be_focused()
    expect(mass).to_have_attribute("aria-invalid", "true")
    expect(page.get_by_role("dialog")).to_have_count(0)
    mass.fill("1.234")
    expect(problem).to_be_empty()
    expect(mass).not_to_have_attribute("aria-invalid", "true")
    give_back(page)


def test_a_mass_beyond_the_robots_rating_is_doubted_before_anything_starts(
    open_page: OpenPage,
) -> None:
    page = open_page()
    page.get_by_role("link", name="Payload", exact=True).click()
    # the served robot states no rating
    page.locator("#mass").evaluate(
        "each => Object.assign(each.dataset, { mostKg: '12.5', mostWords: 'the rated payload' })"
    )
    doubt = page.locator("#mass-doubt")
    _type_mass(page, "12,6")
    expect(doubt).to_contain_text("the rated payload, 12.5 kg")
    page.locator("#mass").fill("12,5")
    expect(doubt).to_be_hidden()


def test_attaching_the_payload_can_be_practised_on_the_simulated_cell(
    open_page: OpenPage, served_pages: ServedProcess, problems: list[str]
) -> None:
    page = open_page()
    take_cell(page)
    page.get_by_role("link", name="Payload", exact=True).click()
    ready(page, served_pages)
    page.get_by_role("checkbox", name="Practise").check()
    assert _sent_request(page)["practise"] is True
    problems.clear()  # the console reports the refused request
    give_back(page)


def test_only_stop_is_red(open_page: OpenPage, served_pages: ServedProcess) -> None:
    page = open_page()
    take_cell(page)
    page.get_by_role("link", name="Payload", exact=True).click()
    ready(page, served_pages)
    page.locator("#begin").click()
    start = page.get_by_role("dialog").get_by_role("button", name="is clear: start")
    expect(start).to_be_visible()
    colours = page.evaluate(COLOURS)
    red = [name for name, (r, g, b) in colours.items() if r > 150 and g < 100 and b < 100]
    assert red == ["stop"]
    page.keyboard.press("Escape")
    give_back(page)


def _type_mass(page: Page, text: str) -> None:
    """Type into the field of the mass; the click waits until the page accepts input."""
    page.locator("#mass").click()
    page.locator("#mass").press_sequentially(text)
    expect(page.locator("#mass")).to_have_value(text)


def _sent_request(page: Page) -> dict[str, Any]:
    """Press the start button, and return the request, which is intercepted."""
    requests: list[Any] = []

    def keep(route: Route) -> None:
        requests.append(route.request.post_data_json)
        route.fulfill(status=409, json={"error": "Refused", "message": "kept by a test"})

    page.route(f"**/cells/{CELL}/jobs", keep)
    page.locator("#begin").click()
    page.get_by_role("dialog").get_by_role("button", name="is clear: start").click()
    expect(page.locator("#job")).to_contain_text("kept by a test")
    (sent,) = requests
    request: dict[str, Any] = sent["request"]
    return request
