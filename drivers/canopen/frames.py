"""`Frame`, and the identifiers of CANopen's predefined connection set (CiA 301, 7.3.3)."""

from __future__ import annotations

from typing import NamedTuple

NMT_COB_ID = 0x000
SYNC_COB_ID = 0x080

EMCY_BASE = 0x080
SDO_ANSWER_BASE = 0x580
SDO_REQUEST_BASE = 0x600
HEARTBEAT_BASE = 0x700
REMOTE_FLAG = 0x4000_0000  # as in SocketCAN
LSS_MASTER_COB_ID = 0x7E5  # CiA 305


class Frame(NamedTuple):
    """A classic CAN frame: 11-bit identifier and up to 8 data bytes.

    With `REMOTE_FLAG` in its identifier it is a remote frame: it carries no data, and the length of
    `data` is the number of bytes that it requests.
    """

    cob_id: int
    data: bytes

    def __str__(self) -> str:
        """Return the frame in candump's notation: ``181#3706000000000000``."""
        return f"{self.cob_id:03X}#{self.data.hex().upper()}"


SYNC = Frame(SYNC_COB_ID, b"")


def emcy_cob_id(node_id: int) -> int:
    """Return the identifier of a node's emergency messages."""
    return EMCY_BASE + node_id


def tpdo_cob_id(node_id: int, number: int = 1) -> int:
    """Return the predefined identifier of a node's transmit PDO 1 to 4."""
    return 0x080 + 0x100 * number + node_id


def rpdo_cob_id(node_id: int, number: int = 1) -> int:
    """Return the predefined identifier of a node's receive PDO 1 to 4."""
    return 0x100 + 0x100 * number + node_id


def sdo_request_cob_id(node_id: int) -> int:
    """Return the identifier from a client to a node's SDO server."""
    return SDO_REQUEST_BASE + node_id


def sdo_answer_cob_id(node_id: int) -> int:
    """Return the identifier from a node's SDO server to its client."""
    return SDO_ANSWER_BASE + node_id


def heartbeat_cob_id(node_id: int) -> int:
    """Return the identifier of a node's boot-up and heartbeat messages."""
    return HEARTBEAT_BASE + node_id
