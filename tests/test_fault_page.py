"""docs/faults.md: every fault has existing tests, and the page is up to date."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest

HOW = "run: .venv/bin/python -m pytest --fault-page FILE..."


@pytest.fixture(scope="module")
def page() -> Any:
    path = Path(__file__).parent.parent / "docs" / "fault_page.py"
    spec = importlib.util.spec_from_file_location("fault_page", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_fault_has_a_test(page: Any) -> None:
    declared = page.find_marked()
    assert sorted(page.ROWS) == list(range(1, 53))
    assert set(declared) == set(page.ROWS)


def test_the_page_names_existing_tests(page: Any) -> None:
    text = page.PAGE.read_text(encoding="utf-8")
    entries_by_row, declared = page.read(text), page.find_marked()
    assert page.render(entries_by_row) == text, HOW
    for number, entries in entries_by_row.items():
        for entry in entries:
            assert entry.function in declared.get(number, set()), HOW
    assert all(entries_by_row[number] for number in page.ROWS), HOW


def test_the_page_keeps_lines_of_tests_that_did_not_run_and_replaces_the_others(page: Any) -> None:
    name, gone = "tests/somewhere.py::test_it", "tests/somewhere.py::test_gone"
    old, new = page.Entry(name, "old"), [page.Entry(name, "new 1"), page.Entry(name, "new 2")]
    before = page.render({2: [old, page.Entry(gone, "of a test that is gone")]})
    kept = page.read(page.update(before, {}, set(), {2: {name}}))
    assert kept[2] == [old]
    after = page.read(page.update(before, {2: new}, {name}, {2: {name}}))
    assert after[2] == [page.Entry(name, "new 1; new 2")]
    assert all(after[number] == [] for number in page.ROWS if number != 2)
    other = page.read(page.update(before, {}, set(), {2: {name}, 3: {gone}}))
    assert other[3] == [page.Entry(gone, "not measured yet")]
    assert page.as_figure("a | b\n < c `d`") == "a / b ‹ c 'd'"


def test_marks_are_found_in_functions_classes_and_parameters(page: Any, tmp_path: Path) -> None:
    file = tmp_path / "tests" / "test_x.py"
    file.parent.mkdir()
    file.write_text(
        "@pytest.mark.fault(3)\nclass TestIt:\n    def test_a(self): ...\n"
        "@pytest.mark.parametrize('n', [pytest.param(1, marks=pytest.mark.fault(5))])\n"
        "@pytest.mark.fault(4)\ndef test_b(n): ...\n"
    )
    assert page.find_marked(file.parent) == {
        3: {"tests/test_x.py::TestIt::test_a"},
        4: {"tests/test_x.py::test_b"},
        5: {"tests/test_x.py::test_b"},
    }
