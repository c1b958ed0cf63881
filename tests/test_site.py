"""The documentation site: it builds without a warning, and `rid-daq docs` finds its pages."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from config.errors import ConfigError
from rid_daq.app import run
from rid_daq.command_line.root import COMMANDS
from rid_daq.operations.start import docs
from tests.builders.raised_codes import raises_code
from tests.rid_daq.conftest import browser

__all__ = ["browser"]  # a fixture

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, ROOT / "docs" / "site" / "build.py", folder],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder


def test_the_site_loads_nothing_from_other_servers(site: Path) -> None:
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        for tag in ("<script src=", '<link rel="stylesheet" type="text/css" href=', "<img src="):
            assert f'{tag}"http' not in text, page
    assert "coulomb" in (site / "searchindex.js").read_text()


def test_the_search_lists_decisions_after_guides(site: Path) -> None:
    order = (site / "_static" / "language_data.js").read_text().split("score:")[1]
    assert "decisions" in order[:90]
    assert "wide.css" in (site / "index.html").read_text()


@pytest.mark.parametrize("width", [390, 820, 1030, 1215, 1216, 1320, 1472])
def test_a_page_uses_the_width_of_its_window(site: Path, browser: Browser, width: int) -> None:
    with browser.new_page(viewport={"width": width, "height": 800}) as page:
        for name in ("guide/friction", "guide/payload", "glossary", "architecture"):
            page.goto((site / f"{name}.html").as_uri())
            cut = page.evaluate("document.documentElement.scrollWidth - innerWidth")
            assert cut <= 0, name


def test_diagrams_are_rendered_and_not_shown_as_text(site: Path) -> None:
    for source in (ROOT / "docs").rglob("*.md"):
        expected = source.read_text(encoding="utf-8").count("```mermaid")
        page = site / source.relative_to(ROOT / "docs").with_suffix(".html")
        shown = page.read_text(encoding="utf-8")
        assert shown.count('<div class="drawing"') == expected, page
        assert "flowchart LR" not in shown
    assert "acquisition/session/plate_recorder.py" in (site / "architecture.html").read_text()


def test_pictures_are_small_and_used() -> None:
    folder = ROOT / "docs" / "pictures"
    pictures = {path.name: path for path in folder.glob("*.png")}
    pages = "".join(
        page.read_text() for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md"))
    )
    assert set(re.findall(r"pictures/([\w-]+\.png)\)", pages)) == set(pictures)
    assert all(path.stat().st_size <= 150_000 for path in pictures.values())


def test_a_topic_opens_its_page_or_lists_the_candidates(site: Path) -> None:
    assert docs.find_page(site, None) == site / "index.html"
    assert docs.find_page(site, "payload") == site / "guide" / "payload.html"
    assert docs.find_page(site, "faults") == site / "faults.html"
    assert docs.find_page(site, "0042").name == "0042-the-service.html"
    with raises_code(ConfigError, "RID-DOCS-PAGE", "'drive'", "decisions/0019-drive-monitor, "):
        docs.find_page(site, "drive")
    with raises_code(ConfigError, "RID-DOCS-PAGE", "'welding'"):
        docs.find_page(site, "welding")


def test_the_command_prints_the_address_of_the_page(
    site: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(docs, "SITE", site)
    assert run(["docs", "theory", "--no-open"]) == 0
    assert capsys.readouterr().out.strip() == (site / "theory.html").as_uri()
    assert run(["docs", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"page": str(site / "index.html")}


def test_an_installation_without_the_site_is_an_error_that_says_where_to_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(docs, "SITE", tmp_path)
    assert run(["docs"]) == 2
    assert "[RID-DOCS-MISSING]" in capsys.readouterr().err
    assert "docs" in COMMANDS
