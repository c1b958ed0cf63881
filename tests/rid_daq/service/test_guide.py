"""The commands of docs/guide/ci-against-a-served-cell.md are run in an empty folder."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

GUIDE = Path(__file__).resolve().parents[3] / "docs" / "guide" / "ci-against-a-served-cell.md"


@pytest.mark.long
def test_the_ci_job_of_the_guide_runs_without_changes(tmp_path: Path) -> None:
    text = GUIDE.read_text(encoding="utf-8")
    (script,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (shell,) = re.findall(r"```sh\n(.*?)```", text, re.DOTALL)
    (tmp_path / "ci.py").write_text(script, encoding="utf-8")
    bin_folder = Path(sys.executable).parent
    with TemporaryDirectory() as runtime:  # the path of a socket has at most 107 bytes
        done = subprocess.run(
            ["bash", "-c", f"set -e\ntrap 'kill %1; wait' EXIT\n{shell}"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            env={
                **os.environ,
                "PATH": f"{bin_folder}:{os.environ['PATH']}",
                "XDG_RUNTIME_DIR": runtime,
            },
        )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "assed" in done.stdout.splitlines()[-1]
    assert (tmp_path / "report.html").read_bytes().startswith(b"<!DOCTYPE html>")
