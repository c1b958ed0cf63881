"""Write docs/faults.md: injected faults, required reactions and measured values.

``python -m pytest --fault-page FILE...`` replaces the entries of the tests that it runs, and keeps
all other entries. ``tests/test_fault_page.py`` compares the page with the existing tests.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "faults.md"


class Row(NamedTuple):
    """A fault, the required reaction, and the requirement on its speed or extent."""

    fault: str
    reaction: str
    bar: str


class Entry(NamedTuple):
    """A test function that passed, and the figures that it measured for all its parameters."""

    function: str
    figure: str


ROWS: dict[int, Row] = {
    1: Row(
        "one answer of a drive is lost",
        "the drive's last value and following error are used again, and the row is marked",
        "1 marked row",
    ),
    2: Row("three answers of one drive in a row are lost", "quick stop of all axes", "≤ 4 T"),
    3: Row(
        "about 1 % of all answers are lost, at random times",
        "the motion continues, and periods with too many lost answers are left out and named;"
        " exit code 6 if more than 2 % of a drive's answers are lost or more than 5 periods are"
        " left out",
        "count exact",
    ),
    4: Row("an answer arrives twice", "the second copy is ignored", "0 additional rows"),
    5: Row(
        "answers arrive after the end of their cycle",
        "they are counted as late and treated as lost, and the row is marked; quick stop at the"
        " third late cycle within 100 cycles",
        "count exact",
    ),
    6: Row(
        "a flipped bit that the checksum does not detect",
        "an implausible value is replaced by the last valid value; two in a row: quick stop",
        "≤ 3 T",
    ),
    7: Row(
        "frames of wrong length or unknown identifier; two devices with one node id",
        "refused, and the message names the node",
        "0 exceptions",
    ),
    8: Row(
        "a drive resets itself",
        "quick stop of the other drives; the drive is not enabled again",
        "≤ 2 T after its boot-up message",
    ),
    9: Row(
        "a drive sends an emergency message",
        "quick stop; the error code in the message is explained",
        "≤ 2 T after the message",
    ),
    10: Row(
        "1,000 emergency messages a second",
        "one quick stop; 64 messages are kept",
        "0 cycles late",
    ),
    11: Row("a drive's heartbeat ends", "quick stop", "≤ timeout + 1 T"),
    12: Row(
        "bus-off, full send queue, or adapter disconnected",
        "nothing is sent until the bus is opened again",
        "0 motion frames",
    ),
    13: Row(
        "emergency stop, and return of power",
        "no motion frame is sent; enabling the drives needs a complete preflight",
        "0 frames; first set-point = actual ± 1 count",
    ),
    14: Row("an encoder value does not change while the torque rises", "quick stop", "≤ 8 T"),
    15: Row(
        "an axis moves in the wrong direction",
        "quick stop",
        "≤ 3 T after the following error exceeds its limit",
    ),
    16: Row("a motion beyond a limit", "refused before the motion", "exit code 3, 0 frames"),
    17: Row(
        "a set-point that is NaN, infinite or a jump",
        "it is not sent; quick stop",
        "0 frames with such a value",
    ),
    18: Row(
        "the program is killed (kill -9)",
        "the drives stop by themselves",
        "quick stop begins ≤ 100 ms later",
    ),
    19: Row(
        "Ctrl-C, SIGTERM, SIGHUP, closed terminal",
        "quick stop; the file is closed",
        "quick stop ≤ 2 T, file closed ≤ 2 s",
    ),
    20: Row(
        "Ctrl-C five times",
        "the first one stops the motion; the others do not disturb the clean-up",
        "same end as after one Ctrl-C",
    ),
    21: Row(
        "the recorder is killed",
        "quick stop; the recording is readable",
        "≤ 100 ms of rows lost",
    ),
    22: Row(
        "the live page is killed or hangs, or has 1,000 clients",
        "cycles are not delayed",
        "delay < 10 % of T",
    ),
    23: Row(
        "the stop button is pressed under full load", "quick stop", "≤ 50 ms (99th percentile)"
    ),
    24: Row(
        "full disk, I/O error, or a disk that stalls",
        "no effect, or quick stop",
        "0 rows lost",
    ),
    25: Row(
        "a truncated or damaged recording",
        "`recover` reads the intact part",
        "0 unreported errors",
    ),
    26: Row(
        "the computer's date is changed",
        "no effect, because monotonic time is used",
        "0 negative time steps",
    ),
    27: Row(
        "a cycle is delayed",
        "skipped cycles are counted; after a longer delay the first command is a quick stop",
        "0 bursts of set-points",
    ),
    28: Row(
        "the amplifier saturates",
        "the period is left out; quick stop after too many such periods",
        "0 saturated samples averaged",
    ),
    29: Row(
        "the amplifier drifts, or does not measure",
        "the preflight is red; in a run the periods are invalid",
        "count exact",
    ),
    30: Row(
        "invalid bytes on the serial line, or adapter disconnected",
        "the reader resynchronises; without an adapter: quick stop",
        "≤ 2 frames lost",
    ),
    31: Row(
        "Modbus errors, late and short answers",
        "the error is reported; no write is repeated",
        "≤ 50 ms",
    ),
    32: Row("two sessions on one bus", "the second session is refused", "exit code 8, 0 frames"),
    33: Row("a physically inconsistent payload or robot", "the export is refused", "exit code 6"),
    34: Row(
        "an exported file reads back differently",
        "it is reported as red and removed",
        "every difference is detected",
    ),
    35: Row("the same recording is identified again", "same parameters", "difference ≤ 1e-12"),
    36: Row(
        "a fault per minute for eight hours",
        "every reaction is correct",
        "memory grows by ≤ 1 % an hour",
    ),
    37: Row(
        "a quick-stop deceleration that rounds to zero, or whose ramp exceeds the joint's range",
        "refused; the message states the ramp's time and distance, computed from the value that is"
        " read back from the drive",
        "exit code 3, 0 frames of motion",
    ),
    38: Row(
        "during a stop, an axis slows down too little or reaches its limit",
        "power off",
        "≤ the stated waiting time",
    ),
    39: Row(
        "any other value in a cell file with which a stop would fail",
        "refused; after a green preflight, every axis stops",
        "2,000 random cells",
    ),
    40: Row(
        "a lock file with a wrong process id: of another program, 0, or a number of 20 digits",
        "the file is ignored; `rid-daq stop` still stops all other sessions",
        "0 signals to other programs",
    ),
    41: Row(
        "a lock file that another user left",
        "it is taken over, or an error explains it",
        "no wrong process is stopped",
    ),
    42: Row(
        "files in a run folder that belong to different runs",
        "refused, and the message names the files",
        "every command that reads runs",
    ),
    43: Row("Ctrl-Z in the terminal while the robot moves", "a stop still works", "≤ 2 T"),
    44: Row(
        "an unknown file in the run folder",
        "it is not changed; the run is completed",
        "exit code 0",
    ),
    45: Row(
        "a complete run whose recording was truncated afterwards is recovered",
        "lost rows are counted with the help of the manifest; no result is copied",
        "count exact",
    ),
    46: Row(
        "a second `stream` on the same socket",
        "the second is refused; the first is not disturbed",
        "0 rows changed",
    ),
    47: Row(
        "an unfinished run is read",
        "reported; the run is used only on request",
        "every command that reads runs",
    ),
    48: Row(
        "the recording is deleted or truncated during the motion",
        "quick stop; the message names the cause",
        "no process killed",
    ),
    49: Row(
        "a node answers before another one, or twice",
        "counted and reported; quick stop if it happens in every cycle",
        "≤ the stated number of cycles",
    ),
    50: Row(
        "a file of a gigabyte, no memory, no disk space, invalid numbers, killed processes",
        "an error with a code and a message",
        "no traceback, no process or file left behind",
    ),
    51: Row(
        "the service that ordered a motion hangs",
        "quick stop with `on_lost_client: stop` and `finish`; the message names the cause; the next"
        " motion needs a preflight",
        "≤ 3 s + 2 T",
    ),
    52: Row(
        "the signal of a load change does not come, comes outside its window, or is already active",
        "the robot stops on its path, unless the load-change file says that the motion continues;"
        " no motion begins with an active input",
        "no set-point off the path; drives not enabled",
    ),
}

_HEAD = """# Faults

