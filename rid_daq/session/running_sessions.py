"""`RunningSession`: a session that holds a bus of this computer, found by its session file.

The session file is in the folder of the bus's lock. Its content is used only if the kernel confirms
it; see docs/decisions/0031.
"""

from __future__ import annotations

import contextlib
import os
import re
import signal
import stat
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from acquisition.task.control_block import ControlBlock
from config.errors import RecordingError, TransportError
from config.process.file_locks import held_file, lock_holder

_STARTED = 22 - 3
"""Position of the start time in /proc/PID/stat after the name, which is the second field."""


@dataclass(frozen=True)
class ProcessIdentity:
    """Identity of a living process: its number may be reused, but not with the same start time.

    Attributes:
        pid: Process number.
        uid: Effective user of the process.
        started: Start time, in clock ticks since the start of the computer.
    """

    pid: int
    uid: int
    started: int

    @classmethod
    def of(cls, pid: int) -> ProcessIdentity | None:
        """Return the process that has the number `pid` now.

        Returns:
            None if there is no such process, or if this user cannot see it.

        Note:
            proc(5): field 22 of /proc/PID/stat; the second number behind ``Uid:`` in
            /proc/PID/status.
        """
        folder = Path(f"/proc/{pid}")
        try:
            about = (folder / "stat").read_bytes()
            status = (folder / "status").read_bytes()
        except OSError:
            return None
        started = int(about.rpartition(b") ")[2].split()[_STARTED])
        uid = int(status.partition(b"\nUid:")[2].split(maxsplit=2)[1])
        return cls(pid, uid, started)


_FILE_FORMAT = re.compile(r"started ([0-9]+): ([^\n]*)\ncell ([^\n]*)\n")
_FILE_BYTES = 1000
_LONGEST_COMMAND = 100
_OF_ANOTHER_USER = "belongs to another user; only that user or root can stop it from here"


@dataclass(frozen=True)
class RunningSession:
    """A running session, or a process that claims to be one.

    Attributes:
        file: Session file, which the session has locked.
        pid: Number of the process, as the kernel reports it.
        command: First words of its command line; empty if unknown.
        cell: Name of its cell; empty if unknown.
        refusal: Reason why it cannot be stopped from here; None if it can.
    """

    file: Path
    pid: int
    command: str
    cell: str
    refusal: str | None = None

    @property
    def words(self) -> str:
        """Description of the session for messages."""
        by = f", `{self.command}`" if self.command else ""
        return f"session on {self.cell or 'a cell'} (process {self.pid}{by})"

    def control(self) -> ControlBlock | None:
        """Return the control block of the present motion, None without a motion.

        Raises:
            PermissionError: This process has no access to the memory of that process.
        """
        control = ControlBlock.of_process(self.pid)
        # if the session has ended, another process may have its number now
        return control if self.is_running else None

    def terminate(self) -> None:
        """Send SIGTERM to the session; do nothing if it has ended or has a `refusal`."""
        with contextlib.suppress(ProcessLookupError):
            process = os.pidfd_open(self.pid)
            try:
                if self.is_running and self.refusal is None:
                    signal.pidfd_send_signal(process, signal.SIGTERM)
            finally:
                os.close(process)

    @property
    def is_running(self) -> bool:
        """True if the session still holds its bus."""
        return _read_session(self.file) == self


def machine_lock_folders() -> tuple[Path, ...]:
    """Return the folders that may contain locks of real buses; the first one receives new locks.

    The folders are the computer's lock folder, and the folder for temporary files, which comes
    first if the lock folder is not writable. The environment variable RID_DAQ_LOCKS names another
    folder instead.
    """
    folder = os.environ.get("RID_DAQ_LOCKS")
    if folder:
        return (Path(folder),)
    machine_wide, temporary = Path("/run/lock"), Path(tempfile.gettempdir())
    if os.access(machine_wide, os.W_OK):
        return machine_wide, temporary
    return temporary, machine_wide


def running_sessions(cell: str | None = None) -> list[RunningSession]:
    """Return the sessions that run on this computer, including simulated ones of this user.

    Args:
        cell: Name of a cell, to return only its session and the sessions whose cell is unknown.
    """
    found = [session for path in _session_files() if (session := _read_session(path)) is not None]
    return [session for session in found if cell is None or session.cell in (cell, "")]


