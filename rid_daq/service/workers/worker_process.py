"""`WorkerProcess`: the process of a job, forked from the template of the workers."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
from typing import Final

from acquisition.task.service_beat import ServiceBeat

EXIT_CODE_UNKNOWN: Final = 255
"""Exit code of a worker that ends after the template: the service cannot read the real exit code,
which the kernel reports to the template only.
"""


class WorkerProcess:
    """A worker, which is not a child process of the service.

    Args:
        stdin: Its standard input.
        beat: Shared memory with the service's heartbeat.

    Attributes:
        pid: Its process id.
        returncode: Exit code, or negative number of the signal that killed it; None while it runs.
    """

    def __init__(self, stdin: asyncio.StreamWriter, beat: ServiceBeat) -> None:
        self.stdin = stdin
        self.beat = beat
        self.pid = 0
        self.returncode: int | None = None
        self._descriptor = -1
        self._ended = asyncio.Event()

    def note_start(self, pid: int, descriptor: int) -> None:
        """Set the process id and a pidfd; the pidfd is closed when the worker has ended."""
        self.pid, self._descriptor = pid, descriptor

    def note_end(self, returncode: int) -> None:
        """Set the exit code."""
        self.returncode = returncode
        os.close(self._descriptor)
        self.stdin.close()
        self._ended.set()

    def note_loss(self) -> None:
        """Detect the worker's end by its pidfd from now on, because the template has ended."""
        loop = asyncio.get_running_loop()

        def end() -> None:
            loop.remove_reader(self._descriptor)
            self.note_end(EXIT_CODE_UNKNOWN)

        loop.add_reader(self._descriptor, end)

    def terminate(self) -> None:
        """Send SIGTERM, unless the worker has ended."""
        self._send(signal.SIGTERM)

    def kill(self) -> None:
        """Send SIGKILL, unless the worker has ended."""
        self._send(signal.SIGKILL)

    async def wait(self) -> None:
        """Wait until the worker has ended."""
        await self._ended.wait()

    def _send(self, number: signal.Signals) -> None:
        if self.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                signal.pidfd_send_signal(self._descriptor, number)
