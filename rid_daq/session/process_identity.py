"""`ProcessIdentity`: which process it is, by what the kernel says of it to everybody."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

_STARTED = 22 - 3
"""Where the start time is in /proc/PID/stat behind the name, which is the second field."""


@dataclass(frozen=True)
class ProcessIdentity:
    """A process that lives: numbers are used again, a number with its start time is not.

    Attributes
    ----------
    pid : int
        Its number.
    uid : int
        The user on whose behalf it acts.
    started : int
        When it began, in clock ticks since the computer did.
    """

    pid: int
    uid: int
    started: int

    @classmethod
    def of(cls, pid: int) -> ProcessIdentity | None:
        """Return who bears a number now; None where nobody does, or this user may not see it.

        Notes
        -----
        proc(5): field 22 of /proc/PID/stat; the second number behind ``Uid:`` in /proc/PID/status.
        """
        folder = Path(f"/proc/{pid}")
        try:
            stat = (folder / "stat").read_bytes()
            status = (folder / "status").read_bytes()
        except OSError:
            return None
        started = int(stat.rpartition(b") ")[2].split()[_STARTED])
        uid = int(status.partition(b"\nUid:")[2].split(maxsplit=2)[1])
        return cls(pid, uid, started)
