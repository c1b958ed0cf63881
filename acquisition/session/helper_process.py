"""`HelperProcess`: one life for every process beside the program: started, watched, ended."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from multiprocessing import get_context
from typing import Any

from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from config.process.shortage import named_error
from config.process.termination import signals_blocked


class HelperProcess:
    """A process of its own that stands apart from the terminal; made here, started by `start_all`.

    Args:
        title: What it is called in notes, as `recorder`.
        main: Its main function, which begins with `leave_terminal`.
        arguments: The main function's.
        patience_s: How long it may take to end by itself once the motion is over [s].
        loss: What its death means, as a clause.

    Attributes:
        exit_code: How it ended, known from `end` on.
    """

    exit_code: int | None = None

    def __init__(
        self,
        title: str,
        main: Callable[..., None],
        arguments: tuple[Any, ...],
        *,
        patience_s: float,
        loss: str = "its file is not closed",
    ) -> None:
        self._title = title
        self._patience_s = patience_s
        self._loss = loss
        self._process = get_context("spawn").Process(
            target=main, args=arguments, name=f"rid-daq {title}"
        )

    @property
    def sentinel(self) -> int:
        """What `multiprocessing.connection.wait` takes: ready once the process has ended."""
        return self._process.sentinel

    @property
    def is_alive(self) -> bool:
        """Whether it runs."""
        return self._process.is_alive()

    def wait(self, patience_s: float) -> bool:
        """Wait so long [s] for its end; return whether it has ended."""
        self._process.join(patience_s)
        return not self.is_alive

    def kill(self) -> None:
        """End it by force, where it was started."""
        if self._process.pid is not None:
            self._process.kill()
            self._process.join()

    def end(self) -> list[str]:
        """Wait for its end, or end it by force; one that was never started has ended.

        Returns:
            One sentence where it did not end by itself, or not well; else none.
        """
        if self._process.pid is None:
            return []
        ended = self.wait(self._patience_s)
        if not ended:
            self.kill()
        self.exit_code = self._process.exitcode
        self._process.close()
        if not ended:
            return [f"the {self._title} did not finish and was killed; {self._loss}"]
        if self.exit_code:
            return [f"the {self._title} died (exit code {self.exit_code}); {self._loss}"]
        return []

    def start(self) -> None:
        """Start it inside `start_all`, which holds termination signals back meanwhile."""
        self._process.start()


Observer = Callable[[Ring, ControlBlock], HelperProcess]
"""Makes, not starts, a process that may look at ring and control block, and ask for a stop."""


def start_all(helpers: Sequence[HelperProcess]) -> None:
    """Start all of them or none, in this order.

    Raises:
        ShortageError: The computer cannot start one more.
    """
    try:
        with signals_blocked(suspension=True):
            for helper in helpers:
                helper.start()
    except Exception as error:
        for helper in helpers:
            helper.kill()
        raise named_error(error) from error
