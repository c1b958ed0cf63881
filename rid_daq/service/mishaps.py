"""`Mishaps`: what goes wrong with one thing that the service watches does not end the others."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

from rid_daq.service.logs import LOG


class Mishaps:
    """Logs what goes wrong: once, however often it is tried again with the same end."""

    def __init__(self) -> None:
        self._told: dict[str, str] = {}

    @contextlib.contextmanager
    def of(self, what: str, otherwise: Callable[[], None] = lambda: None) -> Iterator[None]:
        """Keep an exception inside the `with`, also one that nobody has thought of.

        Parameters
        ----------
        what : str
            What is watched, in the words of the log.
        otherwise : callable
            What is done where it went wrong.
        """
        try:
            yield
        except Exception as error:
            told = f"{type(error).__name__}: {error}"
            if self._told.get(what) != told:
                self._told[what] = told
                LOG.exception("%s: something went wrong; the service goes on", what)
            otherwise()
        else:
            self._told.pop(what, None)
