"""A disk that fails during `rid-daq record`: every access to its block device returns EIO.

The test needs a separate kernel: tests/socketcan/test_guest.py runs it in a virtual machine.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycles import read_journal
from rid_daq.app import run

Start = Callable[[list[str]], subprocess.Popen[str]]

SECTORS = 2 * 1048576
NAME, DEVICE, RAM_DISK = "failing", "/dev/dm-0", "/dev/ram0"
PATIENCE_S = 400.0  # a virtual machine is slow on a busy host
ENOUGH_BYTES = 40_000
JOURNAL = "*/recording.mcap"
GONE = "(Input/output error|Read-only file system)"
"""Errors of ext4: the first at once, the second up to 5 s later, when the journal of ext4 fails."""

pytestmark = pytest.mark.skipif(
    "User Mode Linux" not in Path("/proc/cpuinfo").read_text() or not Path(RAM_DISK).exists(),
    reason="tests/socketcan/test_guest.py runs this in its virtual machine",
)


def execute(*command: str | Path) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def journal_bytes(disk: Path) -> int:
    return sum(file.stat().st_size for file in disk.glob(JOURNAL))


def replace_device(target: str) -> None:
    """Replace the block device of the mounted disk; unwritten data stay in memory."""
    execute("dmsetup", "suspend", "--noflush", "--nolockfs", NAME)
    execute("dmsetup", "reload", NAME, "--table", f"0 {SECTORS} {target}")
    execute("dmsetup", "resume", "--noudevsync", NAME)


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A mounted disk that a test can make fail."""
    folder = tmp_path / "disk"
    folder.mkdir()
    execute(
        *("dmsetup", "create", "--noudevsync", NAME, "--table"),
        f"0 {SECTORS} linear {RAM_DISK} 0",
    )
    execute("mke2fs", "-q", "-t", "ext4", DEVICE)
    execute("mount", DEVICE, folder)
    yield folder
    replace_device(f"linear {RAM_DISK} 0")
    execute("umount", folder)
    execute("dmsetup", "remove", "--noudevsync", NAME)


@pytest.fixture
def start() -> Iterator[Start]:
    """Return a function that starts a program; the program ends with the test."""
    with contextlib.ExitStack() as stack:

        def begin(words: list[str]) -> subprocess.Popen[str]:
            program = subprocess.Popen(
                words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )
            stack.enter_context(program)
            stack.callback(program.kill)
            return program

        yield begin


def test_a_disk_failure_stops_the_motion_and_keeps_the_written_rows(
    disk: Path, start: Start, tmp_path: Path
) -> None:
    assert run(["init", str(tmp_path / "cell")]) == 0
    words = ["record", *(str(tmp_path / "cell" / name) for name in ("cell.yaml", "motion.yaml"))]
    program = start([sys.executable, "-m", "rid_daq", *words, "--json", "--runs", str(disk)])
    until_s = time.monotonic() + PATIENCE_S
    while journal_bytes(disk) < ENOUGH_BYTES:
        assert program.poll() is None
        assert time.monotonic() < until_s
        time.sleep(0.01)
    kept_bytes = journal_bytes(disk)
    os.sync()
    replace_device("error")
    output, errors = program.communicate(timeout=PATIENCE_S)
    replace_device(f"linear {RAM_DISK} 0")
    execute("umount", disk)
    execute("mount", DEVICE, disk)
    assert program.returncode == 7
    sys.stdout.write(errors)
    assert json.loads(output)["error"]["exit_code"] == 7
    # matplotlib may first report that it builds its font cache
    assert any(line.startswith("rid-daq: Stopped: ") for line in errors.splitlines())
    for name in ("recording.mcap", "manifest.json"):
        assert re.search(rf"{name}: cannot be written: {GONE}", errors)
    assert journal_bytes(disk) >= kept_bytes
    (path,) = disk.glob(JOURNAL)
    journal = read_journal(path)
    assert not journal.damage.finished
    assert np.all(np.diff(journal.rows["cycle"].astype(np.int64)) == 1)
    sys.stdout.write(
        f"MEASURED failing disk: exit 7, {len(journal.rows)} rows kept without a gap\n"
    )
