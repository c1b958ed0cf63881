"""`RunningSession`: a session that holds a bus of this machine, found by the file that it signed.

The file lies beside the lock of the bus. Nothing that it says is believed unless the kernel says
the same; see docs/decisions/0031.
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
"""Where the start time is in /proc/PID/stat behind the name, which is the second field."""


@dataclass(frozen=True)
class ProcessIdentity:
    """A process that lives: numbers are used again, a number with its start time is not.

    Attributes:
        pid: Its number.
        uid: The user on whose behalf it acts.
        started: When it began, in clock ticks since the computer did.
    """

    pid: int
    uid: int
    started: int

    @classmethod
    def of(cls, pid: int) -> ProcessIdentity | None:
        """Return who bears a number now; None where nobody does, or this user may not see it.

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


_SIGNATURE = re.compile(r"started ([0-9]+): ([^\n]*)\ncell ([^\n]*)\n")
_SIGNATURE_BYTES = 1000
_LONGEST_COMMAND = 100
_OF_ANOTHER_USER = "belongs to another user; only that user or root can stop it from here"


@dataclass(frozen=True)
class RunningSession:
    """A session that runs, or what passes itself off as one.

    Attributes:
        file: What it signed, and holds.
        pid: Of the program, by the kernel's word.
        command: The first words of its command line; empty where that is not known.
        cell: The name of the cell that it holds; empty where that is not known.
        refusal: Why it cannot be stopped from here; None where it can.
    """

    file: Path
    pid: int
    command: str
    cell: str
    refusal: str | None = None

    @property
    def words(self) -> str:
        """What it is, for people."""
        by = f", `{self.command}`" if self.command else ""
        return f"session on {self.cell or 'a cell'} (process {self.pid}{by})"

    def control(self) -> ControlBlock | None:
        """Return the control block of the motion that is under way, None where none is.

        Raises:
            PermissionError: This process may not look into that one.
        """
        control = ControlBlock.of_process(self.pid)
        return control if self.is_running else None  # else its number may be another's by now

    def terminate(self) -> None:
        """Send SIGTERM to the very process that holds the file; to none if it has ended."""
        with contextlib.suppress(ProcessLookupError):
            process = os.pidfd_open(self.pid)
            try:
                if self.is_running and self.refusal is None:
                    signal.pidfd_send_signal(process, signal.SIGTERM)
            finally:
                os.close(process)

    @property
    def is_running(self) -> bool:
        """Whether it still holds its bus."""
        return _read(self.file) == self


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

    Args:
        cell: The name of a cell, where only its session is wanted.
    """
    found = [session for path in _session_files() if (session := _read(path)) is not None]
    return [session for session in found if cell is None or session.cell in (cell, "")]


def session_on(lock: Path, pid: int) -> RunningSession | None:
    """Return the session of a process that holds the lock of a bus, None where it has none."""
    process = ProcessIdentity.of(pid)
    session = None if process is None else _read(_session_file(lock, process.uid))
    return session if session is not None and session.pid == pid else None


@contextlib.contextmanager
def signed(lock: Path, cell: str) -> Iterator[None]:
    """Let this process be found as a session for as long as the `with` lasts.

    Args:
        lock: The lock of its bus, which it holds.
        cell: The name of its cell.

    Raises:
        RecordingError: The file cannot be written; it may be another user's.
    """
    path = _session_file(lock, os.geteuid())
    this = ProcessIdentity.of(os.getpid())
    words = " ".join(("rid-daq", *(Path(word).name for word in sys.argv[1:3])))
    command = "".join(
        letter if letter.isprintable() else "?" for letter in words[:_LONGEST_COMMAND]
    )
    with contextlib.ExitStack() as stack:
        try:
            path.unlink(missing_ok=True)  # of a session that was killed
            text = f"started {0 if this is None else this.started}: {command}\ncell {cell}\n"
            new = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC | os.O_NOFOLLOW
            with open(os.open(path, new, 0o644), "wb") as file:
                os.fchmod(file.fileno(), 0o644)
                file.write(text.encode())
            stack.enter_context(held_file(path))  # it is looked at from here on
        except OSError as error:
            raise RecordingError(
                f"{path}: cannot be written: {error.strerror}. `rid-daq stop` finds a session by"
                " it: let its owner or root remove it, or name another folder with RID_DAQ_LOCKS",
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
    """Return what is in a folder; nothing where it is none, or vanishes."""
    with contextlib.suppress(OSError):
        return list(folder.iterdir())
    return []


def _read(path: Path) -> RunningSession | None:
    """Return whose session a file is, None where nobody holds it."""
    try:
        descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC | os.O_NOFOLLOW)
    except OSError:
        return None  # it has ended meanwhile
    try:
        pid = lock_holder(descriptor)
        if pid is None:
            return None
        status = os.fstat(descriptor)
        text = _text(descriptor) if stat.S_ISREG(status.st_mode) else ""
    finally:
        os.close(descriptor)
    match = _SIGNATURE.fullmatch(text)
    owner = status.st_uid
    signed_by = None if match is None else ProcessIdentity(pid, owner, int(match[1]))
    true = signed_by is not None and signed_by == ProcessIdentity.of(pid)
    refusal = None
    if os.geteuid() not in (owner, 0):
        refusal = _OF_ANOTHER_USER
    elif not true or pid <= 1:
        refusal = (
            "holds a lock of rid-daq without having signed it as a session does: left alone;"
            f" `ps -fp {pid}` says what it is"
        )
    elif pid == os.getpid():
        refusal = "is this very program"
    command, cell = (match[2], match[3]) if match is not None and true else ("", "")
    return RunningSession(path, pid, command, cell, refusal)


def _text(descriptor: int) -> str:
    """Return what is in a file, nothing where this user may not read it."""
    with (
        contextlib.suppress(OSError),
        open(f"/proc/self/fd/{descriptor}", "rb", buffering=0) as file,
    ):
        return file.read(_SIGNATURE_BYTES).decode("utf-8", "replace")
    return ""
