"""The Python that the scripts use: the base Python, and no shim or virtual environment."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("kind", ["shim", "virtual environment"])
def test_the_python_itself_is_named_so_that_the_environment_is_not_created_again(
    kind: str, tmp_path: Path
) -> None:
    """uv removes `.venv` during tests if it is given a path other than that of the base Python."""
    if kind == "shim":
        shim = tmp_path / "python3"
        shim.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
        shim.chmod(0o755)
    else:
        (tmp_path / "python3").symlink_to(sys.executable)
        (tmp_path / "pyvenv.cfg").write_text(f"home = {Path(sys.executable).parent}\n")
    found = subprocess.run(
        ["bash", "-c", ". ./environment.sh; rid_daq_python"],
        cwd=ROOT,
        env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    assert not found.startswith(str(tmp_path))
    assert Path(found).resolve() == Path(sys.executable).resolve()
