"""`SdoServer`: a device's side of expedited and segmented SDO transfers (CiA 301, 7.2.4.3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.canopen.frames import Frame, sdo_answer_cob_id, sdo_request_cob_id
from drivers.canopen.sdo import (
    MAX_TRANSFER_BYTES,
    MULTIPLEXER,
    TOGGLE,
    SdoAbort,
    SdoCode,
    abort_frame,
    segment_data,
    segment_frame,
)

ReadObject = Callable[[int, int], bytes]
WriteObject = Callable[[int, int, bytes], None]


@dataclass
class _Transfer:
    index: int
    subindex: int
    upload: bool
    last_s: float
    data: bytearray = field(default_factory=bytearray)
    announced: int | None = None
    toggle: int = 0


class SdoServer:
    """Answers a client's requests by two callbacks; the caller provides the bus and the clock.

    Block transfers are refused with 0504 0001h, as CiA 301 requires of a server that does not
    support them.

    Args:
        node_id: The device's node id.
        read: ``read(index, subindex) -> bytes``; raises `SdoAbort` (with the code only) to refuse.
        write: ``write(index, subindex, data)``, called once a whole value has arrived; may raise
            `SdoAbort`. If a client does not state the size of an expedited value, `data` has 4
            bytes.
        timeout_s: Longest pause within a segmented transfer [s]; after a longer pause the next
            message aborts the transfer.
    """

    def __init__(
        self, node_id: int, read: ReadObject, write: WriteObject, timeout_s: float = 1.0
    ) -> None:
        self._request_cob_id = sdo_request_cob_id(node_id)
        self._answer_cob_id = sdo_answer_cob_id(node_id)
        self._read = read
        self._write = write
        self._timeout_s = timeout_s
        self._transfer: _Transfer | None = None

    def reset(self) -> None:
        """Discard the current transfer, as a device does at an NMT reset or stop."""
        self._transfer = None

    def handle(self, frame: Frame, now_s: float) -> list[Frame]:
        """Return the answers to a frame; empty if it is not a request to this server."""
        if frame.cob_id != self._request_cob_id or len(frame.data) != 8:
            return []
        command = frame.data[0]
        specifier = command >> 5
        if specifier == 4:
            self._transfer = None
            return []
        index, subindex = self._object(frame.data)
        try:
            if specifier == 1:
                return [self._initiate_download(frame.data, now_s)]
            if specifier == 2:
                return [self._initiate_upload(frame.data, now_s)]
            if specifier in (0, 3) and self._transfer is not None:
                return [self._segment(self._transfer, frame.data, now_s)]
            raise SdoAbort(SdoCode.UNKNOWN_COMMAND)
        except SdoAbort as abort:
            self._transfer = None
            return [abort_frame(self._answer_cob_id, index, subindex, abort.code)]

    def _object(self, data: bytes) -> tuple[int, int]:
        if data[0] >> 5 in (0, 3) and self._transfer is not None:
            return self._transfer.index, self._transfer.subindex
        _, index, subindex, _ = MULTIPLEXER.unpack(data)
        return index, subindex

    def _initiate_download(self, data: bytes, now_s: float) -> Frame:
        command, index, subindex, payload = MULTIPLEXER.unpack(data)
        expedited, sized = bool(command & 0x02), bool(command & 0x01)
        self._transfer = None
        if expedited:
            unused = (command >> 2 & 0x03) if sized else 0
            self._write(index, subindex, payload[: 4 - unused])
        else:
            announced = int.from_bytes(payload, "little") if sized else None
            if announced is not None and announced > MAX_TRANSFER_BYTES:
                raise SdoAbort(SdoCode.OUT_OF_MEMORY)
            self._transfer = _Transfer(index, subindex, False, now_s, announced=announced)
        return Frame(self._answer_cob_id, MULTIPLEXER.pack(0x60, index, subindex, b"\0\0\0\0"))

    def _initiate_upload(self, data: bytes, now_s: float) -> Frame:
        _, index, subindex, _ = MULTIPLEXER.unpack(data)
        self._transfer = None
        value = self._read(index, subindex)
        if 1 <= len(value) <= 4:
            command = 0x43 | (4 - len(value)) << 2
            payload = value.ljust(4, b"\0")
        else:
            command = 0x41
            payload = len(value).to_bytes(4, "little")
            self._transfer = _Transfer(index, subindex, True, now_s, data=bytearray(value))
        return Frame(self._answer_cob_id, MULTIPLEXER.pack(command, index, subindex, payload))

    def _segment(self, transfer: _Transfer, data: bytes, now_s: float) -> Frame:
        command = data[0]
        if now_s - transfer.last_s > self._timeout_s:
            raise SdoAbort(SdoCode.TIMED_OUT)
        if transfer.upload != (command >> 5 == 3):
            raise SdoAbort(SdoCode.UNKNOWN_COMMAND)
        if command & TOGGLE != transfer.toggle:
            raise SdoAbort(SdoCode.TOGGLE_NOT_ALTERNATED)
        toggle = transfer.toggle
        transfer.toggle ^= TOGGLE
        transfer.last_s = now_s
        if transfer.upload:
            chunk = bytes(transfer.data[:7])
            del transfer.data[:7]
            if not transfer.data:
                self._transfer = None
            return segment_frame(self._answer_cob_id, toggle, chunk, last=not transfer.data)
        transfer.data += segment_data(data)
        if len(transfer.data) > MAX_TRANSFER_BYTES:
            raise SdoAbort(SdoCode.OUT_OF_MEMORY)
        if command & 0x01:
            self._finish_download(transfer)
        return Frame(self._answer_cob_id, bytes((0x20 | toggle,)).ljust(8, b"\0"))

    def _finish_download(self, transfer: _Transfer) -> None:
        self._transfer = None
        if transfer.announced is not None and len(transfer.data) != transfer.announced:
            too_long = len(transfer.data) > transfer.announced
            raise SdoAbort(SdoCode.LENGTH_TOO_HIGH if too_long else SdoCode.LENGTH_TOO_LOW)
        self._write(transfer.index, transfer.subindex, bytes(transfer.data))
