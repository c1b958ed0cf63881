from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, expect, sync_playwright

from config.load import load_cell, to_yaml
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from tests.builders.invented import whole_result

PATIENCE_MS = 180_000
"""It ends a test of a page that fails; one that passes never waits for it."""
QUIET = (
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Debian's chromium, one for a file of tests; without it they are skipped, in CI they fail.

    Playwright has an event loop under way as long as it lasts: no other may begin in its process.
    """
    chromium = shutil.which("chromium")
    if chromium is None and not os.environ.get("CI"):
        pytest.skip("this test needs chromium; on Debian: apt install chromium")
    assert chromium is not None, "this test needs chromium; on Debian: apt install chromium"
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as driver:
        running = driver.chromium.launch(executable_path=chromium, args=list(QUIET))
        yield running
        running.close()


@pytest.fixture(scope="session")
def six_axis_motion(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Path]:
    """Return what writes a short motion of the six-axis cell, of so many periods, to a file."""

    def written(periods: int) -> Path:
        cell = load_cell("kr15")
        asked = design_two_harmonic(
            cell.robot,
            TwoHarmonicOptions(
                3.216, highest_harmonic=4, limit_fraction=0.35, tries=8, seed=3, periods=periods
            ),
            cell.config.cycle_time_s,
        )
        path = tmp_path_factory.mktemp("motion") / "motion.yaml"
        path.write_text(to_yaml(asked), encoding="utf-8")
        return path

    return written


@pytest.fixture
def runs(workshop: Path) -> list[str]:
    """The option that names the runs of a file's own `workshop`."""
    return ["--runs", str(workshop / "runs")]


@pytest.fixture
def result() -> dict[str, Any]:
    """A whole result document with invented numbers: every section of the report is there."""
    return whole_result()


@pytest.fixture(scope="session")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A certificate with its key, for servers by TLS."""
    folder = tmp_path_factory.mktemp("tls")
    key, cert = folder / "key.pem", folder / "cert.pem"
    subprocess.run(
        [
            *("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256"),
            *("-nodes", "-keyout", str(key), "-out", str(cert), "-days", "2", "-subj", "/CN=live"),
        ],
        check=True,
        capture_output=True,
    )
    both = folder / "live.pem"
    both.write_bytes(cert.read_bytes() + key.read_bytes())
    return both
