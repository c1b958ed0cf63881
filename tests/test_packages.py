"""Layout of the project: names of packages, sizes of files and folders, cost of imports."""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from tests.builders.code_lines import PACKAGES, ROOT
from tests.builders.syntax_trees import source_files, text_of, tree_of


@pytest.fixture(scope="module")
def distributions() -> Mapping[str, list[str]]:
    """Return every installed package with the distributions that contain it."""
    return importlib.metadata.packages_distributions()


@pytest.mark.parametrize("package", PACKAGES)
def test_no_other_distribution_contains_a_package_of_our_name(
    package: str, distributions: Mapping[str, list[str]]
) -> None:
    assert set(distributions.get(package, [])) <= {"rid-daq"}
    module = importlib.import_module(package)
    assert module.__file__ is not None
    assert Path(module.__file__).resolve().parent == ROOT / package


def test_a_file_has_at_most_400_lines() -> None:
    long = {
        str(path.relative_to(ROOT)): lines
        for path in source_files(*PACKAGES, "tests", "benchmarks")
        if (lines := len(text_of(path).splitlines())) > 400
    }
    assert long == {}


def test_a_subpackage_has_at_most_20_files() -> None:
    """`__init__.py` counts too."""
    full = {
        str(room.relative_to(ROOT)): files
        for package in PACKAGES
        for room in [ROOT / package, *(ROOT / package).rglob("*/")]
        if (files := len(list(room.glob("*.py")))) > 20
    }
    assert full == {}


def test_an_init_file_contains_one_docstring_and_only_the_api_more() -> None:
    for package in PACKAGES:
        for path in (ROOT / package).rglob("__init__.py"):
            if path == ROOT / "rid_daq" / "api" / "__init__.py":
                continue  # the public names
            text = path.read_text().strip()
            assert text.startswith('"""'), path
            assert text.endswith('"""'), path
            assert text.count('"""') == 2, path


SCIPY_PARTS = ("scipy.optimize", "scipy.interpolate", "scipy.integrate", "scipy.spatial")
OF_A_PROCESS = ("pandas", "asammdf", "scipy.sparse", "scipy.optimize", "matplotlib", "click")
OF_A_COMMAND = ("scipy.stats", "scipy.signal", "uvicorn", "starlette")
UNUSED = {
    "rid_daq.runs.run_data": ("numba", "llvmlite", "scipy", "matplotlib"),
    "acquisition.session.cycle_recorder": OF_A_PROCESS,
    "acquisition.task.process": OF_A_PROCESS,
    "acquisition.session.record": ("scipy",),
    "rid_daq.preflight.preflight": ("scipy",),
    "mock_hw.cell": ("scipy", "pinocchio", "numba", "pymodbus.server"),
    "mock_hw.drives_process": OF_A_PROCESS,
    "rid_daq.operations.experiment.record": OF_A_COMMAND,
    "rid_daq.operations.identify.identify": OF_A_COMMAND,
    "rid_daq.operations.identify.identified_runs": (*(*SCIPY_PARTS, "scipy.signal", "matplotlib"),),
    "rid_daq.api": ("scipy.signal", "scipy.stats", "matplotlib"),
}
"""Libraries that a module, and the modules before it, must not import: they cost time and memory.

One process imports the modules in this order; begin with the modules that need the least.
"""


@pytest.fixture(scope="module")
def imported() -> dict[str, list[str]]:
    """For each module in `UNUSED`: libraries that it must not import, but that are imported."""
    program = (
        "import importlib, json, sys\n"
        "found = {}\n"
        "for module, libraries in json.loads(sys.argv[1]).items():\n"
        "    importlib.import_module(module)\n"
        "    found[module] = [each for each in libraries if each in sys.modules]\n"
        "print(json.dumps(found))\n"
    )
    words = [sys.executable, "-c", program, json.dumps(UNUSED)]
    shown = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, check=True)
    found: dict[str, list[str]] = json.loads(shown.stdout)
    return found


@pytest.mark.parametrize("module", UNUSED)
def test_a_module_imports_no_unused_library(module: str, imported: dict[str, list[str]]) -> None:
    assert imported[module] == []


