"""Fixtures: pages in new browser profiles, and a served simulated cell for each test file."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, Page, expect

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from rid_daq.service.records import CellState
from tests.builders.bad_link import BadLink, bad_link
from tests.rid_daq.conftest import PATIENCE_MS
from tests.rid_daq.service.conftest import ServedProcess, long_motion, motion, served, serving
from tests.rid_daq.service.moving import leased_cell

__all__ = ["long_motion", "motion", "served"]


@pytest.fixture(scope="module")
def served_pages(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedProcess]:
    """Run a service of the bundled simulated cell as a process, once for each test file."""
    with serving(tmp_path_factory.mktemp("pages")) as running:
        yield running


OpenPage = Callable[..., Page]

REPLACED = "WebSocket is closed before the connection is established"
"""Chromium's warning if a page closes a connection before an overloaded service accepts it."""

READ_BACK = "GPU stall due to ReadPixels"
"""Chromium's warning if a screenshot of a 3-D drawing is taken without a graphics card."""


@pytest.fixture
def problems() -> list[str]:
    """Errors on the browsers' consoles; a test that expects errors clears the list."""
    return []


@pytest.fixture
def open_page(
    browser: Browser, served_pages: ServedProcess, problems: list[str]
) -> Iterator[OpenPage]:
    """Return a function that opens a page in a new browser profile, by default logged in.

    After the test, it fails on errors and warnings in the consoles of the pages.
    """
    contexts = []

    def note(message: ConsoleMessage) -> None:
        is_known = any(known in message.text for known in (REPLACED, READ_BACK))
        if message.type in ("error", "warning") and not is_known:
            problems.append(message.text)

    def opened(*, known: bool = True, dark: bool = False, width: int = 1280) -> Page:
        context = browser.new_context(
            viewport={"width": width, "height": 900}, color_scheme="dark" if dark else "light"
        )
        context.set_default_timeout(PATIENCE_MS)
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("console", note)
        page.goto(served_pages.url if known else served_pages.url.split("?")[0])
        return page

    yield opened
    for context in contexts:
        context.close()
    assert problems == []


@pytest.fixture
def open_page_of(browser: Browser) -> Iterator[OpenPage]:
    """Return a function that opens an address in a new browser profile."""
    contexts = []

    def opened(address: str) -> Page:
        context = browser.new_context()
        context.set_default_timeout(PATIENCE_MS)
        contexts.append(context)
        page = context.new_page()
        page.goto(address)
        return page

    yield opened
    for context in contexts:
        context.close()


@pytest.fixture
def link(served_pages: ServedProcess) -> Iterator[BadLink]:
    """Run a proxy to the service that can stall, delay or cut connections."""
    with bad_link(urlsplit(served_pages.url).port or 0) as link:
        yield link


@pytest.fixture(scope="module")
def program_lease(served_pages: ServedProcess, long_motion: str) -> Iterator[str]:
    """Lease the cell as a program, with the cell ready to move, and yield the key."""
    with leased_cell(served_pages, long_motion) as key:
        yield key


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """Return a new browser profile in which console errors are allowed."""
    context = browser.new_context(viewport={"width": 1366, "height": 900})
    context.set_default_timeout(PATIENCE_MS)
    yield context
    context.close()


OpenByLink = Callable[[], Page]


@pytest.fixture
def open_by_link(context: BrowserContext, link: BadLink, served_pages: ServedProcess) -> OpenByLink:
    """Return a function that opens the cell's page over the link, logged in."""

    def opened() -> Page:
        page = context.new_page()
        port = urlsplit(served_pages.url).port
        page.goto(served_pages.url.replace(f":{port}/", f":{link.port}/"))
        expect(page.locator("body")).to_have_attribute("data-cell", "ir361")
        return page

    return opened


def go_to(page: Page, tab: str) -> None:
    """Open a page by its tab."""
    page.get_by_role("link", name=tab, exact=True).click()
    expect(page.locator(f'nav a[aria-current]:text-is("{tab}")')).to_be_visible()


@pytest.fixture(scope="session")
def screenshots() -> Path:
    """Return the folder of the screenshots: RID_DAQ_SCREENSHOTS, or build/screenshots."""
    root = Path(__file__).parents[3]
    folder = Path(os.environ.get("RID_DAQ_SCREENSHOTS") or root / "build" / "screenshots")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def take_cell(page: Page, note: str = "a test") -> None:
    """Lease the cell with the page's button."""
    page.locator("#lease-take").click()
    page.locator("#note").fill(note)
    page.keyboard.press("Enter")
    expect(page.locator("#lease-back")).to_be_visible()


def give_back(page: Page) -> None:
    page.locator("#lease-back").click()
    expect(page.locator("#lease-take")).to_be_visible()


def checked(page: Page) -> None:
    """Check the cell with the page's button."""
    page.locator("#check").click()
    expect(page.locator("#job .verdict.end")).to_have_text("Check: done")
    expect(page.locator("#state")).to_have_text("ready")


def ready(page: Page, served: ServedProcess) -> None:
    """Check the cell, unless it is still ready to move."""
    with served.client as client:
        known = client.cell("ir361").state is CellState.READY
    if not known:
        checked(page)


def estimated(root: Path, label: str, value: float, robot: str = "ir361") -> str:
    """Write a run with an estimate of one parameter, and return its id."""
    folder = RunFolder.create(root, label)
    folder.finish(RunStatus.COMPLETE, {"robot": robot})
    parameter = {"name": "fc1", "words": "Coulomb friction of axis1", "unit": "N m"}
    section = {"parameters": [{**parameter, "value": value, "std": 0.1}]}
    folder.file("result.json").write_text(json.dumps({"estimate": section}))
    return folder.run_id
