"""`SimulatedRegisters`: Modbus protocol of simulated drives: requests as bytes, answers as bytes.

It was written from the specifications only (Modbus application protocol 1.1b3; Modbus over serial
line 1.02; Modbus messaging on TCP/IP 1.0b), without pymodbus, which the driver uses. Tests of the
driver with it therefore check both implementations.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence

from config.simulation.faults import RegisterFault

READ_HOLDING, READ_INPUT, WRITE_ONE, WRITE_MANY = 3, 4, 6, 16
NO_FUNCTION, NO_REGISTER, BAD_COUNT = 1, 2, 3
GATEWAY_NO_ANSWER = 11
MOST_READ, MOST_WRITTEN = 125, 123
LONGEST_FRAME = 260

Registers = Callable[[int], Mapping[int, int] | None]


class SimulatedRegisters:
    """Answers Modbus requests to the simulated drives; their registers are read-only.

    Args:
        registers: Function that returns a unit's registers by address; None if there is no such
            unit.
        faults: Faults, with the numbers of the requests at which they occur.

    Attributes:
        requests: Number of complete requests so far.
        held: Late answers, which are sent before the answer to the next request.
    """

    def __init__(self, registers: Registers, faults: Sequence[RegisterFault] = ()) -> None:
        self._registers = registers
        self._faults = {fault.at_request: fault for fault in faults}
        self.requests = 0
        self.held: list[bytes] = []

    def take_tcp(self, buffer: bytearray) -> list[bytes]:
        """Remove the complete frames from the buffer of a TCP connection; return the answers.

        Raises:
            ValueError: The bytes are not Modbus; the connection must be closed.
        """
        answers: list[bytes] = []
        while len(buffer) >= 7:
            transaction, protocol, length, unit = struct.unpack_from(">HHHB", buffer)
            if protocol != 0 or not 2 <= length <= LONGEST_FRAME - 6:
                raise ValueError("not a Modbus frame")
            if len(buffer) < 6 + length:
                break
            request = bytes(buffer[7 : 6 + length])
            del buffer[: 6 + length]

            def frame(pdu: bytes, unit: int, transaction: int = transaction) -> bytes:
                return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu

            answers += self._respond(unit, request, frame, gateway=True)
        return answers

    def take_rtu(self, buffer: bytearray) -> list[bytes]:
        """Remove the complete frames from the buffer of a serial line; return the answers.

        A byte at which no frame with a correct checksum begins is discarded.
        """
        answers: list[bytes] = []
        while len(buffer) >= 4:
            size = _request_bytes(buffer)
            if size is None or (len(buffer) >= size and crc16(bytes(buffer[:size]))):
                del buffer[0]
                continue
            if len(buffer) < size:
                break
            unit, request = buffer[0], bytes(buffer[1 : size - 2])
            del buffer[:size]

            def frame(pdu: bytes, unit: int) -> bytes:
                body = bytes((unit,)) + pdu
                return body + struct.pack("<H", crc16(body))

            answers += self._respond(unit, request, frame, gateway=False)
        return answers

    def _respond(
        self, unit: int, request: bytes, frame: Callable[[bytes, int], bytes], *, gateway: bool
    ) -> list[bytes]:
        """Return the frames that answer a request; before them, a delayed earlier answer."""
        fault = self._faults.get(self.requests, self._faults.get(None))
        kind = None if fault is None else fault.kind
        self.requests += 1
        holds = self._registers(unit)
        if holds is None:  # unknown unit: only a gateway answers
            if not gateway:
                return []
            return [frame(bytes((request[0] | 0x80, GATEWAY_NO_ANSWER)), unit)]
        pdu = answer_request(request, holds)
        if fault is not None and kind == "exception":
            pdu = bytes((request[0] | 0x80, fault.code))
        elif kind == "short" and len(pdu) > 4:
            pdu = bytes((pdu[0], pdu[1] - 2)) + pdu[2:-2]
        whole = frame(pdu, unit % 247 + 1 if kind == "wrong_unit" else unit)
        if kind == "silent":
            return []
        if kind == "late":
            self.held.append(whole)
            return []
        late, self.held = self.held, []
        if kind == "garbage":
            return [*late, bytes(byte ^ 0x5A for byte in whole)]
        return [*late, whole]


def answer_request(request: bytes, registers: Mapping[int, int]) -> bytes:
    """Return the answer to a request (function code and data; Modbus 6.3, 6.4, 6.6, 6.12)."""
    function = request[0]
    if function in (READ_HOLDING, READ_INPUT):
        if len(request) != 5:
            return bytes((function | 0x80, BAD_COUNT))
        address, count = struct.unpack(">HH", request[1:])
        if not 1 <= count <= MOST_READ:
            return bytes((function | 0x80, BAD_COUNT))
        wanted = range(address, address + count)
        if not {wanted[0], wanted[-1]} <= registers.keys():
            return bytes((function | 0x80, NO_REGISTER))
        words: Sequence[int] = [registers.get(place, 0) for place in wanted]
        return struct.pack(f">BB{count}H", function, 2 * count, *words)
    if function in (WRITE_ONE, WRITE_MANY):
        return bytes((function | 0x80, NO_REGISTER))
    return bytes((function | 0x80, NO_FUNCTION))


def crc16(data: bytes) -> int:
    """Return the CRC of bytes on a serial line; it is 0 for a frame with a correct CRC (6.2.2)."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc


def _request_bytes(buffer: bytearray) -> int | None:
    """Return the length of the request at the start of a buffer; None if it is not a request."""
    function = buffer[1]
    if function in (READ_HOLDING, READ_INPUT, WRITE_ONE):
        return 8
    if function == WRITE_MANY:
        if len(buffer) < 7:
            return 9
        size = buffer[6]
        return 9 + size if size <= 2 * MOST_WRITTEN else None
    return None if function & 0x80 or function == 0 else 4
