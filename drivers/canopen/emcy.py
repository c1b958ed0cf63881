"""Emergency messages (CiA 301, 7.2.7) and their error codes in words."""

from __future__ import annotations

import struct
from typing import NamedTuple

from drivers.canopen.frames import Frame, emcy_cob_id

_EMCY = struct.Struct("<HB5s")

_CODES = {
    0x0000: "error reset, no error",
    0x2310: "continuous over-current",
    0x2320: "short circuit",
    0x2350: "I2t overload",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x4210: "device over-temperature",
    0x4310: "drive over-temperature",
    0x5112: "supply voltage low",
    0x5113: "supply voltage low",
    0x6010: "internal watchdog",
    0x6320: "parameter error",
    0x7121: "motor blocked",
    0x7305: "encoder error",
    0x8100: "communication error",
    0x8110: "CAN overrun",
    0x8120: "CAN error passive",
    0x8130: "heartbeat of the master lost",
    0x8140: "recovered from bus-off",
    0x8210: "PDO not processed: length error",
    0x8220: "PDO length exceeded",
    0x8250: "RPDO timeout",
    0x8400: "velocity error",
    0x8611: "following error",
    0x8700: "synchronisation error",
}

_CLASSES = {
    0x10: "generic error",
    0x20: "current error",
    0x21: "current error at the input",
    0x22: "current error inside",
    0x23: "current error at the output",
    0x30: "voltage error",
    0x31: "mains voltage error",
    0x32: "DC link voltage error",
    0x33: "output voltage error",
    0x40: "temperature error",
    0x41: "ambient temperature error",
    0x42: "device temperature error",
    0x43: "drive temperature error",
    0x50: "hardware error",
    0x60: "software error",
    0x70: "additional modules error",
    0x71: "motor error",
    0x73: "sensor error",
    0x80: "monitoring error",
    0x81: "communication error",
    0x82: "protocol error",
    0x90: "external error",
    0xFF: "manufacturer's error",
}


class Emergency(NamedTuple):
    """Emergency message: error code, error register 1001h, five manufacturer-specific bytes."""

    code: int
    register: int
    vendor: bytes = bytes(5)

    def __str__(self) -> str:
        """Return the message in words; the manufacturer's bytes are shown in hexadecimal."""
        extra = f", vendor bytes {self.vendor.hex()}" if any(self.vendor) else ""
        return f"{code_text(self.code)} (EMCY {self.code:04X}h, 1001h={self.register:02X}h{extra})"


def code_text(code: int) -> str:
    """Return an error code in words; for an unlisted code, the description of its class."""
    known = _CODES.get(code) or _CLASSES.get(code >> 8) or _CLASSES.get(code >> 12 << 4)
    return known or "unknown error"


def emcy_frame(node_id: int, emergency: Emergency) -> Frame:
    """Return the emergency message of a node."""
    return Frame(emcy_cob_id(node_id), _EMCY.pack(*emergency))


def parse_emcy(data: bytes) -> Emergency:
    """Return the content of an emergency message; the missing bytes of a short message are zero."""
    return Emergency(*_EMCY.unpack(bytes(data[:8]).ljust(8, b"\0")))