def test_a_report_without_a_figure_imports_no_plot_library() -> None:
    """Otherwise a recording command would spend half of its time on importing these libraries."""
    program = (
        "import sys\n"
        "from pathlib import Path\n"
        "from rid_daq.report.result import Result\n"
        "from rid_daq.report_page.render import render_report\n"
        "page = render_report(Result.model_validate_json(Path(sys.argv[1]).read_bytes()))\n"
        "print(len(page) > 1000, {'matplotlib'} & set(sys.modules))\n"
    )
    recorded = ROOT / "tests" / "rid_daq" / "report" / "results" / "recording.json"
    words = [sys.executable, "-c", program, str(recorded)]
    shown = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, check=True)
    assert shown.stdout.strip() == "True set()"


def test_only_test_files_contain_marks() -> None:
    """`.ci/run` finds marks only in `test_*.py`; a test with a mark elsewhere would not run."""
    marks = ("mark" + ".slow", "mark" + ".alone")
    found = [
        str(path.relative_to(ROOT))
        for path in source_files("tests")
        if not path.name.startswith("test_") and any(mark in text_of(path) for mark in marks)
    ]
    assert found == []


WIDEST = 8


def wide_functions(path: Path) -> Iterator[str]:
    """Yield the functions of a file with too many parameters, except compiled kernels."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = node.args
            names = [each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
            width = len([name for name in names if name not in ("self", "cls")])
            width += (given.vararg is not None) + (given.kwarg is not None)
            if width > WIDEST:
                marks = " ".join(map(ast.unparse, node.decorator_list))
                if "kernel" not in marks and "njit" not in marks:
                    yield node.name


def test_a_function_has_at_most_eight_parameters() -> None:
    """Compiled kernels are excluded: they have one parameter per array."""
    files = source_files(*PACKAGES)
    wide = {f"{path.relative_to(ROOT)}: {name}" for path in files for name in wide_functions(path)}
    assert wide == set()


def test_the_program_has_few_untyped_dictionaries() -> None:
    """Data with a known structure have a class; dictionaries only hold data that are passed on."""
    found = {
        str(path.relative_to(ROOT)): count
        for path in source_files("rid_daq")
        if (count := text_of(path).count("dict[str, Any]"))
    }
    assert sum(found.values()) <= 15, found


def test_the_kind_of_a_motion_is_hardly_ever_queried() -> None:
    """Differences between the kinds of motion belong in their classes."""
    kinds = ROOT / "acquisition" / "motion" / "kinds"
    names = {
        node.name
        for path in kinds.glob("*.py")
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.ClassDef) and node.name.endswith("Motion")
    }
    queries = {
        f"{path.relative_to(ROOT)}: {ast.unparse(node)}"
        for path in source_files(*PACKAGES)
        if kinds not in path.parents and re.search("isinstance|issubclass", text_of(path))
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("isinstance", "issubclass")
        if names & set(re.findall(r"\w+", ast.unparse(node.args[1])))
    }
    assert len(names) > 8
    assert len(queries) <= 3, queries


def test_the_help_of_a_command_imports_no_numerical_library() -> None:
    """The module of a command contains only its options; a call imports the implementation."""
    program = (
        "import io, sys, contextlib\n"
        "from rid_daq.app import run\n"
        "from rid_daq.command_line.root import COMMANDS\n"
        "groups = [('payload', 'session'), ('payload', 'identify'), ('plate', 'zero'),\n"
        "          ('drives', 'restore')]\n"
        "for words in [*((name,) for name in COMMANDS), *groups]:\n"
        "    with contextlib.redirect_stdout(io.StringIO()) as shown:\n"
        "        assert run([*words, '--help']) == 0, words\n"
        "    assert 'Usage: rid-daq ' + ' '.join(words) in shown.getvalue(), words\n"
        "print(sorted({name.split('.')[0] for name in sys.modules}))\n"
    )
    shown = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT, check=True
    )
    imported = set(ast.literal_eval(shown.stdout.splitlines()[-1]))
    numerics = {"numpy", "scipy", "numba", "casadi", "pinocchio", "coal", "clarabel", "control"}
    others = {"can", "fastapi", "httpx", "jinja2", "matplotlib", "mcap", "pymodbus", "serial"}
    packages = {"drivers", "dynamics", "mock_hw"}
    assert not imported & (numerics | others | packages | {"starlette", "uvicorn", "yaml"})
