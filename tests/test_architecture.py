"""docs/architecture.md: its diagram, tour and paths agree with the imports and calls."""

from __future__ import annotations

import ast
import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = ("docs/architecture.md", "docs/extending.md", "docs/theory.md", "CONTRIBUTING.md")
STATION = re.compile(r"^\d+\. (?:\*(process|file)\* )?`([\w/]+\.py)`", re.MULTILINE)
TOURS = 1
MOST_OF_MASS = 15
FUNCTION = re.compile(
    r"^\d+\. (?:(↳+) )?(?:\*(HTTP|standard input|process|file)\* )?`([\w/.]+)` `([\w.]+)`",
    re.MULTILINE,
)
JAVASCRIPT = r"(?:function {0}|\n  (?:async )?{0})\(.*?\n(?:  )?\}}\n"
"""Pattern of a JavaScript function of a module, or of a method of a class, by its name."""


@pytest.fixture(scope="module")
def architecture_page() -> ModuleType:
    spec = importlib.util.spec_from_file_location("architecture", ROOT / "docs/architecture.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def tours() -> list[tuple[str, list[tuple[str, str]]]]:
    """Return each tour's title and steps (boundary to the previous step, file)."""
    page = (ROOT / "docs/architecture.md").read_text()
    tours = page[page.index("## A tour through the files") : page.index("## Three paths")]
    parts = re.split(r"^### ", tours, flags=re.MULTILINE)[1:]
    return [(part.splitlines()[0], STATION.findall(part)) for part in parts]


def paths() -> list[tuple[str, list[tuple[str, str, str, str]]]]:
    """Return each path's title and steps (branch, boundary, file, function)."""
    page = (ROOT / "docs/architecture.md").read_text()
    parts = re.split(r"^### ", page[page.index("## Three paths") :], flags=re.MULTILINE)[1:]
    return [(part.splitlines()[0], FUNCTION.findall(part)) for part in parts]


def source_of(path: str, function: str) -> str:
    """Return the text of a function or method.

    Raises:
        AssertionError: The file has no such function.
    """
    text = (ROOT / path).read_text()
    if path.endswith(".js"):
        found = re.search(JAVASCRIPT.format(function), text, re.DOTALL)
        assert found is not None, f"{path} has no {function}"
        return found[0]
    body = ast.parse(text).body
    node: ast.AST | None = None
    for name in function.split("."):
        definitions = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
        named = [each for each in body if isinstance(each, definitions) and each.name == name]
        assert named, f"{path} has no {function}"
        node, body = named[0], named[0].body
    assert node is not None
    return str(ast.get_source_segment(text, node))


def test_the_diagram_agrees_with_the_imports(architecture_page: ModuleType) -> None:
    page = (ROOT / "docs/architecture.md").read_text()
    assert page == architecture_page.with_drawing(page), (
        "run: .venv/bin/python docs/architecture.py"
    )


@pytest.mark.parametrize("page", PAGES)
def test_every_file_named_on_a_page_exists(page: str) -> None:
    text = (ROOT / page).read_text()
    named = re.findall(r"`((?:\w+/)+\w+\.(?:py|md|html|yaml))`", text)
    written = set(
        re.findall(r"^`([\w/.]+)`:$", text, re.MULTILINE)
    )  # the reader of the page creates these files
    gone = sorted({name for name in named if not (ROOT / name).exists()} - written)
    assert gone == [], f"{page} names files that have moved: enter their new paths"


def test_the_page_has_one_walk() -> None:
    assert len(tours()) == TOURS


@pytest.mark.parametrize("tour", tours(), ids=lambda tour: tour[0])
def test_each_station_is_connected_to_an_earlier_one(
    architecture_page: ModuleType, tour: tuple[str, list[tuple[str, str]]]
) -> None:
    """Two steps are connected if one imports the other, or if the page states a process or file
    between them.
    """
    title, steps = tour
    modules = {path: path.removesuffix(".py").replace("/", ".") for _, path in steps}
    imports = {path: architecture_page.find_imports(ROOT / path) for path in modules}
    lonely = []
    for number, (boundary, path) in enumerate(steps[1:], start=1):
        before = [earlier for _, earlier in steps[:number]]
        joined = any(
            modules[path] in imports[other] or modules[other] in imports[path] for other in before
        )
        if not (joined or boundary):
            lonely.append(path)
    assert lonely == [], (
        f"tour '{title}' of docs/architecture.md: no import connects these steps with an earlier"
        " one; change the tour to follow the present code"
    )
    counted = re.search(r"(\d+) files", title)
    assert counted is not None
    assert int(counted[1]) == len(modules), "state the number of files in the tour's title"


@pytest.mark.parametrize("path", paths(), ids=lambda path: path[0])
def test_each_function_of_a_path_is_called_by_the_previous_one(
    path: tuple[str, list[tuple[str, str, str, str]]],
) -> None:
    title, steps = path
    assert f": {len(steps)} steps" in title
    callers = [""] * 6
    for branch, crossing, file, function in steps:
        text = source_of(file, function)
        name = function.split(".")[-1]
        caller = callers[max(len(branch) - 1, 0)]
        if caller and crossing not in ("HTTP", "standard input", "file"):
            called = rf"\b{'action' if caller.startswith('function press') else name}\b"
            assert re.search(called, caller), f"{title}: nothing calls {function} ({file}) there"
        callers[len(branch)] = text


def test_a_known_mass_passes_few_functions_on_its_way_to_the_certificate() -> None:
    assert len(paths()[2][1]) <= MOST_OF_MASS


def test_the_button_for_a_recording_starts_one() -> None:
    page = (ROOT / "rid_daq/workbench/static/experiment.js").read_text()
    assert 'press("record", panel, "record", () => panel.begin("record", recordRequest(' in page


def test_a_click_is_checked_by_the_service_and_by_the_worker() -> None:
    """The browser's form fields are a third check, which this test does not cover."""
    steps = [(file, function) for _, _, file, function in paths()[0][1] if file.endswith("py")]
    check = re.compile(r"\b(?:check_request|parse_request|of_json)\b")
    found = [function for file, function in steps if check.search(source_of(file, function))]
    assert found == ["CellService.begin", "work"]


def test_limits_are_checked_before_the_motion_and_by_the_supervisor() -> None:
    """`record_motion_file` refuses a feedforward beyond the limits before it asks the operator."""
    verify = re.compile(r"\bverify_limits\b")
    steps = [(file, function) for _, _, file, function in paths()[1][1]]
    found = [function for file, function in steps if verify.search(source_of(file, function))]
    assert found == ["record_motion_file", "Motion.plan", "_check_motion"]
