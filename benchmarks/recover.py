"""Fraction of the rows that `repair` recovers from damaged recordings.

The recorder writes one recording. A thousand copies are truncated at random places, and a thousand
have one bit flipped. Each copy is repaired and compared with the original rows: a recovered row
must not differ. Then a recorder is killed a hundred times while it writes. `python -m
benchmarks.recover --quick` makes 60 copies of each kind and kills 5 recorders.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.journal.cycle_row import row_dtype, row_struct
from acquisition.journal.cycles import read_journal
from acquisition.journal.header import JournalHeader
from acquisition.session.cycle_recorder import run_recorder
from acquisition.session.repair import repair_journal
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from acquisition.task.states import TaskState
from benchmarks.short_form import is_short
from config.errors import RecordingError

ROWS: Final = 6000
LONGEST_S: Final = 10.0
LEAST_FRACTION: Final = 0.99
HEADER: Final = JournalHeader(
    joint_names=("axis1", "axis2", "axis3"), sample_period_s=0.008, run_id="01OLD"
)
KILLED: Final = """
import sys
from pathlib import Path
from acquisition.journal.cycle_row import row_struct
from acquisition.journal.header import JournalHeader
from acquisition.journal.cycles import JournalWriter
pack = row_struct(3).pack
writer = JournalWriter(Path(sys.argv[1]), JournalHeader.model_validate_json(sys.argv[2]))
for cycle in range(1 << 30):
    floats = [cycle * 0.008, 0.0, 0.0] + [cycle + 0.25] * 15
    writer.append(pack(*floats, 1, 2, 3, cycle, cycle, *[0] * 6, 1, 1, 1, 3))
    if cycle % 12 == 11:
        writer.flush()
        print(cycle + 1, flush=True)
"""


@dataclass
class Tally:
    """Counts over damaged files.

    Attributes:
        files, refused: Number of files, and number of files in which nothing was readable.
        there, kept: Number of undamaged rows (of truncated files, the rows before the cut), and
            number of rows read.
        wrong: Files with a wrong row or an unreported loss.
        longest_s: Longest processor time of one repair [s].
    """

    files: int = 0
    refused: int = 0
    there: int = 0
    kept: int = 0
    wrong: int = 0
    longest_s: float = 0.0

    @property
    def fraction(self) -> float:
        """Fraction of the undamaged rows that were read."""
        return self.kept / max(self.there, 1)


def invented_rows(count: int) -> NDArray[Any]:
    """Return rows of random values with consecutive cycle numbers."""
    rng = np.random.default_rng(1)
    rows = np.zeros(count, dtype=row_dtype(3))
    rows["time_s"] = 5.0 + np.arange(count) * 0.008
    rows["cycle"] = rows["sample_index"] = np.arange(count)
    for name in ("position", "torque_nm", "target_position", "velocity_command"):
        rows[name] = rng.normal(size=(count, 3))
    rows["valid"], rows["phase"] = 1, 3
    return rows


def write_recording(path: Path) -> NDArray[Any]:
    """Write a file with the recorder's main function; return its rows."""
    rows = invented_rows(ROWS)
    ring, control = Ring.create(3, ROWS), ControlBlock.create()
    layout = row_struct(3)
    for row in rows:
        ring.write(layout.unpack(row.tobytes()))
    control.task.state = TaskState.FINISHED
    run_recorder(ring, control, path, HEADER, os.getppid())
    return rows


def repair_all(damaged: Iterable[tuple[bytes, int]], rows: NDArray[Any], folder: Path) -> Tally:
    """Repair files one after the other; each comes with its number of undamaged rows."""
    tally = Tally()
    old, new = folder / "old.mcap", folder / "new.mcap"
    for data, there in damaged:
        old.write_bytes(data)
        new.unlink(missing_ok=True)
        tally.files += 1
        tally.there += there
        begun_s = time.process_time()
        try:
            repair = repair_journal(old, new)
        except RecordingError:
            tally.refused += 1
            continue
        finally:
            tally.longest_s = max(tally.longest_s, time.process_time() - begun_s)
        journal = read_journal(new)
        kept = journal.rows["cycle"].astype(np.int64)
        tally.kept += len(kept)
        reported = not repair.damage.finished or len(kept) + repair.lost_rows == ROWS
        same = journal.rows.tobytes() == rows[kept].tobytes() and journal.header == HEADER
        tally.wrong += not (reported and same and old.read_bytes() == data)
    return tally