This page lists faults that tests inject, the required reactions, and the values that each test
measured when it last wrote to this page. T is the cycle time, 8 ms in the bundled cells. "Quick
stop" means: every axis makes a quick stop and does not start again by itself, and the recording is
closed. Most tests use simulated time, in which reaction times are exact. The motion of the axes is
read from the simulated robot, not from the program's own records.

Three benchmarks measure in real time or for hours, on two cores of a virtual machine without a
real-time kernel:

- `python -m benchmarks.reactions`: time from a fault on the bus (or Ctrl-C) to the last axis's
  quick stop, measured in the log of the bus, with 23 to 26 faults of each kind. The rows below
  state an allowed time for each kind. The longest reactions took 54 % of this time for an emergency
  message, 54 % for a drive that boots, 95 % for lost answers, 51 % for Ctrl-C. The end of a
  heartbeat was detected after 104 ms in the median and after 107.6 ms at most (row 11 allows
  108 ms). Cycles did not start later with 1,000 emergency messages a second than without them.
- `python -m benchmarks.live`: time from a click on the stop button of the live page to the last
  axis's quick stop, with both cores busy and 1,000 clients of the page: 6 ms in the median, 15 ms
  at most (50 ms are allowed).
- `python -m benchmarks.soak`: eight simulated hours, 480 faults of 16 kinds, no wrong reaction;
  memory grew by 0.005 % an hour, and the number of file descriptors did not grow.

