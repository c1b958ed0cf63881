"""`FrontDesk`: STOP as the process in front does it: by shared memory or a signal, at once."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import signal
from collections.abc import Callable, Iterable, Mapping

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from rid_daq.service.refusals import UnknownError
from rid_daq.service.stop.stop_answer import ALL, StopAsked, stop_each, unknown_stopper
from rid_daq.web.access import is_loopback
from rid_daq.web.request_secrets import secrets_of

_LOG = logging.getLogger("rid_daq.service.front")


class FrontDesk:
    """Stops the processes that the service has named, also while the service hangs.

    Args:
        cells: The service's cells.
        tell: Tells the service of a stop: the cell, or `ALL`, and who asked, as `admit` has it.
    """

    def __init__(self, cells: Iterable[str], tell: Callable[[str, str], None]) -> None:
        self._cells = tuple(cells)
        self._tell = tell
        self._issued: set[str] = set()
        self._jobs: dict[str, tuple[int, int | None]] = {}

    def note_issued(self, hashes: Iterable[str]) -> None:
        """Keep hashes of secrets: whoever shows one of them may stop."""
        self._issued.update(hashes)

    def note_jobs(self, jobs: Mapping[str, int]) -> None:
        """Keep which process has which cell; 0 for one that is on its way."""
        before, self._jobs = self._jobs, {}
        for cell, pid in jobs.items():
            if before.get(cell, (0, None))[0] == pid and pid:
                self._jobs[cell] = before.pop(cell)  # its number may be another's by now
            else:
                with contextlib.suppress(OSError):  # it has ended
                    self._jobs[cell] = pid, os.pidfd_open(pid) if pid else None
        for _, descriptor in before.values():
            if descriptor is not None:
                os.close(descriptor)

    def admit(self, headers: Mapping[str, str], *, local: bool, address: str) -> str:
        """Return who asks: the hash of a secret that was issued, or nothing for this computer.

        Raises:
            NotKnownError: They ask from another computer and show no secret that was ever issued.
        """
        shown = (hash_of(secret) for secret in secrets_of(headers))
        known = next((each for each in shown if each in self._issued), None)
        if known is None and not (local or is_loopback(address)):
            raise unknown_stopper()
        return known or ""

    def stop(self, target: str, who: str) -> StopAsked:
        """Stop a cell, or all of them (`ALL`); then tell the service.

        Raises:
            UnknownError: There is no such cell.
        """
        if target not in (ALL, *self._cells):
            raise UnknownError(
                f"no cell {target!r} here; there are {', '.join(self._cells)}",
                code="RID-CELL-UNKNOWN",
            )
        answer = stop_each(
            self._cells if target == ALL else [target],
            self._stop,
            lambda cell: _LOG.exception("cell %s: its stop went wrong", cell),
        )
        self._tell(target, who)
        return answer

    def _stop(self, cell: str) -> bool:
        if cell not in self._jobs:
            return False
        _, descriptor = self._jobs[cell]
        if descriptor is not None:
            stop_process(descriptor)
        return True


def hash_of(secret: str) -> str:
    """Return the hash by which a secret is known; the same as `store.tokens.hashed`."""
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()


def stop_process(descriptor: int) -> None:
    """Stop the motion of a worker by the word in shared memory, anything else by SIGTERM.

    Args:
        descriptor: Of the process (`os.pidfd_open`): its number may be another's by now.
    """
    control = None
    with contextlib.suppress(OSError):  # it has just ended
        pid = _pid_of(descriptor)
        control = None if pid is None else ControlBlock.of_process(pid)
    if control is not None:
        control.program.request_stop(StopCode.STOP_BUTTON)
    if control is None or control.task_gone:  # which may read that word no more
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(descriptor, signal.SIGTERM)


def _pid_of(descriptor: int) -> int | None:
    """Return the number of a process that lives, None if it has ended."""
    with open(f"/proc/self/fdinfo/{descriptor}", encoding="ascii") as file:
        number = int(file.read().partition("Pid:")[2].split()[0])
    return number if number > 0 else None