def cuts(whole: bytes, rows: NDArray[Any], count: int) -> Iterable[tuple[bytes, int]]:
    """Yield copies of the file that are truncated at random places."""
    ends = [whole.index(row.tobytes()) + row.nbytes for row in rows]
    for cut in random.Random(3).sample(range(len(whole)), count):
        yield whole[:cut], int(np.searchsorted(ends, cut, side="right"))


def flips(whole: bytes, count: int) -> Iterable[tuple[bytes, int]]:
    """Yield copies of the file with one random bit flipped."""
    for bit in random.Random(4).sample(range(8 * len(whole)), count):
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        yield bytes(data), ROWS


def kills(folder: Path, count: int) -> tuple[int, int]:
    """Kill `count` writers while they write; return the flushed rows lost and the wrong files."""
    lost = wrong = 0
    generator = random.Random(5)
    for number in range(count):
        path, new = folder / f"killed{number}.mcap", folder / f"killed{number}-new.mcap"
        words = [sys.executable, "-c", KILLED, str(path), HEADER.model_dump_json()]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as writer:
            if writer.stdout is None:
                raise RuntimeError("no pipe to the writer")
            for _ in range(generator.randrange(1, 300)):
                writer.stdout.readline()
            writer.send_signal(signal.SIGKILL)
            flushed = int([*writer.stdout, "12\n"][-2:][0])
        repair = repair_journal(path, new)
        rows = read_journal(new).rows
        lost += max(0, flushed - repair.kept_rows)
        right = rows["cycle"].tolist() == list(range(len(rows)))
        right = right and bool((rows["position"] == rows["cycle"][:, np.newaxis] + 0.25).all())
        wrong += not (right and repair.lost_rows == 0)
        path.unlink()
        new.unlink()
    return lost, wrong


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    quick = is_short(__doc__)
    count, killed = (60, 5) if quick else (1000, 100)
    with TemporaryDirectory(prefix="rid-recover-") as name:
        folder = Path(name)
        rows = write_recording(folder / "whole.mcap")
        whole = (folder / "whole.mcap").read_bytes()
        cut = repair_all(cuts(whole, rows, count), rows, folder)
        flipped = repair_all(flips(whole, count), rows, folder)
        lost, wrong_kills = kills(folder, killed)
    print(f"recording of {len(whole)} bytes, {ROWS} rows")
    for damage, tally in (("truncated", cut), ("with one bit flipped", flipped)):
        print(
            f"{tally.files} copies {damage}: {tally.fraction:.3%} of the undamaged rows read,"
            f" {tally.wrong} files wrong, {tally.refused} unreadable,"
            f" {tally.longest_s:.2f} s at most"
        )
    print(f"{killed} writers killed: {lost} flushed rows lost, {wrong_kills} files wrong")
    worst = min(cut.fraction, flipped.fraction)
    silent = cut.wrong + flipped.wrong + wrong_kills
    slowest_s = max(cut.longest_s, flipped.longest_s)
    holds = worst >= LEAST_FRACTION and not silent and not lost and slowest_s <= LONGEST_S
    result = {
        "name": "recover",
        "value": round(100.0 * worst, 3),
        "unit": "% of the undamaged rows read",
        "ratios": {},
        "silent_errors": silent,
        "flushed_rows_lost_by_kill": lost,
        "slowest_s": round(slowest_s, 3),
        "bar": f"{LEAST_FRACTION:.0%} of the rows, no silent error, no flushed row lost by"
        f" kill -9, each within {LONGEST_S:g} s of processor time",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
