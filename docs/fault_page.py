"""Write docs/faults.md: injected faults, required reactions and measured values.

``python -m pytest --fault-page FILE...`` replaces the lines of the tests that ran and keeps the
others. ``tests/test_fault_page.py`` compares the page with the existing tests.
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
    """A fault, the required reaction and its limit."""

    fault: str
    reaction: str
    bar: str


class Entry(NamedTuple):
    """A test function that passed, and the figures that it measured with all its parameters."""

    function: str
    figure: str


ROWS: dict[int, Row] = {
    1: Row(
        "one answer of a drive lost",
        "its last value and the following error are kept, the row is marked",
        "1 marked row",
    ),
    2: Row("three answers of one drive lost in a row", "quick stop of all axes", "≤ 4 T"),
    3: Row(
        "1 % of all answers lost; more",
        "goes on, bad periods left out and named; beyond 2 % of a drive's, or 5 periods: exit 6",
        "count exact",
    ),
    4: Row("an answer twice", "the second is ignored", "0 rows more"),
    5: Row(
        "answers later than their cycle",
        "counted as late and not used, as if lost; the row is marked; quick stop at the third late"
        " cycle in 100",
        "count exact",
    ),
    6: Row(
        "a flipped bit that the checksum missed",
        "implausible: last value kept; two: quick stop",
        "≤ 3 T",
    ),
    7: Row(
        "wrong length, foreign identifier, a node id twice", "refused with its name", "0 exceptions"
    ),
    8: Row("a drive resets itself", "quick stop of the others; not enabled again", "≤ 2 T"),
    9: Row("an emergency message", "quick stop; the code explained", "≤ 2 T"),
    10: Row("1,000 emergency messages a second", "one quick stop; 64 kept", "0 cycles late"),
    11: Row("a drive's heartbeat ends", "quick stop", "≤ time-out + 1 T"),
    12: Row("bus-off, full queue, adapter gone", "silence until re-armed", "0 motion frames"),
    13: Row(
        "emergency stop, and power again",
        "no motion frame; enabling needs a whole preflight",
        "0 frames; first set-point = actual ± 1 count",
    ),
    14: Row("a stuck encoder while the torque rises", "quick stop", "≤ 8 T"),
    15: Row("an axis that runs the wrong way", "quick stop", "≤ 3 T beyond the limit"),
    16: Row("a motion beyond a limit", "refused before motion", "exit 3, 0 frames"),
    17: Row("NaN, infinity or a jump as set-point", "not sent; quick stop", "0 bad frames"),
    18: Row("the program is killed (kill -9)", "the drives stop by themselves", "≤ 100 ms + ramp"),
    19: Row("Ctrl-C, SIGTERM, SIGHUP, closed terminal", "quick stop, file closed", "≤ 2 T, ≤ 2 s"),
    20: Row("Ctrl-C again, five times", "the clean-up goes on", "same end"),
    21: Row("the recorder is killed", "quick stop; the file is readable", "≤ 100 ms lost"),
    22: Row("the page killed or hanging, 1,000 clients", "the cycle is not affected", "< 10 % T"),
    23: Row("the stop button under full load", "quick stop", "≤ 50 ms p99"),
    24: Row("disk full, I/O error, a disk that stalls", "no effect, or quick stop", "0 rows lost"),
    25: Row("a torn or damaged recording", "`recover` reads the intact part", "0 silent errors"),
    26: Row("the date is changed", "monotonic time is used", "0 negative steps"),
    27: Row("the cycle is delayed", "counted; too long: quick stop first", "0 catch-up bursts"),
    28: Row("the amplifier saturates", "period left out; too many: stop", "0 averaged"),
    29: Row(
        "the amplifier drifts, or does not measure",
        "red in the preflight, invalid in the run",
        "exact",
    ),
    30: Row("garbage on the serial line, adapter gone", "resynchronises; gone: stop", "≤ 2 frames"),
    31: Row("Modbus errors, late and short answers", "typed errors, no repeated writes", "≤ 50 ms"),
    32: Row("two sessions on one bus", "the second is refused", "exit 8, 0 frames"),
    33: Row("a physically inconsistent payload or robot", "export refused", "exit 6"),
    34: Row("an export that reads back differently", "red, removed", "100 %"),
    35: Row("the same recording again", "the same parameters", "≤ 1e-12"),
    36: Row("eight hours with a fault a minute", "every reaction right", "≤ 1 % memory an hour"),
    37: Row(
        "a quick-stop deceleration that rounds to zero, or whose ramp exceeds the joint's range",
        "refused with its time and distance, computed from the value read back from the drive",
        "exit 3, 0 frames of motion",
    ),
    38: Row(
        "an axis that slows down too little, or reaches its limit, while stopping",
        "power off",
        "≤ the stated waiting time",
    ),
    39: Row(
        "any other number with which the stop would fail",
        "refused; if the preflight is green, every axis stops",
        "2,000 cells",
    ),
    40: Row(
        "a lock file with a false process: another program's, 0, a number of 20 digits",
        "not trusted; the other sessions are stopped all the same",
        "0 signals to other programs",
    ),
    41: Row("a lock that another user left", "taken over, or explained", "no wrong process"),
    42: Row(
        "files of a run that do not belong together", "refused with their names", "every reader"
    ),
    43: Row("Ctrl-Z in the terminal while the robot moves", "the stop works", "≤ 2 T"),
    44: Row("a stray file in the run folder", "left alone; the run is finished", "exit 0"),
    45: Row(
        "a complete run whose recording was cut is recovered",
        "lost rows counted by the manifest; no result copied",
        "count exact",
    ),
    46: Row(
        "a second `stream` on the same socket", "refused; the first undisturbed", "0 rows changed"
    ),
    47: Row("an unfinished run is read", "reported; used only on request", "every reader"),
    48: Row(
        "the recording is deleted or cut in motion",
        "quick stop with its cause",
        "no process killed",
    ),
    49: Row(
        "a node that answers before another, or twice, in every cycle",
        "counted and reported; persistent: quick stop",
        "≤ the stated cycles",
    ),
    50: Row(
        "a file of a gigabyte, no memory, no disk space, invalid numbers, killed processes",
        "an error that has a name",
        "no traceback, nothing left",
    ),
    51: Row(
        "the service that ordered a motion hangs",
        "quick stop with its cause, whatever its client declared; the next motion needs a check",
        "≤ 3 s + 2 T",
    ),
}

_HEAD = """# Faults

