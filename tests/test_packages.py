"""The layout's own promises: our generic package names are ours alone, and files stay small."""

from __future__ import annotations

import importlib
import importlib.metadata
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = (
    "acquisition",
    "compensation",
    "config",
    "drivers",
    "dynamics",
    "identification",
    "mock_hw",
    "rid_daq",
)


@pytest.mark.parametrize("package", PACKAGES)
def test_no_other_distribution_ships_a_package_of_our_name(package: str) -> None:
    distributions = importlib.metadata.packages_distributions().get(package, [])
    assert set(distributions) <= {"rid-daq"}
    module = importlib.import_module(package)
    assert module.__file__ is not None
    assert Path(module.__file__).resolve().parent == ROOT / package


def test_a_file_is_one_noun_of_at_most_400_lines() -> None:
    long = {
        str(path.relative_to(ROOT)): lines
        for package in (*PACKAGES, "tests", "benchmarks")
        for path in (ROOT / package).rglob("*.py")
        if (lines := len(path.read_text().splitlines())) > 400
    }
    assert long == {}


def test_an_init_file_holds_one_docstring_and_nothing_else() -> None:
    for package in PACKAGES:
        for path in (ROOT / package).rglob("__init__.py"):
            text = path.read_text().strip()
            assert text.startswith('"""'), path
            assert text.endswith('"""'), path
            assert text.count('"""') == 2, path


@pytest.mark.parametrize(
    "module",
    ["acquisition.task.process", "acquisition.session.cycle_recorder", "mock_hw.drives_process"],
)
def test_a_process_of_a_cell_starts_without_what_it_does_not_use(module: str) -> None:
    heavy = ("pandas", "asammdf", "scipy.sparse", "scipy.optimize", "matplotlib", "typer")
    program = f"import sys, {module}; print({{*{heavy}}} & set(sys.modules))"
    shown = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert shown.stdout == "set()\n"
