"""Processes of several users of one computer: sessions, and holders of false locks."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from typing import Any

ME = os.getuid()
STRANGER = "import sys; [print('alive', flush=True) for _ in sys.stdin]"
"""Program that is unrelated to rid-daq; it answers each line of input."""

LIAR = """
import contextlib, fcntl, os, sys
from pathlib import Path
path, kind, text = Path(sys.argv[1]), sys.argv[2], sys.argv[3]
if kind == "folder":
    path.mkdir()
elif kind == "fifo":
    os.mkfifo(path)
else:
    path.write_bytes(bytes.fromhex(text))
    path.chmod(0 if kind == "closed" else 0o644)
if kind == "link":
    path = path.rename(path.with_suffix(".target"))
    Path(sys.argv[1]).symlink_to(path)
with contextlib.suppress(PermissionError):
    descriptor = os.open(path, os.O_RDWR if kind == "fifo" else os.O_RDONLY)
    fcntl.flock(descriptor, fcntl.LOCK_EX)
print("alive", flush=True)
for _ in sys.stdin:
    print("alive", flush=True)
"""
"""Program that makes a lock file with false content and locks it."""

PERSON = """
import ctypes, os, signal, sys
import rid_daq.operations.cell.stop, mock_hw.host.runtime_directory, mock_hw.bus.served_bus
from config.load import load_cell
from rid_daq.app import _end_once, run
from rid_daq.session.session import hold_cell
cell = load_cell("ir361").config
bus = cell.can.model_copy(update={"interface": "socketcan", "channel": "can0"})
cell = cell.model_copy(update={"can": bus})
user, what = int(sys.argv[1]), sys.argv[2]
if user != os.getuid():
    os.setgroups([])
    os.setgid(user)
    os.setuid(user)
    ctypes.CDLL(None).prctl(4, 1, 0, 0, 0)  # PR_SET_DUMPABLE: as any program of that user
if what == "stop":
    sys.exit(run(["stop", "--all", "--json"]))
signal.signal(signal.SIGTERM, _end_once)
os.umask(0o077)
with hold_cell(cell):
    exec(sys.argv[3] if len(sys.argv) > 3 else "")
    print("alive", flush=True)
    signal.pause()
"""
"""Program that holds a session, or runs `rid-daq stop --all`, as the user with a given id."""


class People:
    """Processes of several users, some with false locks; the exit stack ends them."""

    def __init__(self, stack: contextlib.ExitStack) -> None:
        self._stack = stack

    def start(self, program: str, *words: object) -> subprocess.Popen[str]:
        process = self._stack.enter_context(
            subprocess.Popen(
                [sys.executable, "-c", program, *map(str, words)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        )
        self._stack.callback(process.kill)
        return process

    def session(self, *words: object, user: int = ME) -> subprocess.Popen[str]:
        process = self.start(PERSON, user, "hold", *words)
        assert reports_alive(process)
        return process

    def stop(self, user: int) -> tuple[int, list[dict[str, Any]]]:
        process = self.start(PERSON, user, "stop")
        output, _ = process.communicate(timeout=120.0)
        return process.returncode, json.loads(output)["sessions"]


def reports_alive(process: subprocess.Popen[str]) -> bool:
    assert process.stdout is not None
    return process.stdout.readline() == "alive\n"


def is_alive(process: subprocess.Popen[str]) -> bool:
    """Return True if a process still answers."""
    assert process.stdin is not None
    process.stdin.write("?\n")
    process.stdin.flush()
    return reports_alive(process)
