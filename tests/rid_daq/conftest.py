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
"""Timeout of page tests [ms]; a test that passes never waits so long."""
QUIET = (
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)


def chromium_path() -> str:
    """Return the path of Debian's chromium; without it, the test is skipped, and fails in CI.

    The package chromium-headless-shell is used if it is installed, because it needs half the CPU
    time.
    """
    chromium = shutil.which("chromium-headless-shell") or shutil.which("chromium")
    if chromium is None and not os.environ.get("CI"):
        pytest.skip("this test needs chromium; on Debian: apt install chromium")
    assert chromium is not None, "this test needs chromium; on Debian: apt install chromium"
    return chromium


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Start Debian's chromium once for each test file.

    Playwright's event loop runs until the process ends, so the process must not start another event
    loop.
    """
    chromium = chromium_path()
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as driver:
        running = driver.chromium.launch(executable_path=chromium, args=list(QUIET))
        yield running
        running.close()


@pytest.fixture(scope="session")
def six_axis_motion(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Path]:
    """Return a function that writes a short periodic motion of the six-axis cell to a file."""

    def written(periods: int) -> Path:
        cell = load_cell("kr15")
        motion = design_two_harmonic(
            cell.robot,
            TwoHarmonicOptions(
                3.216, highest_harmonic=4, limit_fraction=0.35, tries=8, seed=3, periods=periods
            ),
            cell.config.cycle_time_s,
        )
        path = tmp_path_factory.mktemp("motion") / "motion.yaml"
        path.write_text(to_yaml(motion), encoding="utf-8")
        return path

    return written


@pytest.fixture
def runs(workshop: Path) -> list[str]:
    """Return the option `--runs` for the folder of the test file's fixture `workshop`."""
    return ["--runs", str(workshop / "runs")]


@pytest.fixture
def result() -> dict[str, Any]:
    """Return a result document with invented numbers and most sections of the report."""
    return whole_result()


@pytest.fixture(scope="session")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file with a TLS certificate and its key."""
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
