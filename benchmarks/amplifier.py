"""CPU time of reading an amplifier's rows in pieces, compared with pyserial's `readline`.

A separate process simulates the amplifier on a pseudo-terminal. First it sends 1000 rows a second
to measure the CPU time per row. Then it increases the rate to find the highest one without loss; it
drops rows if the terminal's buffer is full. `readline` needs a line feed after each row. It gets
the same rows as text with line feeds, and does not decode them.

Run it with ``python -m benchmarks.amplifier [--quick]``.
"""

from __future__ import annotations

import contextlib
import gc
import json
import multiprocessing
import os
import sys
import time
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection

import serial

from acquisition.session.plate_recorder import BEAT_S, PARSE_S, piece_time_s
from benchmarks.short_form import is_short
from config.cell.amplifier_profile import BITS_PER_BYTE, AmplifierProfile
from config.load import load_bundled_or_path
from drivers.amplifier.frames import encode_row, row_layout
from drivers.amplifier.stream import AmplifierStream
from drivers.ports.serial_link import open_serial

RATE_HZ = 1000
BAR = 20.0
LADDER_HZ = (500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000, 200_000)
BAUD_RATE = 460800
ATTEMPTS = 3
HELD_S = 1.0
END = b"END\n"


@dataclass(frozen=True)
class Job:
    """Rows that the simulated amplifier sends: form, rate and duration."""

    form: str
    rate_hz: int
    seconds: float
    dropping: bool

    @property
    def rows(self) -> int:
        """Total number of rows."""
        return round(self.rate_hz * self.seconds)


def rows_of(form: str) -> list[bytes]:
    """Return 65536 rows, one for each sequence number."""
    profile = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)
    layout = row_layout(profile, form)
    rows = [
        encode_row(
            layout, i, i * 1000, 0x100, [(i * 7 + 977 * c) % 65536 - 32768 for c in range(8)]
        )
        for i in range(1 << 16)
    ]
    return [row.rstrip(b"\r") + b"\n" for row in rows] if form == "ascii" else rows


def run_jobs(pipe: Connection) -> None:
    """Send the rows of one job after the other until the pipe is closed."""
    rows = {form: rows_of(form) for form in ("ascii", "binary")}
    with contextlib.suppress(EOFError):
        while True:
            job = pipe.recv()
            ours, theirs = os.openpty()
            tty.setraw(theirs)
            os.set_blocking(ours, not job.dropping)
            pipe.send(os.ttyname(theirs))
            pipe.recv()  # the reader is ready
            dropped = play_job(ours, rows[job.form], job)
            os.set_blocking(ours, True)
            os.write(ours, END)
            pipe.send(dropped)
            pipe.recv()  # wait until the reader has received all rows
            os.close(ours)
            os.close(theirs)


def play_job(port: int, rows: list[bytes], job: Job) -> int:
    """Write rows at their rate; return the number of dropped bytes."""
    began_s = time.monotonic()
    sent = dropped = 0
    step = max(1, job.rate_hz // 1000)
    while sent < job.rows:
        ahead_s = began_s + sent / job.rate_hz - time.monotonic()
        if ahead_s > 0.0:
            time.sleep(ahead_s)
        data = b"".join(rows[i % len(rows)] for i in range(sent, min(sent + step, job.rows)))
        sent += step
        try:
            written = os.write(port, data)
        except BlockingIOError:
            written = 0
        dropped += len(data) - written
    return dropped


def read_in_pieces(address: str, job: Job, begin: Callable[[], None]) -> tuple[int, float]:
    """Read as the recorder does; return the number of rows and their CPU time [s]."""
    profile = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)
    stream = AmplifierStream(profile, job.form, float(job.rate_hz))
    pause_s = piece_time_s(job.rate_hz * profile.row_bytes(job.form) * BITS_PER_BYTE)
    with open_serial(address, BAUD_RATE) as link:
        begin()
        began_s = time.process_time()
        tail, pieces, parse_s = b"", list[bytes](), link.clock.now_s()
        while not tail.endswith(END):
            time.sleep(pause_s)
            now_s = link.clock.now_s()
            pieces.append(link.read(now_s + BEAT_S))
            tail = (tail + pieces[-1])[-len(END) :]
            if now_s >= parse_s:
                stream.feed(b"".join(pieces))
                pieces, parse_s = [], now_s + PARSE_S
        stream.feed(b"".join(pieces))
        return stream.counts.rows, time.process_time() - began_s


