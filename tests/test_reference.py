"""The reference pages say what the code says."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

REFERENCE = Path(__file__).resolve().parent.parent / "docs" / "reference"


def test_the_reference_pages_are_what_the_code_says() -> None:
    # In a process of its own: the help's width is read when the command line is first imported.
    code = (
        "import importlib.util, json\n"
        f"spec = importlib.util.spec_from_file_location('make', {str(REFERENCE / 'make.py')!r})\n"
        "make = importlib.util.module_from_spec(spec); spec.loader.exec_module(make)\n"
        "print(json.dumps([make.command_line(), make.files()]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONIOENCODING": "utf-8"},
    )
    command_line, files = json.loads(done.stdout)
    how = "run: .venv/bin/python docs/reference/make.py"
    assert (REFERENCE / "command-line.md").read_text(encoding="utf-8") == command_line, how
    assert (REFERENCE / "files.md").read_text(encoding="utf-8") == files, how
