"""Parts that SDO client and server share: commands, abort codes, `SdoAbort` (CiA 301, 7.2.4)."""

from __future__ import annotations

import struct
from enum import IntEnum

from config.errors import ProtocolError
from drivers.canopen.frames import Frame

MULTIPLEXER = struct.Struct("<BHB4s")
ABORT = struct.Struct("<BHBI")

TOGGLE = 0x10
MAX_TRANSFER_BYTES = 65536


class SdoCode(IntEnum):
    """Abort codes of CiA 301, table 22, that are described in words."""

    TOGGLE_NOT_ALTERNATED = 0x0503_0000
    TIMED_OUT = 0x0504_0000
    UNKNOWN_COMMAND = 0x0504_0001
    OUT_OF_MEMORY = 0x0504_0005
    UNSUPPORTED_ACCESS = 0x0601_0000
    WRITE_ONLY = 0x0601_0001
    READ_ONLY = 0x0601_0002
    NO_OBJECT = 0x0602_0000
    NOT_MAPPABLE = 0x0604_0041
    PDO_LENGTH_EXCEEDED = 0x0604_0042
    PARAMETER_INCOMPATIBLE = 0x0604_0043
    INTERNAL_INCOMPATIBLE = 0x0604_0047
    HARDWARE_ERROR = 0x0606_0000
    LENGTH_MISMATCH = 0x0607_0010
    LENGTH_TOO_HIGH = 0x0607_0012
    LENGTH_TOO_LOW = 0x0607_0013
    NO_SUBINDEX = 0x0609_0011
    VALUE_INVALID = 0x0609_0030
    VALUE_TOO_HIGH = 0x0609_0031
    VALUE_TOO_LOW = 0x0609_0032
    GENERAL = 0x0800_0000
    CANNOT_STORE = 0x0800_0020
    CANNOT_STORE_LOCAL_CONTROL = 0x0800_0021
    CANNOT_STORE_DEVICE_STATE = 0x0800_0022


_TEXTS = {
    SdoCode.TOGGLE_NOT_ALTERNATED: "toggle bit not alternated",
    SdoCode.TIMED_OUT: "SDO protocol timed out",
    SdoCode.UNKNOWN_COMMAND: "command specifier not valid or unknown",
    SdoCode.OUT_OF_MEMORY: "out of memory",
    SdoCode.UNSUPPORTED_ACCESS: "unsupported access to an object",
    SdoCode.WRITE_ONLY: "the object is write-only",
    SdoCode.READ_ONLY: "the object is read-only",
    SdoCode.NO_OBJECT: "the object does not exist",
    SdoCode.NOT_MAPPABLE: "the object cannot be mapped to the PDO",
    SdoCode.PDO_LENGTH_EXCEEDED: "the mapped objects exceed the PDO's length",
    SdoCode.PARAMETER_INCOMPATIBLE: "general parameter incompatibility",
    SdoCode.INTERNAL_INCOMPATIBLE: "general internal incompatibility",
    SdoCode.HARDWARE_ERROR: "hardware error",
    SdoCode.LENGTH_MISMATCH: "data type or length does not match",
    SdoCode.LENGTH_TOO_HIGH: "length of the parameter too high",
    SdoCode.LENGTH_TOO_LOW: "length of the parameter too low",
    SdoCode.NO_SUBINDEX: "the sub-index does not exist",
    SdoCode.VALUE_INVALID: "value not allowed",
    SdoCode.VALUE_TOO_HIGH: "value too high",
    SdoCode.VALUE_TOO_LOW: "value too low",
    SdoCode.GENERAL: "general error",
    SdoCode.CANNOT_STORE: "the data cannot be transferred or stored",
    SdoCode.CANNOT_STORE_LOCAL_CONTROL: "the data cannot be stored: local control",
    SdoCode.CANNOT_STORE_DEVICE_STATE: "the data cannot be stored in the present device state",
}


def abort_text(code: int) -> str:
    """Return an abort code in words; for a code that is not in `SdoCode`, return its number."""
    try:
        return f"{_TEXTS[SdoCode(code)]} ({code:08X}h)"
    except ValueError:
        return f"abort code {code:08X}h"


class SdoAbort(ProtocolError):  # noqa: N818 - the name in CiA 301
    """The client or the server aborted an SDO transfer.

    Attributes:
        code: Abort code: one of `SdoCode`, or another code of CiA 301 or of the manufacturer.
        index, subindex: The object. The callbacks of `SdoServer` may leave them out when they raise
            this error, because the server knows the object.
    """

    def __init__(self, code: int, index: int = 0, subindex: int = 0, where: str = "") -> None:
        """Build the message; `where` is the place of the error, such as "node 3, write"."""
        self.code = code
        self.index = index
        self.subindex = subindex
        place = f"{where}: " if where else ""
        super().__init__(
            f"{place}object {object_name(index, subindex)}: {abort_text(code)}",
            code="RID-DRIVE-REFUSED",
        )


def object_name(index: int, subindex: int) -> str:
    """Return the name of an object, such as ``60C2h:01``."""
    return f"{index:04X}h:{subindex:02X}"


def abort_frame(cob_id: int, index: int, subindex: int, code: int) -> Frame:
    """Return the abort message of a client or a server (CiA 301, 7.2.4.3.17)."""
    return Frame(cob_id, ABORT.pack(0x80, index, subindex, code))


def segment_data(data: bytes) -> bytes:
    """Return the data bytes in a segment message; its command byte states their number."""
    return data[1 : 8 - (data[0] >> 1 & 0x07)]


def segment_frame(cob_id: int, toggle: int, chunk: bytes, last: bool) -> Frame:
    """Return a segment of at most 7 bytes; `toggle` is 0 or `TOGGLE`, `last` marks the last one."""
    command = toggle | (7 - len(chunk)) << 1 | last
    return Frame(cob_id, bytes((command,)) + chunk.ljust(7, b"\0"))
