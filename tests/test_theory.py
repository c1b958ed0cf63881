"""docs/theory.md contains every equation, section and paper that the code cites."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache

from tests.builders.code_lines import PACKAGES as PROGRAM
from tests.builders.code_lines import ROOT
from tests.builders.syntax_trees import source_files, tree_of

PAGE = (ROOT / "docs/theory.md").read_text()
PACKAGES = (*PROGRAM, "benchmarks")
SECTION = re.compile(r"theory: (?:sections? )?((?:\d+(?:\.\d+)?(?:, | and )?)+)")
EQUATIONS = re.compile(r"\(((?:[2-6]|[A-D])\.\d+(?:(?:-|, )(?:[2-6]|[A-D])\.\d+)*)\)")
PAPER = re.compile(r"([A-Z][a-zé]+)(?:, [A-Z][a-z]+)*(?: and [A-Z]?[a-z]+)?,? \(?((?:19|20)\d\d)\b")
"""First author and year of a paper, with any number of authors in between."""


@cache
def docstrings() -> list[tuple[str, str]]:
    """Return the place of every docstring of the packages, and its text on one line."""
    found = []
    for path in source_files(*PACKAGES):
        for node in ast.walk(tree_of(path)):
            match node:
                case ast.Expr(ast.Constant(str(text))):
                    place = f"{path.relative_to(ROOT)}:{node.lineno}"
                    found.append((place, " ".join(text.split())))
    return found


def test_every_cited_section_exists() -> None:
    sections = set(re.findall(r"^#{2,3} (\d+(?:\.\d+)?)\.? ", PAGE, re.MULTILINE))
    cited = [
        (place, number)
        for place, text in docstrings()
        for match in SECTION.finditer(text)
        for number in re.findall(r"\d+(?:\.\d+)?", match[1])
    ]
    assert len(cited) > 20
    assert [item for item in cited if item[1] not in sections] == []


def test_every_cited_equation_of_the_thesis_exists() -> None:
    known = set(re.findall(r"\(((?:[2-6]|[A-D])\.\d+)\)", PAGE))
    for first, last in re.findall(r"\((\w\.\d+)\)\\text\{–\}\((\w\.\d+)\)", PAGE):
        known |= set(_between(first, last))
    cited = [
        (place, number)
        for place, text in docstrings()
        for match in EQUATIONS.finditer(text)
        for number in _numbers(match[1])
    ]
    assert len(cited) > 30
    assert [item for item in cited if item[1] not in known] == []


def test_every_cited_paper_is_in_the_references() -> None:
    references = PAGE[PAGE.index("## References") :].splitlines()
    missing = [
        (place, match[0])
        for place, text in docstrings()
        for match in PAPER.finditer(text)
        if not any(match[1] in line and match[2] in line for line in references)
    ]
    assert missing == []


def test_every_file_named_on_the_theory_page_exists() -> None:
    named = re.findall(r"`((?:\w+/)+\w+\.\w+)`", PAGE)
    assert len(named) > 40
    gone = [name for name in named if not (ROOT / name).exists()]
    assert gone == [], "docs/theory.md names files that have moved: correct its `Code:` lines"


def _numbers(text: str) -> list[str]:
    """Return the equation numbers of a citation such as `2.25, 2.26`.

    For a range such as `2.8-2.14`, its first and last number.
    """
    return re.split(", |-", text)


def _between(first: str, last: str) -> Iterator[str]:
    chapter, start = first.split(".")
    for number in range(int(start), int(last.split(".")[1]) + 1):
        yield f"{chapter}.{number}"