Injected faults, required reactions, and the values that the tests measured when this page was last
made. T is the cycle time, 8 ms in the bundled cells. "Quick stop" means: a latched quick stop of
every axis, the recording closed, no automatic restart. Reactions are counted in cycles of a
simulated clock, so that a count is exact; the motion of the axes is read from the simulated robot,
not from the program's own records.

Measured in real time and over hours, on two cores of a virtual machine without a real-time kernel:

- `python -m benchmarks.reactions`: time from a fault on the bus (or Ctrl-C) to the last axis's
  quick stop, by the bus's own log, 23 to 26 faults of each kind. The largest share of the time that
  the rows below allow was 54 % for an emergency message, 54 % for a drive that boots, 95 % for lost
  answers, 51 % for Ctrl-C. The end of a heartbeat was detected after 104 ms in the median and
  107.6 ms at most (row 11 allows 108 ms). With 1,000 emergency messages a second cycles start late
  by 40 us, without by 45 us (p99 of 2 s, lower quartile).
- `python -m benchmarks.live`: time from a click on the stop button to the last axis's quick stop,
  with both cores busy and 1,000 clients of the page: 6 ms in the median, 15 ms at most (20 ms are
  allowed).
- `python -m benchmarks.soak`: eight simulated hours, 480 faults of 16 kinds, no wrong reaction;
  memory grew by 0.005 % an hour, the number of file descriptors did not.

This software is not a safety function: the cell's own emergency stop is required.

The tests write this page: `.venv/bin/python -m pytest --fault-page FILE...` replaces the lines of
the tests that ran.

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
        told = sorted(set(entries.get(number, [])))
        cell = "<br>".join(f"{entry.figure} (`{entry.function}`)" for entry in told) or _NOTHING
        lines.append(f"| {number} | {row.fault} | {row.reaction} | {row.bar} | {cell} |")
    return _HEAD + "\n".join(lines) + "\n"


def updated(
    text: str,
    ran: Mapping[int, list[Entry]],
    functions: set[str],
    there: Mapping[int, set[str]],
) -> str:
    """Return a page with the lines of the functions that ran replaced, for existing tests."""
    kept = {
        number: [e for e in told if e.function in there.get(number, set()) - functions]
        for number, told in read(text).items()
    }
    for number, told in ran.items():
        for function in dict.fromkeys(entry.function for entry in told):
            figures = dict.fromkeys(e.figure for e in told if e.function == function)
            kept.setdefault(number, []).append(Entry(function, "; ".join(figures)))
    for number, names in there.items():
        told = kept.setdefault(number, [])
        missing = names - {entry.function for entry in told}
        told += [Entry(function, _NOT_YET) for function in sorted(missing)]
    return render(kept)


def as_figure(words: str) -> str:
    """Return a figure escaped for a table."""
    plain = " ".join(words.replace("|", "/").replace("<", "‹").replace("`", "'").split())
    return plain or "holds"


def declared(tests: Path = ROOT / "tests", mark: str = "fault") -> dict[Any, set[str]]:
    """Return the test functions that have a mark, by the argument of the mark: row or promise."""
    rows: dict[Any, set[str]] = {}
    for path in sorted(tests.rglob("test_*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        name = path.relative_to(tests.parent).as_posix()
        for test, named in _tests(tree, name, mark):
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
