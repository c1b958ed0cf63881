"""`RunningSession`: a session that holds a bus of this machine, found by its lock file."""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path

from acquisition.control_block import ControlBlock
from config.errors import TransportError

_SIGNATURE = re.compile(r"process (\d+): ([^\n]*)\ncell ([^\n]*)\n")


@dataclass(frozen=True)
class RunningSession:
    """A session that runs.

    Attributes
    ----------
    lock : Path
        Its lock file.
    pid : int
        Of the program, 0 where the lock file does not say it.
    command : str
        The first words of its command line.
    cell : str
        The name of the cell that it holds.
    ours : bool
        Whether it is this user's, or this user is root, so that it can be stopped.
    """

    lock: Path
    pid: int
    command: str
    cell: str
    ours: bool

    @property
    def words(self) -> str:
        """What it is, for people."""
        return f"{self.command or 'a session'} on {self.cell or 'a cell'} (process {self.pid})"

    def control(self) -> ControlBlock | None:
        """Return the control block of the motion that is under way, None where none is.

        Raises
        ------
        PermissionError
            This process may not look into that one.
        """
        return ControlBlock.of_process(self.pid)

    @property
    def is_running(self) -> bool:
        """Whether it still holds its bus."""
        return _is_held(self.lock)


def machine_lock_folders() -> tuple[Path, ...]:
    """Return where locks of real buses may live; a new one is made in the first.

    It is the machine's lock folder, or the one for temporary files where that cannot be written; or
    the one that the environment variable RID_DAQ_LOCKS names.
    """
    told = os.environ.get("RID_DAQ_LOCKS")
    if told:
        return (Path(told),)
    machine_wide, temporary = Path("/run/lock"), Path(tempfile.gettempdir())
    if os.access(machine_wide, os.W_OK):
        return machine_wide, temporary
    return temporary, machine_wide


def running_sessions(cell: str | None = None) -> list[RunningSession]:
    """Return the sessions that run on this machine, simulated ones of this user included.

    Parameters
    ----------
    cell
        The name of a cell, where only its session is wanted.
    """
    found = [_read(path) for path in _lock_files() if _is_held(path)]
    return [session for session in found if cell is None or session.cell in (cell, "")]


def _lock_files() -> list[Path]:
    files = {path for folder in machine_lock_folders() for path in folder.glob("rid-daq-*.lock")}
    from mock_hw.runtime_directory import runtime_directory

    with contextlib.suppress(TransportError):
        own = runtime_directory()
        files |= {*own.glob("rid-daq-*.lock"), *own.glob("*/rid-daq-*.lock")}
    return sorted(files)


def _is_held(path: Path) -> bool:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    else:
        return False
    finally:
        os.close(descriptor)


def _read(path: Path) -> RunningSession:
    """Return what a lock file says; a file of another user is not believed."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    except OSError:
        return RunningSession(path, 0, "", "", ours=False)
    try:
        owner = os.fstat(descriptor).st_uid
        text = os.pread(descriptor, 1000, 0).decode("utf-8", "replace")
    finally:
        os.close(descriptor)
    match = _SIGNATURE.match(text)
    if match is None:
        return RunningSession(path, 0, "", "", ours=False)
    ours = os.getuid() in (owner, 0)
    return RunningSession(path, int(match[1]), match[2], match[3], ours)
