"""Minimum percentage of lines that the fast tests must execute: its computation and check."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.builders import measured_lines
from tests.builders.measured_lines import added, main, shares

FILE = "config/process/file_locks.py"
OTHER = "config/process/own_process.py"
COMPILED = "dynamics/kernels/rigid_body.py"


@pytest.fixture(autouse=True)
def house_of_three_files(monkeypatch: pytest.MonkeyPatch) -> None:
    files = [measured_lines.ROOT / name for name in (FILE, OTHER, COMPILED)]
    monkeypatch.setattr(measured_lines, "_sources", lambda: files)


def write_counts(folder: Path, name: str, **files: dict[str, list[int]]) -> None:
    """Write the line counts of one process; `file` and `other` represent two source files."""
    paths = {"file": FILE, "other": OTHER}
    counts = {"files": {paths[word]: lines for word, lines in files.items()}}
    (folder / f"{name}.json").write_text(json.dumps(counts))


def test_a_line_counts_once_for_all_processes(tmp_path: Path) -> None:
    write_counts(tmp_path, "1", file={"executed_lines": [1, 2], "missing_lines": [3, 4]})
    write_counts(tmp_path, "2", file={"executed_lines": [2, 3], "missing_lines": [1, 4]})
    assert added(tmp_path)[FILE] == (3, 4)


def test_a_file_that_was_never_imported_counts_with_all_its_lines(tmp_path: Path) -> None:
    write_counts(tmp_path, "1", file={"executed_lines": [1, 2], "missing_lines": []})
    reached, of = added(tmp_path)[OTHER]
    assert reached == 0
    assert of > 2


def test_lines_compiled_by_numba_are_not_counted(tmp_path: Path) -> None:
    assert set(added(tmp_path)) == {FILE, OTHER}


def test_a_package_below_its_minimum_fails_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_counts(tmp_path, "1", file={"executed_lines": [1, 2], "missing_lines": [3, 4]})
    monkeypatch.setattr(measured_lines, "added", lambda _folder: {FILE: (3, 4), OTHER: (1, 4)})
    monkeypatch.setattr(measured_lines, "FLOORS", {"config": 50.0})
    assert main([str(tmp_path)]) == 0
    monkeypatch.setattr(measured_lines, "FLOORS", {"config": 50.1})
    assert main([str(tmp_path), "--worst", "1"]) == 1
    shown = capsys.readouterr().out
    assert "config           50.0 %, floor 50.1 %: BELOW" in shown
    assert f"3 of    4 lines not reached: {OTHER}" in shown


def test_the_share_is_of_lines_and_not_of_files() -> None:
    assert shares({FILE: (0, 1), OTHER: (9, 9)})["config"] == pytest.approx(90.0)
