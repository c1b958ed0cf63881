"""`WorkerTemplate`: the process that forks itself into a worker for each job."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import signal
import socket
from collections import deque
from pathlib import Path

from acquisition.task.service_beat import ServiceBeat
from config.process.own_process import own_python
from rid_daq.service.workers.worker_process import WorkerProcess
from rid_daq.service.workers.worker_report import REPORT, REQUEST, ReportKind, WorkerReport


class WorkerTemplate:
    """Process that has imported the modules of the jobs, and forks workers.

    A fork takes milliseconds; a new Python process would take seconds of CPU time.

    Args:
        log: Log file for output of workers that is not an event, such as tracebacks.
    """

    def __init__(self, log: Path) -> None:
        self._log = log
        self._process: asyncio.subprocess.Process | None = None
        self._line: socket.socket | None = None
        self._locked = asyncio.Lock()
        self._starting: deque[tuple[WorkerProcess, asyncio.Future[None]]] = deque()
        self._workers: dict[int, WorkerProcess] = {}

    async def prepare(self) -> None:
        """Start the template unless it runs.

        Raises:
            OSError: The process cannot be started.
        """
        async with self._locked:
            if self._line is None:
                await self._start()

    async def start_worker(self) -> WorkerProcess:
        """Return a new worker that waits for its job.

        Raises:
            OSError: The process cannot be started.
        """
        await self.prepare()
        beat = ServiceBeat.create()
        ours, theirs = socket.socketpair()
        with theirs, self._log.open("ab") as log:
            _, stdin = await asyncio.open_connection(sock=ours)
            worker = WorkerProcess(stdin, beat)
            started = asyncio.get_running_loop().create_future()
            try:
                if self._line is None:
                    raise _template_ended()
                descriptors = [theirs.fileno(), log.fileno(), beat.descriptor]
                socket.send_fds(self._line, [REQUEST], descriptors)
                self._starting.append((worker, started))
                await started
            except BaseException:
                stdin.close()
                raise
        return worker

    async def end(self) -> None:
        """End the template; workers continue."""
        if self._line is not None:
            self._lose()
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                self._process.kill()
            await self._process.wait()

    async def _start(self) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs, contextlib.ExitStack() as stack, self._log.open("ab") as log:
            stack.callback(ours.close)
            self._process = await asyncio.create_subprocess_exec(
                *own_python("rid_daq.worker", str(theirs.fileno())),
                stdin=asyncio.subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
                pass_fds=(theirs.fileno(),),
            )
            ours.setblocking(False)
            asyncio.get_running_loop().add_reader(ours, self._read_report)
            self._line = ours
            stack.pop_all()

    def _read_report(self) -> None:
        assert self._line is not None
        message, descriptors, *_ = socket.recv_fds(
            self._line, REPORT.size, 1, socket.MSG_CMSG_CLOEXEC
        )
        if not message:
            self._lose()
            return
        report = WorkerReport.unpack(message)
        if report.kind is ReportKind.ENDED:
            if report.pid in self._workers:
                self._workers.pop(report.pid).note_end(report.value)
            return
        worker, started = self._starting.popleft()
        error = report.value
        if report.kind is ReportKind.STARTED and not descriptors:
            os.kill(report.pid, signal.SIGKILL)  # the report of this worker's end will be ignored
            error = errno.EMFILE
        if error:
            if not started.done():
                started.set_exception(OSError(error, os.strerror(error)))
            return
        worker.note_start(report.pid, descriptors[0])
        self._workers[report.pid] = worker
        if started.done():  # cancelled: this worker will get no order
            worker.kill()
        else:
            started.set_result(None)

    def _lose(self) -> None:
        """Forget the template, which has ended; the next request for a worker starts a new one."""
        line, self._line = self._line, None
        assert line is not None
        asyncio.get_running_loop().remove_reader(line)
        line.close()
        for worker in self._workers.values():
            worker.note_loss()
        self._workers.clear()
        for _, started in self._starting:
            if not started.done():
                started.set_exception(_template_ended())
        self._starting.clear()


def _template_ended() -> OSError:
    return ChildProcessError(errno.ECHILD, "the template of the workers has ended; see workers.log")
