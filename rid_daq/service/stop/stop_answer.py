"""`StopAnswer`, `StopHandler`: answer to a STOP request, and interface of its handler.

The front process imports this module, so it imports little.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

from rid_daq.service.refusals import NotKnownError

ALL: Final = "*"
"""Name that means every cell of the service."""


@dataclass(frozen=True)
class StopAnswer:
    """Answer to a STOP request.

    Attributes:
        sent: True if a stop request was sent to at least one job.
        sentence: Result for the user, with the next step.
    """

    sent: bool
    sentence: str

    def document(self) -> dict[str, object]:
        """Return the answer as a JSON document."""
        return {"sent": self.sent, "sentence": self.sentence}


def unknown_sender_error() -> NotKnownError:
    """Return the error for a STOP from another computer without a token."""
    return NotKnownError(
        "stopping from another computer needs a token: send one, or press the stop at this"
        " computer",
        code="RID-STOP-UNKNOWN",
    )


class StopHandler(Protocol):
    """Executes STOP requests."""

    def identify_sender(self, headers: Mapping[str, str], *, local: bool, address: str) -> str:
        """Return the sender of a request.

        Raises:
            NotKnownError: The sender is on another computer, and the request contains no secret
                that was ever issued.
        """
        ...

    def stop(self, target: str, who: str) -> StopAnswer:
        """Stop a cell, or all cells (`ALL`).

        Raises:
            UnknownError: The service has no such cell.
        """
        ...


def stop_each(
    cells: Collection[str], stop: Callable[[str], bool], wrong: Callable[[str], None]
) -> StopAnswer:
    """Stop cells. An error of one cell does not prevent the stop of the others.

    Args:
        cells: Names of the cells.
        stop: Function that stops one cell; it returns True if a job received the stop.
        wrong: Function that is called with the name of a cell whose stop failed, inside the
            exception handler.
    """
    sent, failed = False, []
    for name in cells:
        try:
            sent = stop(name) or sent
        except Exception:
            wrong(name)
            failed.append(name)
    if failed:
        sentence = f"Cell {', '.join(failed)} could not be stopped: use the emergency stop."
    elif sent:
        sentence = "Stop requested: check that the axes come to rest."
    else:
        sentence = f"This service moves nothing in cell {', '.join(cells)} now."
    return StopAnswer(sent, sentence)
