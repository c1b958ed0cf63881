"""The service's log on standard error, with the job's id where one is; and its `Mishaps`.

One JSON document a line for programs, a sentence with the time of day for a person at a terminal.
"""

from __future__ import annotations

import contextlib
import json
import logging
import sys
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import Final

from rid_daq.service.records import Job
from rid_daq.terminal.console import make_printable

LOG: Final = logging.getLogger("rid_daq.service")


class _Lines(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "message": record.getMessage(),
        }
        job = getattr(record, "job", None)
        if isinstance(job, Job):
            line |= {"job": job.id, "cell": job.cell, "kind": job.kind.value, "owner": job.owner}
            line |= {"state": job.state.value}
        if record.exc_info:
            line["error"] = self.formatException(record.exc_info)
        return json.dumps(line)


class _Sentences(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        words = record.getMessage()
        job = getattr(record, "job", None)
        if isinstance(job, Job):
            words += (
                f": {job.kind.value} on {job.cell} by {job.owner}, {job.state.value} ({job.id})"
            )
        if record.levelno >= logging.WARNING:
            words = f"{record.levelname.lower()}: {words}"
        line = f"{datetime.fromtimestamp(record.created):%H:%M:%S}  {make_printable(words)}"
        if record.exc_info:
            line += f"\n{make_printable(self.formatException(record.exc_info))}"
        return line


def log_to_stderr() -> None:
    """Have the log written to standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_Sentences() if sys.stderr.isatty() else _Lines())
    LOG.addHandler(handler)
    LOG.setLevel(logging.INFO)
    LOG.propagate = False


class Mishaps:
    """Keeps what goes wrong with one thing that is watched from ending the others.

    It is logged, once, however often it is tried again with the same end.
    """

    def __init__(self) -> None:
        self._told: dict[str, str] = {}

    @contextlib.contextmanager
    def of(self, what: str, otherwise: Callable[[], None] = lambda: None) -> Iterator[None]:
        """Keep an exception inside the `with`, also one that nobody has thought of.

        Args:
            what: What is watched, in the words of the log.
            otherwise: What is done where it went wrong.
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
