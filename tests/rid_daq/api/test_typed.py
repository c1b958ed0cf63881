"""Type checkers of other projects use the annotations of the public functions (PEP 561)."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.builders.code_lines import ROOT

PROGRAM = """
from rid_daq.api import Robot, identify, read_recording

model = identify(read_recording("a.csv", map="ur10e_31"), robot=Robot.load("ur10e"))
reveal_type(model.values)
model.inverse_dynamics("text", [0.0], [0.0], 1)
"""


def test_every_package_is_marked_as_typed() -> None:
    """The annotations of `rid_daq.api` name classes of the other packages."""
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    packages = declared["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert [each for each in packages if not (ROOT / each / "py.typed").is_file()] == []


@pytest.mark.slow
def test_a_wrong_argument_in_a_program_is_found(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    command = [sys.executable, "-m", "mypy", "--cache-dir", str(tmp_path / "cache"), "program.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "ndarray" in done.stdout
    assert "program.py:6: error: Too many" in done.stdout
    assert "py.typed" not in done.stdout
