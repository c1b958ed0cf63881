"""Lines of the preflight on this computer: disk, clock, scheduling."""

from __future__ import annotations

import ctypes
import os
import shutil
import tempfile
import time
from pathlib import Path

from acquisition.journal.disk_reserve import FREE_BYTES
from acquisition.task.realtime import PROCESSOR_LATENCY, SCHEDULER_PRIORITY
from config.errors import RecordingError, system_errors
from rid_daq.preflight.check_line import CheckLine
from rid_daq.preflight.lateness import measure_lateness

WRITE_BYTES = 4 << 20
SLOWEST_BYTES_S = 1e6
LONGEST_WRITE_S = 5.0
FIRST_YEAR = 2025
RUNS_FOLDER = "folder of the runs"
_CLOCK_SOURCE = Path("/sys/devices/system/clocksource/clocksource0/current_clocksource")


def disk_lines(runs: Path) -> list[CheckLine]:
    """Return the lines on the disk of the runs' folder; a test file is written and removed."""
    folder = next(path for path in (runs.absolute(), *runs.absolute().parents) if path.exists())
    return [_free_disk_line(folder), _disk_speed_line(folder)]


def time_lines() -> list[CheckLine]:
    """Return the lines on this computer's clock and scheduling."""
    return [*_clock_lines(), *_privilege_lines()]


def _free_disk_line(folder: Path) -> CheckLine:
    free = shutil.disk_usage(folder).free
    return CheckLine(
        where=RUNS_FOLDER,
        what="free disk",
        required=f"≥ {FREE_BYTES >> 20} MB",
        found=f"{free >> 20} MB",
        verdict="ok" if free >= FREE_BYTES else "red",
        next_action="free disk space, or choose another folder with --runs",
    )


def _disk_speed_line(folder: Path) -> CheckLine:
    """Write some megabytes, wait until they are on the disk, and return the line on the speed."""
    required = f"≥ {SLOWEST_BYTES_S / 1e6:.0f} MB/s, ≤ {LONGEST_WRITE_S:g} s"
    action = (
        "choose a folder on a faster disk with --runs: a write must not take longer than the"
        " recorder's buffer lasts"
    )
    try:
        taken_s = write_seconds(folder, WRITE_BYTES)
    except RecordingError as error:
        other = "choose another folder with --runs, or give this user write permission"
        return CheckLine(RUNS_FOLDER, "writing to disk", required, str(error), "red", other)
    rate = WRITE_BYTES / taken_s
    good = rate >= SLOWEST_BYTES_S and taken_s <= LONGEST_WRITE_S
    return CheckLine(
        where=RUNS_FOLDER,
        what="writing to disk",
        required=required,
        found=f"{rate / 1e6:.0f} MB/s, {taken_s:.2f} s",
        verdict="ok" if good else "red",
        next_action="" if good else action,
    )


def write_seconds(folder: Path, size: int) -> float:
    """Return the time to write `size` bytes to the disk of a folder [s].

    Raises:
        RecordingError: The bytes cannot be written.
    """
    with (
        system_errors(
            RecordingError, f"{folder}: cannot write to this folder", code="RID-FILE-WRITE"
        ),
        tempfile.NamedTemporaryFile(dir=folder, prefix=".rid-daq-speed-") as file,
    ):
        block = os.urandom(1 << 16)
        began_s = time.monotonic()
        for _ in range(size // len(block)):
            file.write(block)
        file.flush()
        os.fsync(file.fileno())
        return max(time.monotonic() - began_s, 1e-6)


def _clock_lines() -> list[CheckLine]:
    year = time.gmtime().tm_year
    set_right = year >= FIRST_YEAR
    source = _CLOCK_SOURCE.read_text().strip() if _CLOCK_SOURCE.exists() else "unknown"
    return [
        CheckLine(
            where="this computer",
            what="date",
            required=f"{FIRST_YEAR} or later",
            found=time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()),
            verdict="ok" if set_right else "red",
            next_action=""
            if set_right
            else "set the clock: otherwise runs get a wrong date in their names",
        ),
        CheckLine(
            "this computer",
            "clock source; lateness of a cycle, median and largest",
            "",
            f"{source}; {measure_lateness()}",
            "shown",
        ),
    ]


def _privilege_lines() -> list[CheckLine]:
    """Try the privileges that the cyclic task needs, and return the lines on them."""
    return [
        CheckLine("this computer", "real-time scheduling", "", _try_realtime_scheduling(), "shown"),
        CheckLine("this computer", "locked memory", "", _try_locked_memory(), "shown"),
        CheckLine(
            "this computer", "processors kept awake", "", try_awake(PROCESSOR_LATENCY), "shown"
        ),
    ]


def _try_realtime_scheduling() -> str:
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(SCHEDULER_PRIORITY))
    except OSError:
        return "refused: cycles may be late under load; raise the limit rtprio for this user"
    os.sched_setscheduler(0, policy, parameters)
    return "allowed"


def _try_locked_memory() -> str:
    buffer = ctypes.create_string_buffer(1 << 20)
    libc = ctypes.CDLL(None, use_errno=True)
    size = ctypes.c_size_t(len(buffer))
    if libc.mlock(buffer, size) != 0:
        return "refused: raise the limit memlock for this user"
    libc.munlock(buffer, size)
    return "allowed"


def try_awake(latency: Path) -> str:
    """Return a text on this user's permission to keep processors awake (file `latency`)."""
    try:
        os.close(os.open(latency, os.O_WRONLY | os.O_CLOEXEC))
    except FileNotFoundError:
        return f"this system has no {latency}"
    except OSError as error:
        return (
            f"refused: cycles begin later ({latency}: {error.strerror}); give this user write"
            " permission"
        )
    return "allowed"
