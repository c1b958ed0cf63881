"""`EventCache`: events of a job in the form in which they are sent; each is read only once."""

from __future__ import annotations

import functools
import threading
from pathlib import Path
from typing import Final

from rid_daq.service.workers.running_job import EventTail
from rid_daq.terminal.job_events import EVENT

MOST_JOBS: Final = 16
"""Number of jobs whose events are cached: the jobs that were requested last."""


class EventCache:
    """Events of a job by their number; for several threads.

    Args:
        path: Event file of the job.
    """

    def __init__(self, path: Path) -> None:
        self._tail = EventTail(path)
        self._events: list[bytes] = []
        self._lock = threading.Lock()

    def after(self, known: int) -> bytes:
        """Return the events after the first `known` ones, as a JSON list."""
        with self._lock:
            self._events += [EVENT.dump_json(event) for event in self._tail.read_new()]
            return b"[" + b",".join(self._events[known:]) + b"]"


@functools.lru_cache(MOST_JOBS)
def event_cache(path: Path) -> EventCache:
    """Return the cache of a job's event file."""
    return EventCache(path)
