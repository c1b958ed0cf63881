"""Journal of a force plate's rows and events: writer, and reader for complete or damaged files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.journal.header import HeaderModel, first_header
from acquisition.journal.mcap_reader import JournalDamage, read_raw_journal
from acquisition.journal.mcap_writer import JournalFile
from acquisition.journal.row_layout import CDR_LITTLE_ENDIAN, Fields, message_text, packed_dtype
from config.arrays import BoolArray, FloatArray, IntArray
from config.cell.amplifier_profile import AmplifierProfile
from config.cell.plate import CHANNELS, PlateConfig
from config.errors import RecordingError
from drivers.interfaces.force_plate import PlateRead

ROW_TOPIC: Final = "/plate"
ROW_NAME: Final = "rid_daq/msg/Plate"
EVENT_TOPIC: Final = "/plate_event"
EVENT_NAME: Final = "rid_daq/msg/PlateEvent"

SATURATION: Final = 0.95
"Fraction of the range from which a channel counts as overloaded (docs/faults.md: row 28)."

LINE_LOST: Final = 0x100
LINE_RESTORED: Final = 0x101
"""Codes of the events that this computer adds; codes of the amplifier have one byte."""

_ROW: Fields = (
    ("arrival_s", "f8", 1, "time at which the row arrived, on the cyclic task's clock [s]"),
    ("device_s", "f8", 1, "time at which the row was measured, on the amplifier's clock [s]"),
    ("sequence", "i8", 1, "number of the row; a gap means lost rows"),
    ("force_n", "f4", CHANNELS, "forces fx12 fx34 fy14 fy23 fz1 fz2 fz3 fz4 [N]"),
    ("stream", "u4", 1, "number of the stream; the amplifier's clock restarts with each"),
    ("status", "u2", 1, "bits 0 to 7: overload of a channel; other bits: see the profile"),
    ("counts", "i2", CHANNELS, "channel values as received [counts]"),
)
_EVENT: Fields = (
    ("arrival_s", "f8", 1, "arrival time of the event, on the computer's monotonic clock [s]"),
    ("asked_s", "f8", 1, "time of the request of a mark, same clock [s]; NaN otherwise"),
    ("device_s", "f8", 1, "time of the event on the amplifier's clock [s]"),
    ("sequence", "i8", 1, "number of the row before which the event came"),
    ("stream", "u4", 1, "number of the stream, as in the rows"),
    ("kind", "u2", 1, "0 to 255: event number of the profile; 256: connection lost, 257: restored"),
    ("detail", "u2", 1, "detail of the event, as the profile defines it"),
)


class PlateHeader(HeaderModel):
    """Everything needed to read the rows, even without the run folder.

    `identity` is the amplifier's own description, escaped. `simulated_time` is true if arrival
    times are those of a simulated cell instead of the computer's.
    """

    plate: PlateConfig
    profile: AmplifierProfile
    identity: str = ""
    simulated_time: bool = False
    cell_name: str = ""
    run_id: str = ""


def find_overloads(rows: NDArray[Any], full_scale_counts: int) -> NDArray[np.bool_]:
    """Return the overloaded channels, (rows, 8), whose values are invalid.

    Args:
        rows: Shape (rows,). Rows as received from the amplifier, or as written to the journal.
        full_scale_counts: Counts of the full range.
    """
    flagged = (rows["status"][:, np.newaxis] >> np.arange(CHANNELS)) & 1 == 1
    high = np.abs(rows["counts"].astype(np.int64)) >= SATURATION * full_scale_counts
    return np.asarray(flagged | high)


ROW_DTYPE: Final = packed_dtype(_ROW)
EVENT_DTYPE: Final = packed_dtype(_EVENT)
ROW_DEFINITION: Final = message_text(_ROW)
EVENT_DEFINITION: Final = message_text(_EVENT)

PLATE_RECORDING = "plate.mcap"
ROW_CHANNEL, EVENT_CHANNEL = 1, 2


class PlateJournalWriter(JournalFile):
    """Writer of a plate's rows and events to a new file.

    Attributes:
        simulated_time: True if arrival times are those of a simulated cell.

    Raises:
        RecordingError: The file cannot be made or written.
    """

    def __init__(self, path: Path, header: PlateHeader) -> None:
        pairs = header.to_metadata()
        super().__init__(path, pairs)
        self._rows = self.add_channel(ROW_TOPIC, ROW_NAME, ROW_DEFINITION, pairs)
        self._events = self.add_channel(EVENT_TOPIC, EVENT_NAME, EVENT_DEFINITION, pairs)
        self._ticks_per_s = header.profile.ticks_per_s
        self._per_count = np.array(header.plate.amplifier.newtons_per_count)
        self._mark = header.profile.events.mark
        self.simulated_time = header.simulated_time
        self._mark_requests: dict[int, float] = {}

    def note_mark_request(self, number: int, time_s: float) -> None:
        """Record the time of a mark request; the answer has the same number."""
        self._mark_requests[number & 0xFFFF] = time_s

    def append(self, read: PlateRead, first_stream: int) -> NDArray[Any]:
        """Write the data of one read.

        Args:
            read: Rows and events of a stream.
            first_stream: Number that is added to the stream numbers in `read`.

        Returns:
            Shape (rows,). The rows as written.
        """
        rows = np.empty(len(read.rows), dtype=ROW_DTYPE)
        rows["arrival_s"] = read.arrival_s
        rows["device_s"] = read.rows["ticks"] / self._ticks_per_s
        rows["sequence"] = read.rows["sequence"]
        rows["force_n"] = read.rows["counts"] * self._per_count
        rows["stream"] = read.rows["stream"] + first_stream
        rows["status"] = read.rows["status"]
        rows["counts"] = read.rows["counts"]
        self.add_messages(self._rows, read.arrival_s, rows)
        arrivals = read.arrival_s.tolist()
        event_arrivals = read.event_arrival_s.tolist()
        if self.simulated_time:
            event_arrivals = [arrivals[-1] if arrivals else np.nan] * len(event_arrivals)
        for event, event_s in zip(read.events, event_arrivals, strict=True):
            self.note(
                kind=int(event["kind"]),
                detail=int(event["detail"]),
                arrival_s=event_s,
                device_s=int(event["ticks"]) / self._ticks_per_s,
                sequence=int(event["sequence"]),
                stream=int(event["stream"]) + first_stream,
                asked_s=self._mark_request_s(event),
            )
        return rows

    def _mark_request_s(self, event: Any) -> float:
        """Return the time of a mark request; NaN for other events, and in simulated time."""
        if int(event["kind"]) != self._mark or self.simulated_time:
            return np.nan
        return self._mark_requests.pop(int(event["detail"]), np.nan)

    def note(
        self,
        *,
        kind: int,
        detail: int,
        arrival_s: float,
        device_s: float = np.nan,
        sequence: int = -1,
        stream: int,
        asked_s: float = np.nan,
    ) -> None:
        """Write one event."""
        values = (arrival_s, asked_s, device_s, sequence, stream, kind, detail)
        event = np.array(values, dtype=EVENT_DTYPE)
        self.add_message(self._events, arrival_s, event.tobytes())

    def begin_stream(self) -> None:
        """Discard the mark requests of an earlier stream; the amplifier's numbers restart."""
        self._mark_requests.clear()


