"""Remove guards of motion, one by one, and check that a test of each guard fails.

`python -m tests.guards.removed [TEXT...]` tries the guards whose sentence or file contains one of
the texts. Without a text it tries all guards, which takes about half an hour. The guards are
removed in a temporary copy of the project. `--page` writes `docs/guards.md` instead.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from tests.guards.guard import ROOT, Guard, Section, guards, sections

PAGE: Final = ROOT / "docs" / "guards.md"
FAILED: Final = 1
"""Exit code of pytest if a test failed."""

_HEAD: Final = """# Guards of motion

Each row is a check that refuses a motion before it begins, or stops a motion while it runs. The
tests in the last column fail if the check is removed: `python -m tests.guards.removed` removes each
check in a copy of the project and runs them. `tests/guards/test_guards.py` fails if a check or a
test of this page no longer exists. Failures of drives, buses and programs are on the page
[faults](faults.md); promises about people and programs without permission are on the page
[security](security.md).

rid-daq is not a safety function. The cell's own emergency stop is required and must be within
reach.

The command `python -m tests.guards.removed --page` writes this page from the lists in
`tests/guards`.
"""


def page(parts: Sequence[Section]) -> str:
    """Return the text of `docs/guards.md`."""
    lines = [_HEAD]
    for part in parts:
        lines += [
            f"## {part.title}",
            "",
            "| guard | code | tests that fail without the guard |",
            "|---|---|---|",
        ]
        for each in part.guards:
            tests = "<br>".join(f"`{test}`" for test in each.tests)
            lines.append(f"| {each.guard} | `{each.file}` | {tests} |")
        lines.append("")
    return "\n".join(lines)


def copy_project(target: Path) -> None:
    """Copy the project's files, and its compiled kernels, which take minutes to compile again."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout.decode()
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name)
    for folder in {path.parent for path in target.rglob("*.py")}:
        cache = folder / "__pycache__"
        for kernel in (ROOT / cache.relative_to(target)).glob("*.nb[ic]"):
            cache.mkdir(exist_ok=True)
            shutil.copy2(kernel, cache)


def fails_without(guard: Guard, copy: Path) -> bool:
    """Return True if a test of the guard fails in a copy of the project without the guard."""
    path = copy / guard.file
    text = path.read_text(encoding="utf-8")
    path.write_text(guard.removed_from(text), encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    try:
        command += ["-o", "timeout=120", *guard.tests]
        ran = subprocess.run(command, cwd=copy, env=environment, capture_output=True, check=False)
    finally:
        path.write_text(text, encoding="utf-8")
    return ran.returncode == FAILED


def main() -> int:
    """Try the guards, or write the page; return 1 if no test fails without a guard."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("texts", nargs="*", metavar="TEXT", help="Part of a sentence or file name.")
    parser.add_argument("--page", action="store_true", help="Write docs/guards.md.")
    options = parser.parse_args()
    if options.page:
        PAGE.write_text(page(sections()), encoding="utf-8")
        return 0
    chosen = [
        each
        for each in guards()
        if not options.texts
        or any(text in each.guard or text in each.file for text in options.texts)
    ]
    missed = 0
    with tempfile.TemporaryDirectory(prefix="guards-") as folder:
        copy_project(Path(folder))
        for each in chosen:
            held = fails_without(each, Path(folder))
            missed += not held
            sys.stdout.write(f"{'held' if held else 'NOT HELD'}: {each.guard} ({each.file})\n")
            sys.stdout.flush()
    sys.stdout.write(f"{len(chosen)} guards, {missed} without a failing test\n")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
