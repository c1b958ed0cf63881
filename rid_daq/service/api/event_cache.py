"""`EventCache`: keeps a job's events as JSON, so that each event is read from its file once."""

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
    """Events of a job in their order; several threads may use it.

    Args:
        path: Event file of the job.
    """

    def __init__(self, path: Path) -> None:
        self._tail = EventTail(path)
        self._events: list[bytes] = []
        self._lock = threading.Lock()

    def after(self, known: int) -> bytes:
        """Return all events except the first `known` events, as a JSON list."""
        with self._lock:
            self._events += [EVENT.dump_json(event) for event in self._tail.read_new()]
            return b"[" + b",".join(self._events[known:]) + b"]"


@functools.lru_cache(MOST_JOBS)
def event_cache(path: Path) -> EventCache:
    """Return the cache of a job's event file."""
    return EventCache(path)
