"""The program on a system that is not Linux: `python -m tests.builders.without_linux COMMAND …`.

It removes Linux-only functions from Python's modules, blocks Unix-only modules, hides /proc and
/sys from our own code, and then calls the program with the command line.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import sys
import time
from pathlib import Path
from types import FrameType

BLOCKED = ("fcntl", "termios", "resource", "tty", "pty")
"""Modules of Unix that no offline command may need."""
REMOVED = {
    os: (
        *("O_PATH", "O_TMPFILE", "memfd_create", "pidfd_open", "sched_getaffinity"),
        *(
            "sched_setscheduler",
            "sched_getscheduler",
            "sched_getparam",
            "sched_param",
            "SCHED_FIFO",
        ),
        *("fdatasync", "posix_fallocate", "posix_fadvise", "eventfd", "copy_file_range", "splice"),
        *("setresuid", "getrandom", "listxattr", "MFD_CLOEXEC", "MFD_ALLOW_SEALING"),
    ),
    signal: ("pidfd_send_signal", "SIGRTMIN", "SIGRTMAX", "SIGPWR"),
    select: ("epoll",),
    socket: ("AF_CAN", "PF_CAN", "CAN_RAW", "SO_PEERCRED", "AF_NETLINK", "AF_PACKET"),
    time: ("CLOCK_BOOTTIME", "CLOCK_MONOTONIC_RAW"),
}
"""Names that Python has on Linux, but not on macOS, by module."""
HIDDEN = ("/proc", "/sys", "/dev/shm")
_ROOT = str(Path(__file__).resolve().parents[2])


def hide_linux() -> None:
    """Make this process resemble one on a system that is not Linux; this cannot be undone."""
    for name in BLOCKED:
        sys.modules[name] = None  # type: ignore[assignment]
    for module, names in REMOVED.items():
        for name in names:
            if hasattr(module, name):
                delattr(module, name)
    sys.addaudithook(_refuse_hidden)


def _refuse_hidden(event: str, arguments: tuple[object, ...]) -> None:
    """Let our own code find no file below the hidden folders; libraries may use them."""
    if event not in ("open", "os.listdir", "os.scandir"):
        return
    if str(arguments[0]).startswith(HIDDEN):
        frame: FrameType | None = sys._getframe(1)
        while frame is not None and _is_of_library(frame.f_code.co_filename):
            frame = frame.f_back
        if frame is not None and _is_our_own(frame.f_code.co_filename):
            raise FileNotFoundError(2, "No such file or directory", str(arguments[0]))


def _is_our_own(file: str) -> bool:
    return file.startswith(_ROOT) and "site-packages" not in file


def _is_of_library(file: str) -> bool:
    """Return True for a file of `pathlib` or `codecs`, which open files for other modules."""
    return Path(file).name in ("pathlib.py", "_local.py", "codecs.py")


if __name__ == "__main__":
    hide_linux()
    from rid_daq.app import main

    main()
