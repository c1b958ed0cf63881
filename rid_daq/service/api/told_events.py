"""`ToldEvents`: what a job has said, as it is sent: no event is read twice, whoever asks."""

from __future__ import annotations

import functools
import threading
from pathlib import Path
from typing import Final

from rid_daq.service.running_job import EventTail
from rid_daq.terminal.job_events import EVENT

MOST_JOBS: Final = 16
"""Jobs whose events are kept: those that were asked for last."""


class ToldEvents:
    """The events of a job, each by its number; for several threads.

    Args:
        path: The file of the events.
    """

    def __init__(self, path: Path) -> None:
        self._tail = EventTail(path)
        self._told: list[bytes] = []
        self._one_reads = threading.Lock()

    def after(self, known: int) -> bytes:
        """Return the events behind the first `known` ones, as a list of JSON."""
        with self._one_reads:
            self._told += [EVENT.dump_json(event) for event in self._tail.new()]
            return b"[" + b",".join(self._told[known:]) + b"]"


@functools.lru_cache(MOST_JOBS)
def told_events(path: Path) -> ToldEvents:
    """Return what the job of a file has said."""
    return ToldEvents(path)
