"""`SdoClient`: the master's side of expedited and segmented SDO transfers (CiA 301, 7.2.4.3)."""

from __future__ import annotations

from config.errors import DeviceTimeoutError, DriverError
from drivers.canopen.frames import Frame, sdo_answer_cob_id, sdo_request_cob_id
from drivers.canopen.sdo import (
    ABORT,
    MAX_TRANSFER_BYTES,
    MULTIPLEXER,
    TOGGLE,
    SdoAbort,
    SdoCode,
    abort_frame,
    object_name,
    segment_data,
    segment_frame,
)


class SdoClient:
    """SDO transfers with one node, one at a time; the caller provides the bus and the clock.

    Send the frame that `upload` or `download` returns. Pass every received frame to `handle` and
    send the frame that it returns. Call `check` after `deadline_s`, and call `result` when `done`
    is True.

    An answer about another object is ignored: it is a late answer in an abandoned transfer.

    Attributes:
        done: True if no transfer is running: before the first one, and after each end or abort.
        deadline_s: Time until which the next answer must arrive [s].
    """

    def __init__(self, node_id: int, timeout_s: float = 0.5) -> None:
        self._node_id = node_id
        self._request_cob_id = sdo_request_cob_id(node_id)
        self._answer_cob_id = sdo_answer_cob_id(node_id)
        self._timeout_s = timeout_s
        self.done = True
        self.deadline_s = 0.0
        self._index = 0
        self._subindex = 0
        self._upload = True
        self._initiating = False
        self._toggle = 0
        self._data = bytearray()
        self._sent = 0
        self._announced: int | None = None
        self._error: DriverError | None = None

    def upload(self, index: int, subindex: int, now_s: float) -> Frame:
        """Begin to read an object; return the request."""
        self._begin(index, subindex, b"", now_s, upload=True)
        return Frame(self._request_cob_id, MULTIPLEXER.pack(0x40, index, subindex, bytes(4)))

    def download(self, index: int, subindex: int, data: bytes, now_s: float) -> Frame:
        """Begin to write an object; return the request, expedited for 1 to 4 bytes."""
        self._begin(index, subindex, data, now_s, upload=False)
        if 1 <= len(data) <= 4:
            command, payload = 0x23 | (4 - len(data)) << 2, data.ljust(4, b"\0")
            self._sent = len(data)
        else:
            command, payload = 0x21, len(data).to_bytes(4, "little")
        return Frame(self._request_cob_id, MULTIPLEXER.pack(command, index, subindex, payload))

    def handle(self, frame: Frame, now_s: float) -> Frame | None:
        """Process a received frame; return the next frame to send, or None."""
        if self.done or frame.cob_id != self._answer_cob_id or len(frame.data) != 8:
            return None
        if self._initiating and not self._concerns_this_object(frame.data):
            return None
        self.deadline_s = now_s + self._timeout_s
        specifier = frame.data[0] >> 5
        if specifier == 4:
            _, _, _, code = ABORT.unpack(frame.data)
            self._end(self._abort(code))
            return None
        if self._initiating:
            if specifier != (2 if self._upload else 3):
                return self._refuse(SdoCode.UNKNOWN_COMMAND)
            self._initiating = False
            return self._initiate_answered(frame.data)
        if specifier != (0 if self._upload else 1):
            return self._refuse(SdoCode.UNKNOWN_COMMAND)
        if frame.data[0] & TOGGLE != self._toggle:
            return self._refuse(SdoCode.TOGGLE_NOT_ALTERNATED)
        self._toggle ^= TOGGLE
        if self._upload:
            return self._segment_arrived(frame.data)
        return self._next_segment()

    def check(self, now_s: float) -> Frame | None:
        """Abort the transfer if its deadline has passed; return the abort message, or else None."""
        if self.done or now_s < self.deadline_s:
            return None
        self._end(
            DeviceTimeoutError(
                f"node {self._node_id} did not answer within {self._timeout_s:g} s to the"
                f" {self._verb} of {object_name(self._index, self._subindex)}; check its power,"
                " node id and bit rate",
                code="RID-DRIVE-SILENT",
            )
        )
        return self._abort_frame(SdoCode.TIMED_OUT)

    def result(self) -> bytes:
        """Return the value that was read (empty for a write).

        Raises:
            SdoAbort: Either end aborted the transfer.
            DeviceTimeoutError: The node did not answer in time.
        """
        if self._error is not None:
            raise self._error
        return bytes(self._data) if self._upload else b""

    @property
    def _verb(self) -> str:
        return "read" if self._upload else "write"

    def _begin(self, index: int, subindex: int, data: bytes, now_s: float, *, upload: bool) -> None:
        self.done = False
        self.deadline_s = now_s + self._timeout_s
        self._index, self._subindex = index, subindex
        self._upload = upload
        self._initiating = True
        self._toggle = 0
        self._data = bytearray(data)
        self._sent = 0
        self._announced = None
        self._error = None

    def _concerns_this_object(self, data: bytes) -> bool:
        specifier = data[0] >> 5
        _, index, subindex, _ = MULTIPLEXER.unpack(data)
        return specifier in (2, 3, 4) and (index, subindex) == (self._index, self._subindex)

    def _initiate_answered(self, data: bytes) -> Frame | None:
        command, _, _, payload = MULTIPLEXER.unpack(data)
        if not self._upload:
            return self._next_segment()
        sized = bool(command & 0x01)
        if command & 0x02:
            self._data += payload[: 4 - (command >> 2 & 0x03)] if sized else payload
            self._end()
            return None
        self._announced = int.from_bytes(payload, "little") if sized else None
        if self._announced is not None and self._announced > MAX_TRANSFER_BYTES:
            return self._refuse(SdoCode.OUT_OF_MEMORY)
        return Frame(self._request_cob_id, bytes((0x60,)).ljust(8, b"\0"))

    def _segment_arrived(self, data: bytes) -> Frame | None:
        self._data += segment_data(data)
        if len(self._data) > MAX_TRANSFER_BYTES:
            return self._refuse(SdoCode.OUT_OF_MEMORY)
        if not data[0] & 0x01:
            return Frame(self._request_cob_id, bytes((0x60 | self._toggle,)).ljust(8, b"\0"))
        if self._announced is not None and len(self._data) != self._announced:
            return self._refuse(SdoCode.LENGTH_MISMATCH)
        self._end()
        return None

    def _next_segment(self) -> Frame | None:
        """Return the next segment; end the transfer after the answer to the last segment."""
        first = self._sent == 0
        if self._sent >= len(self._data) and not (first and not self._data):
            self._end()
            return None
        chunk = bytes(self._data[self._sent : self._sent + 7])
        self._sent += max(len(chunk), 1)
        last = self._sent >= len(self._data)
        return segment_frame(self._request_cob_id, self._toggle, chunk, last)

    def _end(self, error: DriverError | None = None) -> None:
        self.done = True
        self._error = error

    def _abort(self, code: int) -> SdoAbort:
        return SdoAbort(code, self._index, self._subindex, f"node {self._node_id}, {self._verb}")

    def _abort_frame(self, code: SdoCode) -> Frame:
        return abort_frame(self._request_cob_id, self._index, self._subindex, code)

    def _refuse(self, code: SdoCode) -> Frame:
        self._end(self._abort(code))
        return self._abort_frame(code)