@dataclass(frozen=True, eq=False)
class PlateRows:
    """Readable content of a plate's journal.

    Attributes:
        header: Plate, amplifier, profile, provenance.
        rows: Shape (rows,). In the order received.
        events: Shape (events,). In the order received.
        damage: Missing data; rows and events are numbered together.
    """

    header: PlateHeader
    rows: NDArray[Any]
    events: NDArray[Any]
    damage: JournalDamage

    @property
    def arrival_s(self) -> FloatArray:
        """Arrival time of each row, on the cyclic task's clock [s], shape (rows,)."""
        return np.asarray(self.rows["arrival_s"])

    @property
    def device_s(self) -> FloatArray:
        """Measurement time of each row, on the amplifier's clock [s], shape (rows,)."""
        return np.asarray(self.rows["device_s"])

    @property
    def sequence(self) -> IntArray:
        """Number of each row within its stream, shape (rows,)."""
        return np.asarray(self.rows["sequence"])

    @property
    def stream(self) -> IntArray:
        """Stream of each row, shape (rows,); the amplifier's clock restarts with each stream."""
        return np.asarray(self.rows["stream"], dtype=np.int64)

    @property
    def channels_n(self) -> FloatArray:
        """Channel values [N], shape (rows, 8)."""
        per_count = np.array(self.header.plate.amplifier.newtons_per_count)
        return np.asarray(self.rows["counts"] * per_count)

    @property
    def overload(self) -> BoolArray:
        """True for channels overloaded or within 5 % of the end of their range, shape (rows, 8)."""
        return find_overloads(self.rows, self.header.plate.amplifier.full_scale_counts)

    @property
    def operating(self) -> BoolArray:
        """True while the amplifier measured, shape (rows,); false in reset."""
        bit = self.header.profile.status_bits.operate
        return np.asarray((self.rows["status"] >> bit) & 1 == 1)

    @property
    def rows_lost(self) -> int:
        """Number of rows that the amplifier sent and that are missing."""
        step = np.diff(self.sequence)
        same = np.diff(self.stream) == 0
        return int(np.sum(step[same & (step > 1)] - 1))

    def until(self, time_s: float) -> PlateRows:
        """Return the data that had arrived by a time on the cyclic task's clock [s]."""
        return replace(
            self,
            rows=self.rows[self.rows["arrival_s"] <= time_s],
            events=self.events[self.events["arrival_s"] <= time_s],
        )

    def of_kind(self, kind: str) -> NDArray[Any]:
        """Return the events of one kind of the profile: overload, overrun, trigger, mark."""
        found: NDArray[Any] = self.events[
            self.events["kind"] == getattr(self.header.profile.events, kind)
        ]
        return found


