"""`FrontStopHandler`: stops a motion by shared memory and any other job by SIGTERM."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
from collections.abc import Callable, Iterable, Mapping

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from rid_daq.service.refusals import UnknownError
from rid_daq.service.stop.stop_answer import ALL, StopAnswer, stop_each, unknown_sender_error
from rid_daq.web.access import is_loopback
from rid_daq.web.request_secrets import all_secrets_of, hash_secret

_LOG = logging.getLogger("rid_daq.service.front")


class FrontStopHandler:
    """Stops the worker processes that the service has reported, even if the service hangs.

    Args:
        cells: Names of the service's cells.
        tell: Function that reports a stop to the service: the cell or `ALL`, and the sender as
            `identify_sender` returns it.
    """

    def __init__(self, cells: Iterable[str], tell: Callable[[str, str], None]) -> None:
        self._cells = tuple(cells)
        self._tell = tell
        self._issued: set[str] = set()
        self._jobs: dict[str, tuple[int, int | None]] = {}

    def note_issued(self, hashes: Iterable[str]) -> None:
        """Store hashes of issued secrets; the sender of any of these secrets may stop."""
        self._issued.update(hashes)

    def note_jobs(self, jobs: Mapping[str, int]) -> None:
        """Store the process id of the job on each cell's bus; 0 for a job that is being started."""
        before, self._jobs = self._jobs, {}
        for cell, pid in jobs.items():
            if before.get(cell, (0, None))[0] == pid and pid:
                # keep the open descriptor, because the process number may be reused
                self._jobs[cell] = before.pop(cell)
            else:
                with contextlib.suppress(OSError):  # the process has ended
                    self._jobs[cell] = pid, os.pidfd_open(pid) if pid else None
        for _, descriptor in before.values():
            if descriptor is not None:
                os.close(descriptor)

    def identify_sender(self, headers: Mapping[str, str], *, local: bool, address: str) -> str:
        """Return the hash of an issued secret in the request, or an empty text for this computer.

        Raises:
            NotKnownError: The sender is on another computer, and the request contains no secret
                that was ever issued.
        """
        shown = (hash_secret(secret) for secret in all_secrets_of(headers))
        known = next((each for each in shown if each in self._issued), None)
        if known is None and not (local or is_loopback(address)):
            raise unknown_sender_error()
        return known or ""

    def stop(self, target: str, who: str) -> StopAnswer:
        """Stop a cell, or all cells (`ALL`); then report the stop to the service.

        Raises:
            UnknownError: The service has no such cell.
        """
        if target not in (ALL, *self._cells):
            raise UnknownError(
                f"no cell {target!r} in this service; its cells are {', '.join(self._cells)}",
                code="RID-CELL-UNKNOWN",
            )
        answer = stop_each(
            self._cells if target == ALL else [target],
            self._stop,
            lambda cell: _LOG.exception("cell %s: the stop failed", cell),
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


def stop_process(descriptor: int) -> None:
    """Stop a worker: its motion through the control block, any other job by SIGTERM.

    Args:
        descriptor: Descriptor of the process (`os.pidfd_open`); a process number may be reused.
    """
    control = None
    with contextlib.suppress(OSError):  # the process has just ended
        pid = _pid_of(descriptor)
        control = None if pid is None else ControlBlock.of_process(pid)
    if control is not None:
        control.program.request_stop(StopCode.STOP_BUTTON)
    if control is None or control.task_gone:  # the task no longer reads the control block
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(descriptor, signal.SIGTERM)


def _pid_of(descriptor: int) -> int | None:
    """Return the process id of a living process, None if it has ended."""
    with open(f"/proc/self/fdinfo/{descriptor}", encoding="ascii") as file:
        number = int(file.read().partition("Pid:")[2].split()[0])
    return number if number > 0 else None
