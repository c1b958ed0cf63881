"""`ProgramFaults`: faults that the operating system causes in the program during its work.

The faults use means of the operating system: signals, a limit on the file size of a process, a full
file system. The program itself contains no code for these faults.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import resource
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from multiprocessing.connection import Connection, wait
from pathlib import Path

from config.errors import ConfigError, RidDaqError
from config.process.own_process import ProcessName
from config.simulation.faults import DiskFault, ProcessKill, ProgramFault, ProgramSignal
from mock_hw.host.full_disk import FullDisk

_LOOK_S = 0.01
_TERMINATION = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_JOURNAL = ".mcap"
_NAMES = {"recorder": ProcessName.RECORDER, "task": ProcessName.TASK}


class ProgramFaults:
    """Executes the `program` part of a fault script on this process and on its child processes.

    The context manager starts a thread that waits for messages from the drives' process, which
    knows the cell's time. If the process or the recording that a fault affects does not exist yet,
    the fault is delayed until it does. At the end, suspended processes continue and filled disks
    are freed.

    Args:
        faults: The faults.
        pipe: Pipe from which the number of a fault comes when it begins, and to which an answer is
            sent when it has taken effect or is delayed.

    Raises:
        ConfigError: On leaving: a disk must not be filled, or the operating system refused an
            operation.
    """

    def __init__(self, faults: Sequence[ProgramFault], pipe: Connection) -> None:
        self._faults = faults
        self._pipe = pipe
        self._ended, self._ending = multiprocessing.Pipe(duplex=False)
        self._waiting: list[ProgramFault] = []
        self._due: list[tuple[float, Callable[[], None]]] = []
        self._frozen: list[int] = []
        self._full: list[FullDisk] = []
        self._problem: RidDaqError | None = None
        self._thread = threading.Thread(target=self._serve, name="program faults", daemon=True)

    def __enter__(self) -> ProgramFaults:
        """Start the thread."""
        self._thread.start()
        return self

    def __exit__(self, _kind: object, error: BaseException | None, *_: object) -> None:
        """End the thread, and undo faults that last."""
        self._ending.send(None)
        self._thread.join()
        self._ending.close()
        self._ended.close()
        if self._problem is not None and error is None:
            raise self._problem

    def _serve(self) -> None:
        # Block signals in this thread: the main thread must receive them, so that they wake it.
        signal.pthread_sigmask(signal.SIG_BLOCK, _TERMINATION)
        listening = [self._ended, self._pipe]
        try:
            while True:
                ready = wait(listening, self._timeout_s())
                if self._ended in ready:
                    return
                if self._pipe in ready and not self._handle_message():
                    listening.remove(self._pipe)
                self._waiting = [
                    fault for fault in self._waiting if not self._try_to_execute(fault)
                ]
                self._do_due()
        finally:
            for descriptor in [*self._frozen]:
                self._thaw(descriptor)
            for disk in self._full:
                disk.release()

    def _timeout_s(self) -> float | None:
        waits_s = [max(0.0, due_s - time.monotonic()) for due_s, _ in self._due]
        return min([*waits_s, _LOOK_S] if self._waiting else waits_s, default=None)

    def _handle_message(self) -> bool:
        """Receive a message, execute its fault, and answer; return False after the last one."""
        try:
            word = self._pipe.recv()
            if not isinstance(word, int):
                return False
            fault = self._faults[word]
            if not self._try_to_execute(fault):
                self._waiting.append(fault)
            self._do_due()
            self._pipe.send(None)
        except (EOFError, OSError):
            return False
        return True

    def _do_due(self) -> None:
        now_s = time.monotonic()
        for due in [due for due in self._due if due[0] <= now_s]:
            self._due.remove(due)
            due[1]()

    def _try_to_execute(self, fault: ProgramFault) -> bool:
        """Execute a fault; return False if it must wait for a process or a recording."""
        try:
            return self._execute(fault)
        except RidDaqError as problem:
            self._problem = problem
        except OSError as error:
            why = f"the operating system refused the operation: {error.strerror}"
            self._problem = ConfigError(f"program: {fault.kind}: {why}", code="RID-FAULT-SCRIPT")
        return True

    def _execute(self, fault: ProgramFault) -> bool:
        if isinstance(fault, ProgramSignal):
            number = signal.Signals[f"SIG{fault.signal}"]
            act = partial(os.kill, os.getpid(), number)
            now_s = time.monotonic()
            self._due += [(now_s + sent * fault.period_s, act) for sent in range(fault.count)]
            return True
        if isinstance(fault, DiskFault):
            return self._start_disk_fault(fault)
        if fault.process == "program":
            os.kill(os.getpid(), signal.SIGKILL)
        for pid in _children(_NAMES[fault.process]):
            with contextlib.suppress(ProcessLookupError):  # the process has just ended
                if isinstance(fault, ProcessKill):
                    os.kill(pid, signal.SIGKILL)
                else:
                    self._freeze(pid, fault.duration_s)
                return True
        return False

    def _freeze(self, pid: int, duration_s: float) -> None:
        descriptor = os.pidfd_open(pid)  # unlike a process number, it is never reused
        self._frozen.append(descriptor)
        signal.pidfd_send_signal(descriptor, signal.SIGSTOP)
        self._due.append((time.monotonic() + duration_s, partial(self._thaw, descriptor)))

    def _thaw(self, descriptor: int) -> None:
        if descriptor in self._frozen:
            self._frozen.remove(descriptor)
            with contextlib.suppress(ProcessLookupError):  # the process was killed
                signal.pidfd_send_signal(descriptor, signal.SIGCONT)
            os.close(descriptor)

    def _start_disk_fault(self, fault: DiskFault) -> bool:
        for pid in _children(ProcessName.RECORDER):
            journal = _journal(pid)
            if journal is None:
                continue
            with contextlib.suppress(ProcessLookupError):  # the process has just ended
                if fault.duration_s is not None:
                    self._freeze(pid, fault.duration_s)
                elif fault.kind == "disk_full":
                    self._full.append(FullDisk(journal.parent, fault.after_bytes))
                else:
                    limit = journal.stat().st_size + fault.after_bytes
                    _, hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)
                    resource.prlimit(pid, resource.RLIMIT_FSIZE, (limit, hard))
                return True
        return False


def _children(name: ProcessName) -> Iterator[int]:
    """Yield the process numbers of the running child processes with a name."""
    for pid in filter(str.isdigit, os.listdir("/proc")):
        with contextlib.suppress(OSError):  # the process has ended
            before, _, after = Path("/proc", pid, "stat").read_text().rpartition(")")
            state, parent = after.split()[:2]
            if before.partition("(")[2] == name and int(parent) == os.getpid() and state != "Z":
                yield int(pid)


def _journal(pid: int) -> Path | None:
    """Return the recording that a process writes; None if it does not exist or is empty."""
    with contextlib.suppress(OSError):
        for number in os.listdir(f"/proc/{pid}/fd"):
            path = Path(os.readlink(f"/proc/{pid}/fd/{number}"))
            if path.suffix == _JOURNAL and path.stat().st_size:
                return path
    return None
