"""Guards of motion: each guard occurs in the code and names existing tests."""

from __future__ import annotations

import re
from collections import Counter

import pytest

from tests.guards.guard import ROOT, Guard, functions_of, guards, sections
from tests.guards.removed import PAGE, page

HOW = "run: .venv/bin/python -m tests.guards.removed --page"


def test_the_code_of_each_guard_occurs_once() -> None:
    for each in guards():
        text = (ROOT / each.file).read_text(encoding="utf-8")
        assert each.removed_from(text) != text


def test_the_code_without_a_guard_is_valid_python() -> None:
    for each in guards():
        compile(
            each.removed_from((ROOT / each.file).read_text(encoding="utf-8")), each.file, "exec"
        )


def test_the_replacement_of_a_guard_uses_only_names_of_its_file() -> None:
    """After a rename, the tests of a guard would fail with AttributeError, with or without it."""
    for each in guards():
        text = (ROOT / each.file).read_text(encoding="utf-8")
        for name in re.findall(r"\bself\.(\w+)", each.without):
            assert re.search(rf"\b{name}\b", text), f"{each.guard}: {each.file} has no {name}"


def test_each_guard_names_existing_tests() -> None:
    functions: dict[str, set[str]] = {}
    for each in guards():
        assert each.tests, f"{each.guard} names no test"
        for test in each.tests:
            file, _, function = test.partition("::")
            if file not in functions:
                functions[file] = functions_of(ROOT / file)
            assert function in functions[file], (
                f"{each.guard} names a test that does not exist: {test}"
            )


def test_each_guard_is_listed_once() -> None:
    assert [
        name for name, count in Counter(each.guard for each in guards()).items() if count > 1
    ] == []


def test_the_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(sections()), HOW


@pytest.mark.parametrize("text", ["", "if late:\nif late:\n"])
def test_a_guard_that_occurs_never_or_twice_is_an_error(text: str) -> None:
    guard = Guard(guard="Late.", file="a.py", code="if late:", tests=("tests/test_a.py::test_a",))
    with pytest.raises(ValueError, match=r"a\.py"):
        guard.removed_from(text)
