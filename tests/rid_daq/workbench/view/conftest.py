"""A browser that draws 3-D pictures without a graphics card."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, expect, sync_playwright

from tests.builders.browser_drawing import WEBGL
from tests.rid_daq.conftest import PATIENCE_MS, QUIET, chromium_path


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Start Chromium with WebGL once for each test file."""
    expect.set_options(timeout=PATIENCE_MS)
    quiet = [option for option in QUIET if option != "--disable-gpu"]
    with sync_playwright() as driver:
        path = chromium_path()
        running = driver.chromium.launch(executable_path=path, args=[*quiet, *WEBGL])
        yield running
        running.close()
