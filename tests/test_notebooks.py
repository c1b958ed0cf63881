"""Notebooks run unchanged and agree with the pages from which they are made."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest

NOTEBOOKS = Path(__file__).resolve().parents[1] / "docs" / "notebooks"
PAGES = sorted(NOTEBOOKS.glob("*.md"))


@pytest.fixture(scope="module")
def make() -> Any:
    spec = importlib.util.spec_from_file_location("notebooks", NOTEBOOKS / "make.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_notebook_agrees_with_its_page(page: Path, make: Any) -> None:
    written = page.with_suffix(".ipynb").read_text(encoding="utf-8")
    assert written == make.to_notebook(page.read_text(encoding="utf-8")), (
        "run docs/notebooks/make.py"
    )


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_notebook_runs_without_an_error(
    page: Path, make: Any, real_robot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in ("ur10e", "ur10"):
        (tmp_path / folder).symlink_to(real_robot.parent / folder)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for number, cell in enumerate(make.find_cells(page.read_text(encoding="utf-8")), start=1):
        exec(compile(cell, f"{page.name}, cell {number}", "exec"), names)