def read_plate_journal(path: Path) -> PlateRows:
    """Read a plate's journal, complete or damaged.

    Args:
        path: The `.mcap` file; it is not changed.

    Raises:
        RecordingError: The file cannot be read, or is not a plate journal of this program.
    """
    raw = read_raw_journal(path)
    header = first_header(PlateHeader, raw.headers)
    if header is None:
        raise RecordingError(
            f"{path}: contains no readable header of a force-plate recording",
            code="RID-RECORDING-EMPTY",
        )
    bodies: dict[int, list[bytes]] = {ROW_CHANNEL: [], EVENT_CHANNEL: []}
    sizes = {ROW_CHANNEL: ROW_DTYPE.itemsize, EVENT_CHANNEL: EVENT_DTYPE.itemsize}
    for channel, payload in zip(raw.channels, raw.payloads, strict=True):
        body = payload[len(CDR_LITTLE_ENDIAN) :]
        if len(body) != sizes.get(channel) or not payload.startswith(CDR_LITTLE_ENDIAN):
            raise RecordingError(
                f"{path}: channel {channel} has a message of {len(payload)} bytes: the file"
                " belongs to another program or version",
                code="RID-RECORDING-FOREIGN",
            )
        bodies[channel].append(body)
    rows = np.frombuffer(b"".join(bodies[ROW_CHANNEL]), dtype=ROW_DTYPE)
    events = np.frombuffer(b"".join(bodies[EVENT_CHANNEL]), dtype=EVENT_DTYPE)
    return PlateRows(header=header, rows=rows, events=events, damage=raw.damage)