def session_on(lock: Path, pid: int) -> RunningSession | None:
    """Return the session of a process that locks a bus, None if it has no session file."""
    process = ProcessIdentity.of(pid)
    session = None if process is None else _read_session(_session_file(lock, process.uid))
    return session if session is not None and session.pid == pid else None


@contextlib.contextmanager
def registered_session(lock: Path, cell: str) -> Iterator[None]:
    """Write the session file of this process, and keep it locked inside the `with` block.

    Args:
        lock: Lock file of the bus, which this process holds.
        cell: Name of the cell.

    Raises:
        RecordingError: The file cannot be written; it may belong to another user.
    """
    path = _session_file(lock, os.geteuid())
    this = ProcessIdentity.of(os.getpid())
    words = " ".join(("rid-daq", *(Path(word).name for word in sys.argv[1:3])))
    command = "".join(
        letter if letter.isprintable() else "?" for letter in words[:_LONGEST_COMMAND]
    )
    with contextlib.ExitStack() as stack:
        try:
            path.unlink(missing_ok=True)  # left by a killed session
            text = f"started {0 if this is None else this.started}: {command}\ncell {cell}\n"
            new = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC | os.O_NOFOLLOW
            with open(os.open(path, new, 0o644), "wb") as file:
                os.fchmod(file.fileno(), 0o644)
                file.write(text.encode())
            stack.enter_context(held_file(path))  # other processes can find the file from here on
        except OSError as error:
            raise RecordingError(
                f"{path}: cannot be written: {error.strerror}. `rid-daq stop` needs this file to"
                " find the session: ask its owner or root to remove it, or set another folder in"
                " RID_DAQ_LOCKS",
                code="RID-FILE-ACCESS",
            ) from None
        yield


def _session_file(lock: Path, uid: int) -> Path:
    return lock.with_suffix(f".{uid}.session")


def _session_files() -> list[Path]:
    folders = list(machine_lock_folders())
    from mock_hw.host.runtime_directory import runtime_directory

    with contextlib.suppress(TransportError):
        own = runtime_directory()
        folders += [own, *_entries(own)]
    files = {path for folder in folders for path in _entries(folder)}
    return sorted(path for path in files if path.match("rid-daq-*.session"))


def _entries(folder: Path) -> list[Path]:
    """Return the entries of a folder; an empty list if the folder does not exist."""
    with contextlib.suppress(OSError):
        return list(folder.iterdir())
    return []


def _read_session(path: Path) -> RunningSession | None:
    """Return the session of a session file, None if no process has locked the file."""
    try:
        descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC | os.O_NOFOLLOW)
    except OSError:
        return None  # the session has ended in the meantime
    try:
        pid = lock_holder(descriptor)
        if pid is None:
            return None
        status = os.fstat(descriptor)
        text = _read_text(descriptor) if stat.S_ISREG(status.st_mode) else ""
    finally:
        os.close(descriptor)
    match = _FILE_FORMAT.fullmatch(text)
    owner = status.st_uid
    registered_by = None if match is None else ProcessIdentity(pid, owner, int(match[1]))
    true = registered_by is not None and registered_by == ProcessIdentity.of(pid)
    refusal = None
    if os.geteuid() not in (owner, 0):
        refusal = _OF_ANOTHER_USER
    elif not true or pid <= 1:
        refusal = (
            f"holds a lock of rid-daq without a valid session file: not stopped; `ps -fp {pid}`"
            " shows the process"
        )
    elif pid == os.getpid():
        refusal = "is this program itself"
    command, cell = (match[2], match[3]) if match is not None and true else ("", "")
    return RunningSession(path, pid, command, cell, refusal)


def _read_text(descriptor: int) -> str:
    """Return the content of a file, empty if this user cannot read it."""
    with (
        contextlib.suppress(OSError),
        open(f"/proc/self/fd/{descriptor}", "rb", buffering=0) as file,
    ):
        return file.read(_FILE_BYTES).decode("utf-8", "replace")
    return ""
