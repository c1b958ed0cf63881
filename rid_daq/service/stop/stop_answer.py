"""`StopAsked`, `Desk`: what STOP answers, and who answers it; light, for STOP's own process."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

from rid_daq.service.refusals import NotKnownError

ALL: Final = "*"
"""The name that stands for every cell of the service."""


@dataclass(frozen=True)
class StopAsked:
    """Whether something was told to stop; and what to do where nothing was."""

    told: bool
    sentence: str

    def document(self) -> dict[str, object]:
        """Return it as JSON has it."""
        return {"told": self.told, "sentence": self.sentence}


def unknown_stopper() -> NotKnownError:
    """Return the error for who may not stop: on another computer, without a token."""
    return NotKnownError(
        "show a token to stop from another computer; or press the stop there",
        code="RID-STOP-UNKNOWN",
    )


class Desk(Protocol):
    """Takes requests to stop."""

    def admit(self, headers: Mapping[str, str], *, local: bool, address: str) -> str:
        """Return who asks.

        Raises:
            NotKnownError: They ask from another computer and show no secret that was ever issued.
        """
        ...

    def stop(self, target: str, who: str) -> StopAsked:
        """Stop a cell, or all of them (`ALL`).

        Raises:
            UnknownError: There is no such cell.
        """
        ...


def stop_each(
    cells: Iterable[str], stop: Callable[[str], bool], wrong: Callable[[str], None]
) -> StopAsked:
    """Stop cells; what goes wrong with one keeps no other from its stop.

    Args:
        cells: Their names.
        stop: Stops one; returns whether something was told to stop.
        wrong: Told of a cell whose stop went wrong, while the exception is handled.
    """
    told, failed = False, []
    for name in cells:
        try:
            told = stop(name) or told
        except Exception:
            wrong(name)
            failed.append(name)
    if failed:
        sentence = f"Cell {', '.join(failed)} could not be told to stop: use the emergency stop."
    elif told:
        sentence = "Stop asked for: watch that the axes come to rest."
    else:
        sentence = "Nothing moves here by this service."
    return StopAsked(told, sentence)
