"""Text of a preflight: one line per device, red lines with advice, and all lines on request."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rid_daq.preflight.check_line import CheckLine, Verdict
from rid_daq.preflight.check_words import all_blocks, show_devices
from rid_daq.terminal.block_printer import print_blocks
from rid_daq.terminal.console import Console


def line(
    where: str, what: str, found: str, required: str = "", verdict: Verdict = "ok"
) -> CheckLine:
    return CheckLine(where, what, required, found, verdict, f"mend {what}", where != "bus")


LINES = [
    line("bus", "load", "9 %", "≤ 80 %"),
    line("axis1, node 1", "serial number", "17", verdict="shown"),
    line("axis1, node 1", "SYNC", "128", "128"),
    line("axis1, node 1", "gear", "121:1", "121"),
    line("axis2, node 2", "serial number", "18", verdict="shown"),
    line("axis2, node 2", "SYNC", "128", "128"),
    line("axis2, node 2", "watch", "none", "one", "allowed"),
    line("axis2, node 2", "gear", "153:1", "100", "red"),
]


def test_each_device_has_a_line_followed_by_its_red_and_allowed_lines(
    capsys: pytest.CaptureFixture[str],
) -> None:
    show_devices(Console(), LINES)
    assert capsys.readouterr().out.splitlines() == [
        "ok      bus: load: 9 % (required ≤ 80 %)",
        "ok      axis1, node 1: 2 of 2 requirements hold",
        "RED     axis2, node 2: 1 of 3 requirements hold",
        "  RED     gear: 153:1, required 100",
        "          mend gear",
        "  allowed watch: none, required one",
    ]


def test_a_headline_is_shown_even_if_all_lines_are_ok(capsys: pytest.CaptureFixture[str]) -> None:
    reference = line("axis1, node 1", "6064h:00 position reference", "not known", verdict="shown")
    show_devices(Console(), [*LINES[1:3], replace(reference, headline="position reference")])
    assert capsys.readouterr().out.splitlines() == [
        "ok      axis1, node 1: 1 of 1 requirements hold; position reference: not known",
    ]


def test_all_lines_are_grouped_by_device_with_red_lines_first(
    capsys: pytest.CaptureFixture[str],
) -> None:
    print_blocks(all_blocks(LINES), Console())
    assert capsys.readouterr().out.splitlines() == [
        "",
        "every drive",
        "    what  found  required",
        "ok  SYNC  128    128",
        "",
        "bus",
        "    what  found  required",
        "ok  load  9 %    ≤ 80 %",
        "",
        "axis1, node 1",
        "    what           found  required",
        "-   serial number  17",
        "ok  gear           121:1  121",
        "",
        "axis2, node 2",
        "         what           found  required",
        "RED      gear           153:1  100",
        "-        serial number  18",
        "allowed  watch          none   one",
        "gear: mend gear",
    ]
