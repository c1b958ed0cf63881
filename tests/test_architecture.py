"""docs/architecture.md: its picture is what the imports say, its walks go where the code goes."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = ("docs/architecture.md", "docs/extending.md", "docs/theory.md", "CONTRIBUTING.md")
STATION = re.compile(r"^\d+\. (?:\*(process|file)\* )?`([\w/]+\.py)`", re.MULTILINE)
WALKS = 3


@pytest.fixture(scope="module")
def house() -> ModuleType:
    spec = importlib.util.spec_from_file_location("architecture", ROOT / "docs/architecture.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def walks() -> list[tuple[str, list[tuple[str, str]]]]:
    """Return each walk's title, and its stations: how they are entered, and the file."""
    page = (ROOT / "docs/architecture.md").read_text()
    parts = re.split(r"^### ", page[page.index("## Three walks") :], flags=re.MULTILINE)[1:]
    return [(part.splitlines()[0], STATION.findall(part)) for part in parts]


def test_the_picture_is_what_the_imports_say(house: ModuleType) -> None:
    page = (ROOT / "docs/architecture.md").read_text()
    assert page == house.with_drawing(page), "run: .venv/bin/python docs/architecture.py"


@pytest.mark.parametrize("page", PAGES)
def test_every_file_that_a_page_names_is_there(page: str) -> None:
    text = (ROOT / page).read_text()
    named = re.findall(r"`((?:\w+/)+\w+\.(?:py|md|html|yaml))`", text)
    written = set(re.findall(r"^`([\w/.]+)`:$", text, re.MULTILINE))  # by the reader
    gone = sorted({name for name in named if not (ROOT / name).exists()} - written)
    assert gone == [], f"{page} names files that have moved: write down where they are now"


def test_there_are_three_walks() -> None:
    assert len(walks()) == WALKS


@pytest.mark.parametrize("walk", walks(), ids=lambda walk: walk[0])
def test_each_station_is_joined_to_one_before_it(
    house: ModuleType, walk: tuple[str, list[tuple[str, str]]]
) -> None:
    """By an import, one way or the other; or it is said to be another process, or a file."""
    title, stations = walk
    modules = {path: path.removesuffix(".py").replace("/", ".") for _, path in stations}
    imports = {path: house.imported(ROOT / path) for path in modules}
    lonely = []
    for number, (boundary, path) in enumerate(stations[1:], start=1):
        before = [earlier for _, earlier in stations[:number]]
        joined = any(
            modules[path] in imports[other] or modules[other] in imports[path] for other in before
        )
        if not (joined or boundary):
            lonely.append(path)
    assert lonely == [], (
        f"walk '{title}' of docs/architecture.md: these stations import none before them and are"
        " imported by none: the code goes another way now; walk it again and write it down"
    )
    counted = re.search(r"(\d+) files", title)
    assert counted is not None
    assert int(counted[1]) == len(modules), "say in the walk's title how many files it has"
