"""The template of the workers: it waits for the service's requests, and forks a worker for each."""

from __future__ import annotations

import errno
import os
import selectors
import signal
import socket
from collections.abc import Iterable

from rid_daq.service.workers.worker_report import REQUEST, ReportKind, WorkerReport

_DESCRIPTORS = 3


def fork_workers(line: socket.socket) -> int | None:
    """Fork a worker for each request and report its start and its end, until the service ends.

    The function returns in every worker too. A worker has its orders on standard input, its log on
    standard output and standard error, and its own session.

    Args:
        line: Connection to the service; it is closed.

    Returns:
        In a worker the descriptor of the service's heartbeat, in the template None.

    Raises:
        BrokenPipeError: The service ended before it read a report; only in the template.
    """
    workers: dict[int, int] = {}  # process ids by pidfds
    # poll, not epoll: the forked workers would share the kernel's epoll object
    with line, selectors.PollSelector() as selector:
        selector.register(line, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                if key.fd in workers:
                    selector.unregister(key.fd)
                    os.close(key.fd)
                    _report_end(line, workers.pop(key.fd))
                    continue
                request, received, *_ = socket.recv_fds(
                    line, len(REQUEST), _DESCRIPTORS, socket.MSG_CMSG_CLOEXEC
                )
                if not request:
                    return None
                try:
                    pid = _fork(received)
                    if pid == 0:
                        _close(workers)
                        return _set_up_worker(received)
                    pidfd = _open_pidfd(pid)
                except OSError as error:
                    line.send(
                        WorkerReport(ReportKind.NOT_STARTED, 0, error.errno or errno.EAGAIN).pack()
                    )
                    _close(received)
                    continue
                _close(received)
                workers[pidfd] = pid
                selector.register(pidfd, selectors.EVENT_READ)
                socket.send_fds(line, [WorkerReport(ReportKind.STARTED, pid).pack()], [pidfd])


def _fork(received: list[int]) -> int:
    if len(received) < _DESCRIPTORS:  # this process has too many open files
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
    return os.fork()


def _open_pidfd(pid: int) -> int:
    """Return a pidfd of a child process; kill the child process if that fails."""
    try:
        return os.pidfd_open(pid)
    except OSError:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        raise


def _set_up_worker(received: list[int]) -> int:
    """Make this process a worker; return the descriptor of the service's heartbeat."""
    orders, log, beat = received
    os.setsid()
    for descriptor, standard in ((orders, 0), (log, 1), (log, 2)):
        os.dup2(descriptor, standard)
    _close((orders, log))
    return beat


def _report_end(line: socket.socket, pid: int) -> None:
    _, status = os.waitpid(pid, 0)
    code = os.waitstatus_to_exitcode(status)
    line.send(WorkerReport(ReportKind.ENDED, pid, code).pack())


def _close(descriptors: Iterable[int]) -> None:
    for descriptor in descriptors:
        os.close(descriptor)
