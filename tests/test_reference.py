"""Reference pages agree with the code."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

from config.error_codes import declared_codes

REFERENCE = Path(__file__).resolve().parent.parent / "docs" / "reference"


def test_the_reference_pages_agree_with_the_code() -> None:
    # In a separate process: the width of the help is read at the first import of the command line.
    code = (
        "import importlib.util, json\n"
        f"spec = importlib.util.spec_from_file_location('make', {str(REFERENCE / 'make.py')!r})\n"
        "make = importlib.util.module_from_spec(spec); spec.loader.exec_module(make)\n"
        "pages = make.command_line(), make.files(), make.results(), make.result_schema()\n"
        "pages += (make.python_api(),)\n"
        "pages += make.drive_objects(), make.servo_profiles()\n"
        "print(json.dumps(pages))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONIOENCODING": "utf-8"},
    )
    how = "run: .venv/bin/python docs/reference/make.py"
    names = ("command-line.md", "files.md", "results.md", "result.schema.json", "python-api.md")
    *pages, objects, profiles = json.loads(done.stdout)
    for name, page in zip(names, pages, strict=True):
        assert (REFERENCE / name).read_text(encoding="utf-8") == page, how
    guide = (REFERENCE.parent / "guide" / "your-own-drives.md").read_text(encoding="utf-8")
    assert f"<!-- objects -->\n{objects}<!-- objects end -->" in guide, how
    assert f"<!-- profiles -->\n{profiles}<!-- profiles end -->" in guide, how


def test_every_key_of_a_file_has_a_description() -> None:
    page = (REFERENCE / "files.md").read_text(encoding="utf-8")
    keys = [line for line in page.splitlines() if line.startswith("| `")]
    assert keys
    assert [line for line in keys if line.endswith("|  |")] == []


def test_the_page_of_error_codes_agrees_with_the_code() -> None:
    path = REFERENCE / "errors.py"
    spec = importlib.util.spec_from_file_location("errors_page", path)
    assert spec is not None
    assert spec.loader is not None
    page = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(page)
    written = (REFERENCE / "errors.md").read_text(encoding="utf-8")
    assert written == page.errors(), "run: .venv/bin/python docs/reference/errors.py"
    assert written.count("\n### RID-") == len(declared_codes())