This software is not a safety function: the cell's own emergency stop is required.

The tests write this page: `.venv/bin/python -m pytest --fault-page FILE...` replaces the entries
of the tests that it runs.

| # | fault | reaction | requirement | measured |
|---|---|---|---|---|
"""
_LINE = re.compile(r"^\| (\d+) \|.*\| (.*) \|$")
_ENTRY = re.compile(r"^(.*) \(`(tests/[^`]*)`\)$")
_NOTHING = "open"
_NOT_YET = "not measured yet"


def read(text: str) -> dict[int, list[Entry]]:
    """Return the entries of each row of a page."""
    entries: dict[int, list[Entry]] = {}
    for line in text.splitlines():
        row = _LINE.match(line)
        if row is None:
            continue
        found = [_ENTRY.match(part) for part in row[2].split("<br>")]
        entries[int(row[1])] = [Entry(match[2], match[1]) for match in found if match]
    return entries


def render(entries: Mapping[int, list[Entry]]) -> str:
    """Return the page."""
    lines = []
    for number, row in ROWS.items():
        listed = sorted(set(entries.get(number, [])))
        cell = "<br>".join(f"{entry.figure} (`{entry.function}`)" for entry in listed) or _NOTHING
        lines.append(f"| {number} | {row.fault} | {row.reaction} | {row.bar} | {cell} |")
    return _HEAD + "\n".join(lines) + "\n"


def update(
    text: str,
    ran: Mapping[int, list[Entry]],
    functions: set[str],
    existing: Mapping[int, set[str]],
) -> str:
    """Return the page with new entries for the tests that ran, and without tests that are gone."""
    kept = {
        number: [e for e in old if e.function in existing.get(number, set()) - functions]
        for number, old in read(text).items()
    }
    for number, new in ran.items():
        for function in dict.fromkeys(entry.function for entry in new):
            figures = dict.fromkeys(e.figure for e in new if e.function == function)
            kept.setdefault(number, []).append(Entry(function, "; ".join(figures)))
    for number, names in existing.items():
        listed = kept.setdefault(number, [])
        missing = names - {entry.function for entry in listed}
        listed += [Entry(function, _NOT_YET) for function in sorted(missing)]
    return render(kept)


def as_figure(words: str) -> str:
    """Return a figure escaped for a table."""
    plain = " ".join(words.replace("|", "/").replace("<", "‹").replace("`", "'").split())
    return plain or "holds"


def find_marked(tests: Path = ROOT / "tests", mark: str = "fault") -> dict[Any, set[str]]:
    """Return the test functions that have a mark, by the argument of the mark: row or promise."""
    rows: dict[Any, set[str]] = {}
    for path in sorted(tests.rglob("test_*.py")):
        text = path.read_text(encoding="utf-8")
        if f".{mark}(" not in text:
            continue
        name = path.relative_to(tests.parent).as_posix()
        for test, named in _tests(ast.parse(text), name, mark):
            for each in named:
                rows.setdefault(each, set()).add(test)
    return rows


def _tests(
    node: ast.Module | ast.ClassDef, prefix: str, mark: str, above: tuple[Any, ...] = ()
) -> Iterator[tuple[str, tuple[Any, ...]]]:
    assigned = [each for each in node.body if isinstance(each, ast.Assign)]
    above += tuple(_marks([e.value for e in assigned if _is_named(e, "pytestmark")], mark))
    for child in node.body:
        if isinstance(child, ast.ClassDef):
            own = (*above, *_marks(child.decorator_list, mark))
            yield from _tests(child, f"{prefix}::{child.name}", mark, own)
        elif isinstance(child, ast.FunctionDef) and child.name.startswith("test"):
            yield f"{prefix}::{child.name}", (*above, *_marks(child.decorator_list, mark))


def _is_named(assigned: ast.Assign, name: str) -> bool:
    return any(isinstance(each, ast.Name) and each.id == name for each in assigned.targets)


def _marks(expressions: Sequence[ast.expr], mark: str) -> Iterator[Any]:
    for expression in expressions:
        for call in ast.walk(expression):
            if (
                isinstance(call, ast.Call)
                and isinstance(call.func, ast.Attribute)
                and call.func.attr == mark
            ):
                yield from (a.value for a in call.args if isinstance(a, ast.Constant))
