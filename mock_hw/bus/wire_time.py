"""How long a classic CAN frame occupies the wire, stuff bits of its very content included.

A frame is sent from its start bit to its CRC with a complementary bit stuffed in after every five
equal ones (ISO 11898-1, 10.5); the rest has a fixed form. Tables of one byte at a time make the
exact count cheap enough to be taken of every frame.
"""

from __future__ import annotations

from functools import lru_cache

EXTENDED_FLAG = 0x8000_0000
REMOTE_FLAG = 0x4000_0000
ERROR_FLAG = 0x2000_0000
STANDARD_MASK = 0x7FF
EXTENDED_MASK = 0x1FFF_FFFF

INTERMISSION_BITS = 3
"""Bits between a frame's end, when receivers have it, and the start of the next one."""

_FIXED_FORM_BITS = 10 + INTERMISSION_BITS  # CRC delimiter, acknowledge, its delimiter, end of frame
_CRC_POLYNOMIAL = 0x4599
_STATES = 10  # the last bit times how often it was repeated: 1 to 5


def _feed(state: int, bits: int, count: int) -> tuple[int, int]:
    """Return the number of stuff bits in `count` bits sent from `state`, and the state after."""
    last, run = divmod(state, 5)
    run += 1
    stuffed = 0
    for shift in range(count - 1, -1, -1):
        bit = bits >> shift & 1
        if run == 5:
            stuffed += 1
            last, run = 1 - last, 1
        run = run + 1 if bit == last else 1
        last = bit
    return stuffed, last * 5 + run - 1


def _crc(crc: int, bits: int, count: int) -> int:
    for shift in range(count - 1, -1, -1):
        invert = (bits >> shift & 1) ^ (crc >> 14 & 1)
        crc = (crc << 1 & 0x7FFF) ^ (_CRC_POLYNOMIAL if invert else 0)
    return crc


_STUFF_OF_BYTE = tuple(_feed(state, byte, 8) for state in range(_STATES) for byte in range(256))
_LAST_OF_CRC = tuple(_feed(state, bits, 7) for state in range(_STATES) for bits in range(128))
_CRC_OF_BYTE = tuple(_crc(0, byte, 8) for byte in range(256))


@lru_cache(maxsize=4096)
def _header(can_id: int, length: int) -> tuple[int, int, int, int]:
    """Return bits, stuff bits, stuffing state and CRC after the data length code."""
    remote = bool(can_id & REMOTE_FLAG)
    if can_id & EXTENDED_FLAG:
        identifier = can_id & EXTENDED_MASK
        bits = (identifier >> 18) << 20 | 0b11 << 18 | identifier & 0x3FFFF
        bits = bits << 7 | remote << 6 | length
        count = 39
    else:
        bits = (can_id & STANDARD_MASK) << 7 | remote << 6 | length
        count = 19
    # The dominant start bit is the leading zero; no bit was sent before it.
    stuffed, state = _feed(0, bits, count - 1)
    return count, stuffed, state, _crc(0, bits, count)


def wire_bits(can_id: int, data: bytes, length: int | None = None) -> int:
    """Return how many bit times a frame takes, the intermission after it included.

    Args:
        can_id: The identifier with SocketCAN's flags (`EXTENDED_FLAG`, `REMOTE_FLAG`).
        data: 0 to 8 bytes; none in a remote frame.
        length: The data length code of a remote frame; that of `data` when left out.
    """
    count, stuffed, state, crc = _header(can_id, len(data) if length is None else length)
    for byte in data:
        more, state = _STUFF_OF_BYTE[state << 8 | byte]
        stuffed += more
        crc = (crc << 8 & 0x7FFF) ^ _CRC_OF_BYTE[crc >> 7 ^ byte]
    more, state = _STUFF_OF_BYTE[state << 8 | crc >> 7]
    last, state = _LAST_OF_CRC[state << 7 | crc & 0x7F]
    if state % 5 == 4:
        last += 1
    return count + 8 * len(data) + 15 + stuffed + more + last + _FIXED_FORM_BITS


@lru_cache(maxsize=4096)
def arbitration_key(can_id: int) -> int:
    """Return a number that is smaller the earlier a frame wins the bus.

    The bits of the arbitration field in the order in which they are sent: a data frame beats the
    remote frame of its identifier, and a standard frame the extended ones that begin alike.
    """
    remote = 1 if can_id & REMOTE_FLAG else 0
    if can_id & EXTENDED_FLAG:
        identifier = can_id & EXTENDED_MASK
        return (identifier >> 18) << 21 | 0b11 << 19 | (identifier & 0x3FFFF) << 1 | remote
    return (can_id & STANDARD_MASK) << 21 | remote << 20
