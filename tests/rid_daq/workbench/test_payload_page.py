"""An interrupted payload session is resumed on its page, which shows the options in effect."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from acquisition.runs.folder import RunFolder
from rid_daq.operations.payload.payload_identify import KnownQuantity, VerdictLimits
from rid_daq.operations.payload.payload_session import PayloadSessionRequest
from rid_daq.operations.payload.session_states import SessionFile
from tests.builders.certified import certified_session
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.workbench.conftest import OpenPage, give_back, ready, take_cell

pytestmark = pytest.mark.slow

CELL = "ir361"


@pytest.fixture(scope="module")
def session(served_pages: ServedProcess) -> str:
    """Return an interrupted session with options that differ from the defaults."""
    runs = served_pages.folder / "runs"
    request = PayloadSessionRequest(
        cell=CELL,
        runs=runs,
        label="gripper",
        model=served_pages.folder / "robot.json",
        known=(
            KnownQuantity(name="m", value=12.0, sigma=0.02),
            KnownQuantity(name="cz", value=0.1, sigma=0.01),
        ),
        repeats=3,
        practise=True,
        limits=VerdictLimits(mass_percent=20.0),
    )
    folder = RunFolder.create(runs, "gripper", kind="payload session")
    SessionFile.begin(folder, CELL, request.choices)
    return folder.run_id


@pytest.fixture
def page(open_page: OpenPage, served_pages: ServedProcess) -> Iterator[Page]:
    """Open the Payload page of a user who has leased the cell, which is ready to move."""
    opened = open_page()
    take_cell(opened)
    opened.get_by_role("link", name="Payload", exact=True).click()
    ready(opened, served_pages)
    yield opened
    give_back(opened)


def sent_request(page: Page) -> dict[str, Any]:
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


def test_the_page_shows_and_keeps_the_options_of_a_session(
    page: Page, session: str, problems: list[str]
) -> None:
    page.reload()  # show the new session
    page.locator(f".resume[data-run='{session}']").click()
    shown = {"mass": "12", "mass-sigma": "0.02", "label": "gripper", "mass-limit": "20"}
    shown |= {"centre-limit": "10", "repeats": "3", "model": "robot.json"}
    for field, value in shown.items():
        expect(page.locator(f"#{field}")).to_have_value(value)
    expect(page.locator("#practise")).to_be_checked()
    expect(page.locator("#going-on")).to_contain_text("cz is known: 0.1 ± 0.01.")
    expect(page.locator("#begin")).to_have_text("Resume gripper")
    assert sent_request(page) == {"resume": session}
    problems.clear()  # the browser reports the refusal


def test_changed_options_are_sent_even_with_default_values(
    page: Page, session: str, problems: list[str]
) -> None:
    page.reload()
    page.locator(f".resume[data-run='{session}']").click()
    for field, value in {
        "mass": "",
        "mass-limit": "5",
        "mass-limit-kg": "0.05",
        "repeats": "1",
    }.items():
        page.locator(f"#{field}").fill(value)
    page.locator("#model").select_option("")
    request = sent_request(page)
    limits: dict[str, float | None] = {
        "mass_percent": 5,
        "centre_mm": 10,
        "inertia_percent": 100,
        "residual_percent": 20,
    }
    limits |= {"mass_kg": 0.05, "inertia_kg_m2": None, "residual_nm": None}
    known = [{"name": "cz", "value": 0.1, "sigma": 0.01}]
    left = {"known": known, "limits": limits, "repeats": 1, "model": None}
    assert request == {"resume": session, **left}
    page.locator("#anew").click()
    expect(page.locator("#mass-limit")).to_have_value("5")
    expect(page.locator("#begin")).to_have_text("Start the session")
    problems.clear()


def test_a_stopped_session_can_be_resumed_without_a_reload(
    page: Page, session: str, served_pages: ServedProcess, long_motion: str
) -> None:
    (served_pages.folder / "long.yaml").write_text(long_motion)
    page.reload()
    expect(page.locator(".resume")).to_have_count(1)
    page.locator("#motion").select_option("long.yaml")
    expect(page.locator("#periods")).to_be_disabled()  # the file contains its own number
    page.locator("#begin").click()
    page.get_by_role("dialog").get_by_role("button", name="is clear: start").click()
    expect(page.locator("[data-stage=rehearse]")).to_contain_text("now")
    page.locator("#stop").click()
    expect(page.locator("#job .verdict.end")).to_contain_text("Payload session: stopped")
    expect(page.locator("#now-next a.main")).to_have_attribute("href", "#resume-card")
    expect(page.locator(".resume")).to_have_count(2)
    expect(page.locator(".resume").first).to_be_enabled()


def test_a_new_session_closes_the_earlier_result_and_its_entries(
    page: Page, served_pages: ServedProcess, long_motion: str, problems: list[str]
) -> None:
    earlier = certified_session(served_pages.folder / "runs", "earlier").folder.run_id
    (served_pages.folder / "long.yaml").write_text(long_motion)
    page.goto(page.url.split("?")[0] + f"?run={earlier}")
    expect(page.locator("#result .verdict").first).to_be_visible()
    page.locator("#label").fill("next")
    page.locator("#motion").select_option("long.yaml")
    page.locator("#begin").click()
    page.get_by_role("dialog").get_by_role("button", name="is clear: start").click()
    expect(page.locator("[data-stage=rehearse]")).to_contain_text("now")
    expect(page.locator("#result-card")).to_be_hidden()
    assert earlier not in page.url
    page.locator("#stop").click()
    expect(page.locator("#job .verdict.end")).to_contain_text("Payload session: stopped")
    page.reload()
    expect(page.locator("#result-card")).to_be_hidden()
    expect(page.locator("#label")).to_have_value("payload")  # the default
    problems.clear()  # the earlier session is of another robot: its payload is not drawn
