"""Every error has a stable code; the codes are declared with cause and remedy."""

from __future__ import annotations

import ast
import tomllib
from collections import Counter
from pathlib import Path

import pytest

from config.error_codes import declared_codes
from tests.builders.code_lines import PACKAGES, ROOT
from tests.builders.error_codes_in_use import (
    CODE,
    codes_in_use,
    error_classes,
    errors_without_code,
    modules,
)
from tests.builders.syntax_trees import source_files, text_of

WITHOUT_CODE = {
    "config": 0,
    "dynamics": 0,
    "drivers": 0,
    "acquisition": 0,
    "identification": 0,
    "compensation": 0,
    "mock_hw": 0,
    "rid_daq": 0,
}
"""Number of errors that each package constructs without a code: these numbers must not grow."""


@pytest.fixture(scope="module")
def classes() -> dict[str, bool]:
    return error_classes()


def _declaring_files() -> list[Path]:
    return sorted((ROOT / "config" / "bundled" / "error_codes").glob("*.toml"))


def test_every_code_in_use_is_declared_and_every_declared_code_is_in_use() -> None:
    used, declared = codes_in_use(), {code.name for code in declared_codes()}
    assert used - declared == set()
    assert declared - used == set()


def test_every_code_in_use_is_named_in_a_test() -> None:
    texts = map(text_of, source_files("tests"))
    named = {found.group() for text in texts for found in CODE.finditer(text)}
    assert codes_in_use() - named == set()


def test_every_code_in_use_has_its_entry_on_the_page() -> None:
    page = (ROOT / "docs" / "reference" / "errors.md").read_text("utf-8")
    entries = [line.removeprefix("### ") for line in page.splitlines() if line[:5] == "### R"]
    assert sorted(entries) == sorted(codes_in_use())


def test_no_code_is_declared_twice() -> None:
    declared = Counter(
        name for path in _declaring_files() for name in tomllib.loads(path.read_text("utf-8"))
    )
    assert [name for name, times in declared.items() if times > 1] == []


def test_codes_of_a_file_are_sorted() -> None:
    for path in _declaring_files():
        names = list(tomllib.loads(path.read_text("utf-8")))
        assert names == sorted(names), path.name


def test_a_code_has_a_name_with_an_area_and_a_sentence_for_cause_and_remedy() -> None:
    for code in declared_codes():
        assert CODE.fullmatch(code.name), code
        for sentence in (code.cause, code.remedy):
            assert sentence[:1].isupper(), code
            assert sentence.endswith("."), code
            assert len(sentence.split()) <= 30, code


@pytest.mark.parametrize("package", PACKAGES)
def test_the_number_of_errors_without_a_code_does_not_grow(
    package: str, classes: dict[str, bool]
) -> None:
    places = [
        f"{path}:{line}"
        for path, module in modules(package)
        for line in errors_without_code(module, classes)
    ]
    assert len(places) == WITHOUT_CODE[package], places


def test_an_error_of_each_kind_is_counted(classes: dict[str, bool]) -> None:

    source = (
        'raise ConfigError("x")\nraise errors.LimitError("x")\nSdoAbort(1)\nsystem_errors(K, "x")'
    )
    module = ast.parse(source)
    assert errors_without_code(module, classes) == [1, 2, 4]
    coded = ast.parse(
        'raise ConfigError("x", code="RID-FILE-READ")\nraise ConfigError("x", code="")'
    )
    assert errors_without_code(coded, classes) == [2]
