"""`SignalView`: live signals of a cell for one viewer, as binary messages.

A message has these parts: length of the head [bytes], an unsigned 32-bit number; the head, JSON,
filled up with spaces to a multiple of 8 bytes with the length; the time of each bin, 64-bit [s
since 1970]; one row per lane with one 32-bit value per bin. All numbers are little-endian. The
first row is 1 for a bin after a gap, else 0; `SignalBins` describes the others.
"""

from __future__ import annotations

import json
import struct
import time
from typing import Final

import numpy as np

from rid_daq.service.signals.signal_bins import BIN_S, CELL_LANES, LANES, SignalBins
from rid_daq.service.signals.signal_history import SignalHistory

MOST_SENT: Final = 600
"""Largest number of bins in a message: half a minute, 140 kB for six joints."""

MOST_LATE: Final = 200
"""Largest number of new bins that wait for a viewer, ten seconds; a slower viewer loses bins."""

_LENGTH: Final = struct.Struct("<I")
_ALIGNMENT: Final = 8


class SignalView:
    """Next bins for a viewer: new bins, and in parts all older ones, the newest of them first.

    Args:
        cell: Name of the cell.
        history: Live signals of the cell.
        key: Key of the history that the viewer knows; empty for a new viewer.
        known: Number of the first bin that the viewer does not have.
    """

    def __init__(self, cell: str, history: SignalHistory, key: str = "", known: int = 0) -> None:
        self._cell = cell
        self._history = history
        is_known = key == history.key and 0 <= known <= history.count
        self._key = history.key
        self._next = self._older_end = known if is_known else history.count
        self._older = known if is_known else 0

    def next_new(self) -> bytes | None:
        """Return the message with all new bins; None if there is no new bin."""
        history = self._history
        if self._key != history.key:
            self._key = history.key
            self._next = self._older = self._older_end = 0
        lost = max(0, history.count - self._next - MOST_LATE)
        first = self._next + lost
        count = history.count - first
        self._next = history.count
        return self._message(first, count, lost) if count else None

    def next_older(self) -> bytes | None:
        """Return a message with older bins; None if the viewer has all kept bins."""
        if self._key != self._history.key:
            return None
        self._older = max(self._older, self._history.oldest)
        count = min(MOST_SENT, self._older_end - self._older)
        if count <= 0:
            return None
        self._older_end -= count
        return self._message(self._older_end, count, 0)

    def _message(self, first: int, count: int, lost: int) -> bytes:
        history = self._history
        head = {
            "type": "signals",
            "cell": self._cell,
            "key": history.key,
            "joints": history.joints,
            "cell_lanes": CELL_LANES,
            "lanes": LANES,
            "age_s": round(time.monotonic() - history.appended_s, 3),
            "bin_s": BIN_S,
            "first": first,
            "count": count,
            "lost": lost,
        }
        return encode_bins(head, history.bins(first, count))


def encode_bins(head: dict[str, object], bins: SignalBins) -> bytes:
    """Return the binary message for bins."""
    text = json.dumps(head).encode("ascii")
    text += b" " * (-(len(text) + _LENGTH.size) % _ALIGNMENT)
    rows = np.vstack((bins.after_gap[np.newaxis], bins.values.T))
    parts = (
        _LENGTH.pack(len(text)),
        text,
        bins.end_s.astype("<f8").tobytes(),
        rows.astype("<f4").tobytes(),
    )
    return b"".join(parts)
