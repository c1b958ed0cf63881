"""docs/security.md: each promise names its tests, and each promise of a test is on the page."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "security.md"
_ROW = re.compile(r"^\| `([a-z0-9-]+)` \|(.*)\|$", re.MULTILINE)
_TEST = re.compile(r"`(tests/[^`]+)`")


@pytest.fixture(scope="module")
def marked() -> dict[str, set[str]]:
    """Return the tests marked with `promise`, by the name of the promise."""
    spec = importlib.util.spec_from_file_location("fault_page", ROOT / "docs" / "fault_page.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found: dict[str, set[str]] = module.find_marked(mark="promise")
    return found


def test_each_promise_names_its_tests(marked: dict[str, set[str]]) -> None:
    rows = _ROW.findall(PAGE.read_text(encoding="utf-8"))
    assert rows
    for name, rest in rows:
        named = set(_TEST.findall(rest))
        assert named, f"{name}: names no test"
        assert named <= marked.get(name, set()), f"{name}: a test does not exist or lacks the mark"


def test_each_marked_promise_occurs_once_on_the_page(marked: dict[str, set[str]]) -> None:
    names = [name for name, _ in _ROW.findall(PAGE.read_text(encoding="utf-8"))]
    assert sorted(names) == sorted(marked)
