"""Log of the service on standard error, and `ErrorIsolator`, which logs errors of single parts.

The log has one JSON document per line for programs, or sentences with the time of day on a
terminal. Entries about a job contain its id.
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
    """Write the log to standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_Sentences() if sys.stderr.isatty() else _Lines())
    LOG.addHandler(handler)
    LOG.setLevel(logging.INFO)
    LOG.propagate = False


class ErrorIsolator:
    """Catches and logs an error of one supervised part, so that all other parts continue.

    An error is logged once, even if every repetition of the same step raises it again.
    """

    def __init__(self) -> None:
        self._logged: dict[str, str] = {}

    @contextlib.contextmanager
    def isolate(self, what: str, otherwise: Callable[[], None] = lambda: None) -> Iterator[None]:
        """Catch and log any exception inside the `with` block.

        Args:
            what: Name of the supervised part in the log.
            otherwise: Function that is called after an exception.
        """
        try:
            yield
        except Exception as error:
            text = f"{type(error).__name__}: {error}"
            if self._logged.get(what) != text:
                self._logged[what] = text
                LOG.exception("%s: unexpected error; the service continues", what)
            otherwise()
        else:
            self._logged.pop(what, None)