def read_lines(address: str, job: Job, begin: Callable[[], None]) -> tuple[int, float]:
    """Read with pyserial's `readline`; return the number of lines and their CPU time [s]."""
    size = len(rows_of_one(job.form))
    with serial.Serial(address, BAUD_RATE, timeout=1.0) as port:
        begin()
        began_s = time.process_time()
        lines = 0
        while not (line := port.readline()).endswith(END):
            lines += len(line) == size
        return lines, time.process_time() - began_s


def rows_of_one(form: str) -> bytes:
    """Return one row; the size of all rows is the same."""
    profile = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)
    return encode_row(row_layout(profile, form), 0, 0, 0, [0] * 8)


Reader = Callable[[str, Job, Callable[[], None]], tuple[int, float]]


def run(player: Connection, reader: Reader, job: Job) -> tuple[int, float]:
    """Run one job; return the rows lost and the CPU time per row [us]."""
    player.send(job)
    rows, cpu_s = reader(player.recv(), job, lambda: player.send(None))
    dropped = player.recv()
    player.send(None)
    lost = max(job.rows - rows, int(dropped > 0))
    return lost, 1e6 * cpu_s / max(rows, 1)


def highest_held(player: Connection, reader: Reader, form: str, seconds: float) -> int:
    """Return the highest rate for which neither this rate nor a lower one loses a row [1/s].

    A rate passes if one of `ATTEMPTS` attempts loses nothing, since a shared computer sometimes
    stalls for longer than the terminal's buffer lasts.
    """
    held = 0
    for rate_hz in LADDER_HZ:
        job = Job(form, rate_hz, seconds, dropping=True)
        if all(run(player, reader, job)[0] for _ in range(ATTEMPTS)):
            break
        held = rate_hz
    return held


@contextlib.contextmanager
def simulated_device() -> Iterator[Connection]:
    """Start the process that simulates the amplifier."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=run_jobs, args=(theirs,), daemon=True)
    process.start()
    theirs.close()
    try:
        yield ours
    finally:
        ours.close()
        process.join(10.0)


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    seconds = 3.0 if is_short(__doc__) else 20.0
    gc.freeze()
    gc.disable()
    with simulated_device() as player:
        cost = {
            name: run(player, reader, Job(form, RATE_HZ, seconds, dropping=False))
            for name, reader, form in (
                ("text in pieces", read_in_pieces, "ascii"),
                ("binary in pieces", read_in_pieces, "binary"),
                ("readline", read_lines, "ascii"),
            )
        }
        held = {
            name: highest_held(player, reader, form, HELD_S)
            for name, reader, form in (
                ("text in pieces", read_in_pieces, "ascii"),
                ("binary in pieces", read_in_pieces, "binary"),
                ("readline", read_lines, "ascii"),
            )
        }
    for name, (lost, cpu_us) in cost.items():
        print(
            f"{name}: {cpu_us:.1f} us of CPU per row at {RATE_HZ} rows/s ({lost} lost);"
            f" no loss up to {held[name]} rows/s"
        )
    peer_us = cost["readline"][1]
    text, binary = cost["text in pieces"][1], cost["binary in pieces"][1]
    complete = not cost["text in pieces"][0] and not cost["binary in pieces"][0]
    holds = complete and BAR * max(text, binary) <= peer_us
    result = {
        "name": "amplifier",
        "value": round(max(text, binary), 1),
        "unit": "us CPU per row at 1000 rows/s",
        "ratios": {
            "CPU time of pyserial readline over ours, text": round(peer_us / text, 1),
            "CPU time of pyserial readline over ours, binary": round(peer_us / binary, 1),
        },
        "held_rows_per_s": held,
        "bar": f"no row lost, and pyserial readline needs at least {BAR:g} times the CPU time",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
