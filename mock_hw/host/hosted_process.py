"""`HostedProcess`: runs a function in a running process of simulated hardware."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from config.errors import TransportError
from mock_hw.host.device_process import DeviceProcess

_END_S = 5.0
_LOST = -9


class HostedProcess:
    """A function that runs in a `DeviceProcess`, with methods as in `multiprocessing.Process`.

    One function at a time runs in a process.

    Args:
        host: The process. It answers 0 through its pipe when the function has returned, and 1 after
            an exception.
        target: Function of a module, which the host imports.
        args: Its arguments.

    Attributes:
        pid: Process id of the host; None before `start`.
        exitcode: 0 or 1, once the function has ended; the host's exit code if the host has died.
    """

    def __init__(
        self, host: DeviceProcess, target: Callable[..., None], args: tuple[Any, ...]
    ) -> None:
        self._host = host
        self._order = (target, args)
        self.pid: int | None = None
        self.exitcode: int | None = None

    @property
    def sentinel(self) -> int:
        """File descriptor that is readable once the function has ended."""
        return self._host.pipe.fileno()

    def start(self) -> None:
        """Order the host to run the function.

        Raises:
            TransportError: The host has died.
        """
        try:
            self._host.pipe.send(self._order)
        except OSError as error:
            raise TransportError(
                "the simulated drives have ended, because their process was killed or failed: run"
                " the command again to start them anew",
                code="RID-SYSTEM-PROCESS-DIED",
            ) from error
        self.pid = self._host.pid

    def is_alive(self) -> bool:
        """Return True while the function runs."""
        self.join(0.0)
        return self.pid is not None and self.exitcode is None

    def join(self, timeout: float | None = None) -> None:
        """Wait at most `timeout` [s] for the end of the function; None: without limit."""
        if self.pid is None or self.exitcode is not None:
            return
        try:
            if self._host.pipe.poll(timeout):
                self.exitcode = self._host.pipe.recv()
        except (EOFError, OSError):
            died = self._host.wait_for_end(_END_S)
            self.exitcode = _LOST if died is None else died

    def kill(self) -> None:
        """Kill the host, and the simulated hardware with it."""
        self._host.kill()

    def close(self) -> None:
        """Do nothing: the host continues."""
