"""The example of the README, with its output."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

import pytest

README = Path(__file__).resolve().parents[3] / "README.md"
FILES = {"50sec.csv": "ur-20_02_12-50sec_12harm.csv", "ptp.csv": "ur-20_01_17-ptp_10_points.csv"}
BLOCK = re.compile(r"((?:^    .*\n|^\n)+)", re.MULTILINE)


@pytest.mark.slow
def test_the_example_of_the_readme_prints_the_shown_output(
    real_robot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = README.read_text(encoding="utf-8")
    start = text.index("    from rid_daq.api import")
    code, printed = (block.replace("\n    ", "\n") for block in BLOCK.findall(text[start:])[:2])
    for name, original in FILES.items():
        (tmp_path / name).symlink_to(real_robot / original)
    monkeypatch.chdir(tmp_path)
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(code.lstrip(), {})
    lines = output.getvalue().splitlines()
    for line in filter(None, map(str.strip, printed.splitlines())):
        assert line in lines or line == "…", output.getvalue()
