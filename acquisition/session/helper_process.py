"""`HelperProcess`: process next to the program, with a common way to start, watch and end it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from config.process.own_process import new_process
from config.process.shortage import named_error
from config.process.termination import signals_blocked


class ProcessHandle(Protocol):
    """A process, or the cyclic task within the process of a simulated cell.

    Both have the methods of `multiprocessing.Process`.
    """

    @property
    def pid(self) -> int | None:
        """Process id; None before the start."""

    @property
    def exitcode(self) -> int | None:
        """Exit code; None before the end."""

    @property
    def sentinel(self) -> int:
        """File descriptor that is readable after the end."""

    def start(self) -> None:
        """Start it."""

    def is_alive(self) -> bool:
        """Return True while it runs."""

    def join(self, timeout: float | None = None) -> None:
        """Wait for the end, at most `timeout` [s]."""

    def kill(self) -> None:
        """Kill it."""

    def close(self) -> None:
        """Free its resources after the end."""


ProcessFactory = Callable[[Callable[..., None], tuple[Any, ...]], ProcessHandle]
"""Function that returns a process with a main function and its arguments, not started."""


class HelperProcess:
    """A process that is independent of the terminal; `start_all` starts it.

    Args:
        title: Name of the process in notes, such as `recorder`.
        main: Main function of the process, which begins with `leave_terminal`.
        arguments: Arguments of the main function.
        patience_s: Longest time that the process may take to end by itself after the motion [s].
        loss: Consequence of the process's death, as a clause for the note.
        create: Creates the process; None for a new process.

    Attributes:
        exit_code: Exit code, set by `end`.
        loss: Consequence of the process's death, as a clause for the note.
        hung_s: Time without a heartbeat after which the process was killed [s]; 0 if it was not
            killed for this reason.
    """

    exit_code: int | None = None
    hung_s: float = 0.0

    def __init__(
        self,
        title: str,
        main: Callable[..., None],
        arguments: tuple[Any, ...],
        *,
        patience_s: float,
        loss: str = "its file is not closed",
        create: ProcessFactory | None = None,
    ) -> None:
        self._title = title
        self._patience_s = patience_s
        self.loss = loss
        self._process: ProcessHandle
        if create is None:
            self._process = new_process(main, arguments, name=f"rid-daq {title}")
        else:
            self._process = create(main, arguments)

    @property
    def sentinel(self) -> int:
        """Handle for `multiprocessing.connection.wait`; ready once the process has ended."""
        return self._process.sentinel

    @property
    def is_alive(self) -> bool:
        """True while the process runs."""
        return self._process.is_alive()

    def wait(self, patience_s: float) -> bool:
        """Wait at most `patience_s` [s] for the end of the process; return True if it has ended."""
        self._process.join(patience_s)
        return not self.is_alive

    def kill(self) -> None:
        """Kill the process if it was started."""
        if self._process.pid is not None:
            self._process.kill()
            self._process.join()

    def kill_hung(self, silent_s: float) -> None:
        """Kill the process, because it had no heartbeat for `silent_s` [s]."""
        self.hung_s = silent_s
        self.kill()

    @property
    def death(self) -> str:
        """Ending of a process that did not finish, and its consequence, as a sentence."""
        how = f"died (exit code {self.exit_code})"
        if self.hung_s:
            how = f"did not respond for {self.hung_s:g} s and was killed"
        return f"the {self._title} {how}; {self.loss}"

    def end(self) -> list[str]:
        """Wait for the end of the process, or kill it; does nothing if it was never started.

        Returns:
            One sentence if the process was killed or failed; otherwise empty.
        """
        if self._process.pid is None:
            return []
        ended = self.wait(self._patience_s)
        if not ended:
            self.kill()
        self.exit_code = self._process.exitcode
        self._process.close()
        if not ended:
            return [f"the {self._title} did not finish and was killed; {self.loss}"]
        if self.exit_code:
            return [f"the {self._title} died (exit code {self.exit_code}); {self.loss}"]
        return []

    def start(self) -> None:
        """Start the process; called by `start_all`, which blocks termination signals meanwhile."""
        self._process.start()


Observer = Callable[[Ring, ControlBlock], HelperProcess]
"""Function that creates, but does not start, a process that reads ring and control block and can
request a stop."""


def start_all(helpers: Sequence[HelperProcess]) -> None:
    """Start all processes in this order, or none.

    Raises:
        ShortageError: The computer cannot start another process.
    """
    try:
        with signals_blocked(suspension=True):
            for helper in helpers:
                helper.start()
    except Exception as error:
        for helper in helpers:
            helper.kill()
        raise named_error(error) from error
