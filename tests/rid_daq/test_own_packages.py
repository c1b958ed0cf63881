"""Foreign packages and files with the names of our packages."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from config.process.own_process import own_python


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a user's folder with files that have the names of our packages."""
    (tmp_path / "config.py").write_text("raise SystemExit('the wrong config')\n")
    (tmp_path / "drivers").mkdir()
    (tmp_path / "drivers" / "__init__.py").write_text("raise SystemExit('the wrong drivers')\n")
    return tmp_path


@pytest.mark.parametrize(
    "command",
    [
        [sys.executable, "-m", "rid_daq", "--version"],
        own_python("rid_daq", "--version"),
    ],
)
def test_files_in_the_working_folder_do_not_hide_our_packages(
    command: list[str], folder: Path
) -> None:
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False
    )
    assert done.returncode == 0, done.stderr


def test_a_foreign_package_in_the_environment_is_named_with_a_remedy(folder: Path) -> None:
    done = subprocess.run(
        own_python("rid_daq", "--version"),
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert f"{folder}/config.py" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_python_api_names_the_file_that_hides_a_package(folder: Path) -> None:
    code = "import sys; sys.path.insert(0, '.'); import rid_daq.api"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )
    assert "ImportError" in done.stderr
    assert f"{folder}/config.py" in done.stderr
    assert "RID-INSTALL-HIDDEN" in done.stderr
