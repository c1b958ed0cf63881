"""Transmission time of classic CAN frames, including their stuff bits.

From the start bit to the CRC, a complementary bit (stuff bit) is inserted after every five equal
bits (ISO 11898-1, 10.5); the rest of a frame has a fixed form. Tables for whole bytes make the
exact count fast enough to be done for every frame.
"""

from __future__ import annotations

from functools import lru_cache

EXTENDED_FLAG = 0x8000_0000
REMOTE_FLAG = 0x4000_0000
ERROR_FLAG = 0x2000_0000
STANDARD_MASK = 0x7FF
EXTENDED_MASK = 0x1FFF_FFFF

INTERMISSION_BITS = 3
"""Number of bits from the end of a frame, at which it is received, to the start of the next
frame."""

_FIXED_FORM_BITS = 10 + INTERMISSION_BITS  # from the CRC delimiter on
_CRC_POLYNOMIAL = 0x4599
_STATES = 10  # last bit (0 or 1) times its run length (1 to 5)


def _feed(state: int, bits: int, count: int) -> tuple[int, int]:
    """Return the number of stuff bits for `count` bits after `state`, and the new state."""
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
    """Return number of bits, stuff bits, stuffing state and CRC up to the data length code."""
    remote = bool(can_id & REMOTE_FLAG)
    if can_id & EXTENDED_FLAG:
        identifier = can_id & EXTENDED_MASK
        bits = (identifier >> 18) << 20 | 0b11 << 18 | identifier & 0x3FFFF
        bits = bits << 7 | remote << 6 | length
        count = 39
    else:
        bits = (can_id & STANDARD_MASK) << 7 | remote << 6 | length
        count = 19
    # The first of the `count` bits is the start bit, 0; state 0 is the state after it.
    stuffed, state = _feed(0, bits, count - 1)
    return count, stuffed, state, _crc(0, bits, count)


def wire_bits(can_id: int, data: bytes, length: int | None = None) -> int:
    """Return the length of a frame in bit times, including the intermission after it.

    Args:
        can_id: CAN identifier with the flags of SocketCAN (`EXTENDED_FLAG`, `REMOTE_FLAG`).
        data: 0 to 8 bytes; empty in a remote frame.
        length: Data length code of a remote frame; None for the length of `data`.
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
    """Return a number for comparing priorities: the lower number wins the arbitration.

    The number consists of the bits of the arbitration field in the order of transmission. A data
    frame has priority over a remote frame with the same identifier, and a standard frame over
    extended frames that begin with the same bits.
    """
    remote = 1 if can_id & REMOTE_FLAG else 0
    if can_id & EXTENDED_FLAG:
        identifier = can_id & EXTENDED_MASK
        return (identifier >> 18) << 21 | 0b11 << 19 | (identifier & 0x3FFFF) << 1 | remote
    return (can_id & STANDARD_MASK) << 21 | remote << 20
