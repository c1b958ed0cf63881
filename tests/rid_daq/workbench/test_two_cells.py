"""A service of two cells over TLS, used by an administrator and by a read-only device."""

from __future__ import annotations

import re
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from config.load import load_cell
from tests.rid_daq.conftest import PATIENCE_MS
from tests.rid_daq.service.conftest import ServedProcess, serving
from tests.rid_daq.workbench.conftest import take_cell

pytestmark = pytest.mark.slow

ARM = "two-arm"
WARM = "two-warm"
TOO_WARM = "  warmest_k: 280.0\n"
"""Text for the end of a cell file, after its monitor: a limit below all motor temperatures."""


def cell_file(folder: Path, bundled: str, name: str, more: str = "") -> str:
    """Write a bundled cell with another name and a separate bus, and return its file."""
    (folder / name).mkdir()
    for file, content in load_cell(bundled).files.items():
        text = content.decode()
        if file == "cell.yaml":
            text = re.sub(f"^name: {bundled}$", f"name: {name}", text, flags=re.MULTILINE) + more
            text = text.replace(f"channel: {bundled}", f"channel: {name}")
            text = text.replace("port: 50215", f"port: {free_port()}")
        (folder / name / file).write_text(text)
    return str(folder / name / "cell.yaml")


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port: int = free.getsockname()[1]
    return port


@pytest.fixture(scope="module")
def served_two(
    tmp_path_factory: pytest.TempPathFactory, certificate: Path
) -> Iterator[ServedProcess]:
    """Run a service of two cells over TLS; one cell is too warm to move."""
    folder = tmp_path_factory.mktemp("two")
    arm, warm = cell_file(folder, "ir361", ARM), cell_file(folder, "kr15", WARM, TOO_WARM)
    with serving(folder, warm, "--certificate", str(certificate), cell=arm) as running:
        yield running


@pytest.fixture(scope="module")
def administrator(browser: Browser, served_two: ServedProcess) -> Iterator[Page]:
    """Open a page with the link from the terminal."""
    context = browser.new_context(ignore_https_errors=True, viewport={"width": 820, "height": 900})
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(served_two.url)
    yield page
    context.close()


@pytest.fixture
def tablet(browser: Browser) -> Iterator[BrowserContext]:
    """Return a browser profile without a token."""
    context = browser.new_context(ignore_https_errors=True)
    context.set_default_timeout(PATIENCE_MS)
    yield context
    context.close()


def test_a_red_preflight_gives_advice_for_each_device(administrator: Page) -> None:
    page = administrator
    expect(page).to_have_url(re.compile(f"^https://.*/cells/{ARM}$"))
    page.locator("#cell-choice").select_option(WARM)
    expect(page.get_by_role("heading", level=1)).to_have_text(f"Cell {WARM}")
    take_cell(page)
    page.locator("#check").click()
    expect(page.locator("#job .verdict.end")).to_contain_text("Check: failed")
    expect(page.locator("#job").get_by_role("button", name="Check again")).to_be_visible()
    expect(page.locator("#preflight-words")).to_contain_text("Red: ")
    expect(page.locator("#preflight-words")).to_contain_text("the preflight has failed")
    preflight = page.locator("#preflight")
    expect(preflight.locator("table").first.locator("tr.red").first).to_be_visible()
    expect(preflight).to_contain_text("let the motor cool down")
    warm = page.locator('[data-joint="axis1"] [data-show="temperature"]')
    expect(warm).to_have_text(re.compile(r"^\d\d °C at the preflight$"))
    expect(page.locator("#jog")).to_be_disabled()
    page.locator("#lease-back").click()
    page.locator("#cell-choice").select_option(ARM)
    expect(page.locator("#preflight-words")).to_contain_text("This cell has had no preflight yet.")


def test_a_read_only_device_sees_everything_and_moves_nothing(
    administrator: Page, tablet: BrowserContext, served_two: ServedProcess
) -> None:
    page = tablet.new_page()
    page.goto(served_two.url.split("?")[0])
    expect(page.locator("#code")).to_have_text(re.compile(r"\d{3} \d{3}"))
    administrator.get_by_role("link", name="Settings").click()
    administrator.locator("#pairing-name").fill("the wall")
    administrator.locator("#pairing-code").fill(page.locator("#code").inner_text())
    administrator.locator("#pairing-role").select_option("viewer")
    administrator.get_by_role("button", name="Grant access").click()

    expect(page.locator("#lease-words")).to_have_text("No one holds this cell.")
    (cookie,) = tablet.cookies()
    assert (cookie.get("secure"), cookie.get("httpOnly")) == (True, True)
    expect(page.locator("#lease-take")).to_be_hidden()
    expect(page.locator("#check")).to_be_disabled()
    expect(page.locator("[data-why=lease]")).to_contain_text("has read-only access")
    refused = page.evaluate(
        """async () => {
          const { ask } = await import("/static/service.js");
          return await ask("POST", "/cells/two-arm/lease", {}).catch((error) => error.kind);
        }"""
    )
    assert refused == "NotAllowedError"
    page.locator("#stop").click()
    expect(page.locator("#stop-words")).to_contain_text(
        "This service moves nothing in cell two-arm now."
    )

    take_cell(administrator, "seen by all")
    expect(page.locator("#lease-words")).to_contain_text("holds this cell (seen by all).")
    administrator.locator("#lease-back").click()
    for name in ("Experiment", "Identify", "Payload", "Compensation"):
        page.get_by_role("link", name=name, exact=True).click()
        expect(page.get_by_role("heading", level=1)).to_have_text(name)
        expect(page.get_by_text("has read-only access").first).to_be_attached()
