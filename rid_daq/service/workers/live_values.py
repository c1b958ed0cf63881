"""`LiveValues`: publishes the values of running motions to viewers, and keeps the live signals."""

from __future__ import annotations

import json
from collections.abc import Iterable

from rid_daq.service.logs import ErrorIsolator
from rid_daq.service.signals.signal_history import SignalHistory
from rid_daq.service.workers.running_job import RunningJob
from rid_daq.web.feed import Feed


class LiveValues:
    """Values of the cells' motions; a failure to read them does not affect a motion.

    Args:
        feed: Sends pictures and events to all viewers.
        cells: Names of the cells.

    Attributes:
        signals: Live signals of the last minutes, by cell.
    """

    def __init__(self, feed: Feed, cells: Iterable[str]) -> None:
        self.signals = {name: SignalHistory() for name in cells}
        self.feed = feed
        self._errors = ErrorIsolator()

    def update(self, running: RunningJob) -> None:
        """Read the new values of a job's motion; publish a picture if there are viewers."""
        cell = running.job.cell
        with self._errors.isolate(f"live signals of cell {cell}"):
            for joints, bins in running.read_signals():
                self.signals[cell].append(joints, bins)
        picture = running.newest_picture() if self.feed.viewers else None
        if picture is not None:
            head = {"type": "samples", "cell": cell, "job": running.job.id}
            self.feed.publish_picture(json.dumps({**head, "picture": picture}).encode(), cell)
