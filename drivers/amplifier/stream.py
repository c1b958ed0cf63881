"""`AmplifierStream`: conversion of a charge amplifier's bytes to rows and events.

Bytes come in pieces of any size. A frame is accepted at any position if its first bytes, its size
and its checksum are correct. Bytes between frames are skipped and counted. At most one frame's
bytes are buffered. Damaged bytes therefore cost only the rows that they are part of, and no memory.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.cell.amplifier_profile import AmplifierProfile
from drivers.amplifier.frames import PLATE_EVENT, PLATE_ROW, event_layout, row_layout

LONGEST_SILENCE_S: Final = 60.0

_SEQUENCES = 1 << 16
_TICKS = 1 << 32
_SEPARATORS = b"\r\n"


@dataclass(frozen=True, eq=False)
class StreamPiece:
    """Rows and events of one piece of the stream.

    Attributes:
        rows: Shape (rows,). In the order sent.
        events: Shape (events,). In the order sent.
        row_ends, event_ends: Shape (rows,) and (events,). Number of bytes from the beginning of the
            stream to the end of each row or event, by which a caller finds the received piece that
            completed it.
    """

    rows: NDArray[Any]
    events: NDArray[Any]
    row_ends: NDArray[np.int64]
    event_ends: NDArray[np.int64]


@dataclass
class StreamCounts:
    """Counts of a stream so far.

    Attributes:
        rows, events: Accepted frames.
        gaps, rows_lost: Number of gaps in the sequence numbers, and of the rows that are missing in
            them.
        bad_frames: Frames with a valid start but a wrong checksum.
        garbage_bytes: Bytes outside frames.
        repeated_rows: Rows that were ignored because they had the sequence number of the row
            before.
    """

    rows: int = 0
    events: int = 0
    gaps: int = 0
    rows_lost: int = 0
    bad_frames: int = 0
    garbage_bytes: int = 0
    repeated_rows: int = 0


class _Frames(NamedTuple):
    """Complete frames, and the position in the buffer at which each frame ends."""

    frames: list[bytes]
    ends: list[int]


class AmplifierStream:
    """Incremental parser of the stream; call `feed` with the bytes as they arrive.

    Args:
        profile: The rows' layout.
        form: ``ascii`` or ``binary``.
        rate_hz: Approximate rows per second, to estimate the rows lost in a long silence.

    Attributes:
        counts: Counts so far.
        stopped: True if the amplifier has announced the end of the stream.
        rest: Bytes after the end of the stream; they are text lines, not frames.
        received_bytes: Number of bytes that `feed` has received so far.
    """

    def __init__(self, profile: AmplifierProfile, form: str, rate_hz: float) -> None:
        self.counts = StreamCounts()
        self.stopped = False
        self.rest = b""
        self.received_bytes = 0
        self._row = row_layout(profile, form)
        self._event = event_layout(profile, form)
        starts = (self._row.start, self._event.start)
        self._start = re.compile(b"|".join(re.escape(start) for start in starts))
        self._prefixes = {start[:n] for start in starts for n in range(1, len(start))}
        self._stop_kind = profile.events.stopped
        self._rows_per_tick = rate_hz / profile.ticks_per_s
        self._silence_ticks = int(LONGEST_SILENCE_S * profile.ticks_per_s)
        self._tail = b""
        self._stream = 0
        self._sequence: int | None = None
        self._ticks: int | None = None
        self._event_ticks: int | None = None

    @property
    def buffered_bytes(self) -> int:
        """Number of buffered bytes of a frame that has not arrived completely."""
        return len(self._tail)

    def feed(self, data: bytes) -> StreamPiece:
        """Process the next piece of the stream; return the rows and events that it completes."""
        if self.stopped:
            self.rest += data
            return self._block(_Frames([], []), _Frames([], []), 0)
        buffer = self._tail + data
        first = self.received_bytes - len(self._tail)
        self.received_bytes += len(data)
        rows, events, position = self._frames(buffer)
        self._keep(buffer[position:])
        return self._block(rows, events, first)

    def _block(self, row_frames: _Frames, event_frames: _Frames, first: int) -> StreamPiece:
        rows, row_ends = np.empty(0, dtype=PLATE_ROW), np.empty(0, dtype=np.int64)
        if row_frames.frames:
            rows, kept = self._take_rows(row_frames.frames)
            row_ends = first + np.array(row_frames.ends)[kept]
        events, event_ends = np.empty(0, dtype=PLATE_EVENT), np.empty(0, dtype=np.int64)
        if event_frames.frames:
            events, kept = self._take_events(event_frames.frames)
            event_ends = first + np.array(event_frames.ends)[kept]
        self.counts.rows += len(rows)
        self.counts.events += len(events)
        return StreamPiece(rows, events, row_ends, event_ends)

    def _keep(self, unused: bytes) -> None:
        self._tail, self.rest = (b"", unused) if self.stopped else (unused, b"")

    def _frames(self, buffer: bytes) -> tuple[_Frames, _Frames, int]:
        """Find complete frames; return rows, events, and the position of the first unused byte."""
        rows, events = _Frames([], []), _Frames([], [])
        row, event = self._row, self._event
        row_start, row_size, row_is_whole = row.start, row.size, row.is_whole
        terminator, terminator_size = row.terminator, len(row.terminator)
        position, size = 0, len(buffer)
        while True:
            if buffer.startswith(row_start, position):
                end = position + row_size
                if end > size:
                    return rows, events, position
                if row_is_whole(buffer, position):
                    rows.frames.append(buffer[position:end])
                    rows.ends.append(end)
                    position = end
                    if terminator_size and buffer.startswith(terminator, end):
                        position += terminator_size
                    continue
                self.counts.bad_frames += 1
            elif buffer.startswith(event.start, position):
                end = position + event.size
                if end > size:
                    return rows, events, position
                if event.is_whole(buffer, position):
                    frame = buffer[position:end]
                    events.frames.append(frame)
                    events.ends.append(end)
                    position = end
                    if self._stops(frame):
                        self.stopped = True
                        return rows, events, position
                    continue
                self.counts.bad_frames += 1
            elif position == size:
                return rows, events, position
            found = self._start.search(buffer, position + 1)
            following = found.start() if found is not None else self._beginning(buffer, position)
            self._skip(buffer, position, following)
            position = following
            if found is None:
                return rows, events, position

    def _stops(self, frame: bytes) -> bool:
        fields, good = self._event.decode(frame)
        return bool(good[0]) and int(fields["kind"][0]) == self._stop_kind

    def _beginning(self, buffer: bytes, position: int) -> int:
        """Return the position at which an incomplete frame may begin at the end of `buffer`."""
        for length in range(max(map(len, self._prefixes), default=0), 0, -1):
            at = len(buffer) - length
            if at >= position and buffer[at:] in self._prefixes:
                return at
        return len(buffer)

    def _skip(self, buffer: bytes, start: int, end: int) -> None:
        skipped = buffer[start:end]
        if self._row.terminator:
            skipped = skipped.translate(None, _SEPARATORS)
        self.counts.garbage_bytes += len(skipped)

    def _take_rows(self, frames: list[bytes]) -> tuple[NDArray[Any], NDArray[np.int64]]:
        fields, good = self._row.decode(b"".join(frames))
        self.counts.bad_frames += int(np.count_nonzero(~good))
        kept = np.flatnonzero(good)
        rows = np.empty(len(kept), dtype=PLATE_ROW)
        if not len(rows):
            return rows, kept
        rows["status"] = fields["status"][good]
        rows["counts"] = fields["counts"][good]
        sequence, ticks = fields["sequence"][good], fields["time"][good]
        if self._sequence is None or self._ticks is None:
            self._sequence = int(sequence[0]) - 1
            self._ticks = self._continue_event_ticks(int(ticks[0]))
        step = np.diff(sequence, prepend=self._sequence) % _SEQUENCES
        elapsed = np.diff(ticks, prepend=self._ticks) % _TICKS
        missed = np.rint((elapsed * self._rows_per_tick - step) / _SEQUENCES)
        step += _SEQUENCES * np.maximum(missed, 0.0).astype(np.int64)
        breaks = np.flatnonzero(elapsed > self._silence_ticks)
        step[breaks] = 1
        rows["sequence"] = self._sequence + np.cumsum(step)
        rows["ticks"] = self._ticks + np.cumsum(elapsed)
        rows["stream"] = self._stream
        for at in breaks.tolist():
            self._stream += 1
            rows["stream"][at:] = self._stream
            rows["sequence"][at:] += int(sequence[at]) - int(rows["sequence"][at])
            rows["ticks"][at:] += int(ticks[at]) - int(rows["ticks"][at])
        self._sequence, self._ticks = int(rows["sequence"][-1]), int(rows["ticks"][-1])
        repeated = step == 0
        self.counts.gaps += int(np.count_nonzero(step > 1))
        self.counts.rows_lost += int(np.sum(step[step > 1] - 1))
        if repeated.any():
            self.counts.repeated_rows += int(np.count_nonzero(repeated))
            rows, kept = rows[~repeated], kept[~repeated]
        return rows, kept

    def _continue_event_ticks(self, ticks: int) -> int:
        """Return the first row's time, corrected for overflows since earlier events."""
        if self._event_ticks is None:
            return ticks
        return self._event_ticks + int(_nearest(np.array(ticks - self._event_ticks), _TICKS))

    def _take_events(self, frames: list[bytes]) -> tuple[NDArray[Any], NDArray[np.int64]]:
        fields, good = self._event.decode(b"".join(frames))
        self.counts.bad_frames += int(np.count_nonzero(~good))
        kept = np.flatnonzero(good)
        events = np.empty(len(kept), dtype=PLATE_EVENT)
        if not len(events):
            return events, kept
        sequence, ticks = fields["sequence"][good], fields["time"][good]
        row = int(sequence[0]) if self._sequence is None else self._sequence
        now = self._ticks
        if now is None:
            now = int(ticks[0]) if self._event_ticks is None else self._event_ticks
        events["sequence"] = row + _nearest(sequence - row, _SEQUENCES)
        events["ticks"] = now + _nearest(ticks - now, _TICKS)
        self._event_ticks = int(events["ticks"][-1])
        events["stream"] = self._stream
        events["kind"] = fields["kind"][good]
        events["detail"] = fields["detail"][good]
        return events, kept


def _nearest(differences: NDArray[np.int64], modulus: int) -> NDArray[np.int64]:
    """Return differences of overflowing counters, reduced to plus or minus half the modulus."""
    return (differences + modulus // 2) % modulus - modulus // 2
