"""Number of bits of a CAN frame on the wire, and load of a CAN bus (ISO 11898-1).

From the start of frame to the end of the CRC, a stuff bit follows every five equal bits. The 13
bits after the CRC have no stuff bits: CRC delimiter, acknowledge slot, acknowledge delimiter, end
of frame, and intermission. An 8-byte frame has 111 bits without stuffing and at most 135.
"""

from __future__ import annotations

import math
from functools import lru_cache

from drivers.canopen.frames import Frame

LOAD_LIMIT = 0.80

_UNSTUFFED_BITS = 13
_HEADER_BITS = 19
_CRC_BITS = 15
_CRC_POLYNOMIAL = 0x4599


def frame_bits(frame: Frame) -> int:
    """Return the exact length of a frame with an 11-bit identifier, with its intermission [bit]."""
    header = frame.cob_id << 7 | len(frame.data)
    crc = 0
    for byte in (header >> 16, header >> 8 & 0xFF, header & 0xFF, *frame.data):
        crc = (crc << 8 & 0x7FFF) ^ _CRC_TABLE[crc >> 7 ^ byte]
    length = _HEADER_BITS + 8 * len(frame.data) + _CRC_BITS
    payload = int.from_bytes(frame.data, "big")
    bits = (header << 8 * len(frame.data) | payload) << _CRC_BITS | crc
    return length + _stuff_bits(bits, length) + _UNSTUFFED_BITS


def worst_bits(data_bytes: int) -> int:
    """Return the largest possible length of a frame with `data_bytes` data bytes [bit]."""
    stuffed = _HEADER_BITS + 8 * data_bytes + _CRC_BITS
    return stuffed + (stuffed - 1) // 4 + _UNSTUFFED_BITS


def typical_bits(data_bytes: int) -> int:
    """Return the typical length of a frame [bit], with a third of the largest number of stuff bits.

    For 8 bytes it is 119 bit. Real frames of drives have 118 to 120 bits, because status words and
    positions contain runs of zeros; a frame with random bytes has fewer.
    """
    stuffed = _HEADER_BITS + 8 * data_bytes + _CRC_BITS
    return stuffed + (stuffed - 1) // 4 // 3 + _UNSTUFFED_BITS


def cyclic_load(
    axes: int,
    cycle_time_s: float,
    bitrate: int,
    *,
    heartbeats_s: tuple[float, float],
    frame_bytes: tuple[int, int] = (8, 8),
    status_s: float = math.inf,
    guarded: int = 0,
    worst: bool = False,
) -> float:
    """Return the fraction of the bus's capacity that the cyclic exchange uses; 1.0 is a full bus.

    In every cycle the bus carries SYNC and, for every axis, an RPDO and a TPDO with the numbers of
    data bytes in `frame_bytes`. The heartbeats of the master and of every drive are added, with the
    periods in `heartbeats_s`, and per axis one statusword in every `status_s` seconds. `guarded` is
    the number of drives with life guarding: they send no heartbeat, but answer the request that the
    master sends with each of its own heartbeats. With `worst`, every frame has its largest possible
    length.
    """
    bits = worst_bits if worst else typical_bits
    command, answer = frame_bytes
    master_s, drive_s = heartbeats_s
    per_cycle = bits(0) + axes * (bits(command) + bits(answer))
    heartbeats = bits(1) / master_s + (axes - guarded) * bits(1) / drive_s
    heartbeats += guarded * (bits(0) + bits(1)) / master_s
    return (per_cycle / cycle_time_s + heartbeats + axes * bits(2) / status_s) / bitrate


def _crc_of_byte(byte: int) -> int:
    crc = byte << 7
    for _ in range(8):
        crc = crc << 1 ^ (_CRC_POLYNOMIAL if crc & 0x4000 else 0)
        crc &= 0x7FFF
    return crc


_CRC_TABLE = tuple(_crc_of_byte(byte) for byte in range(256))


@lru_cache(maxsize=4096)
def _stuff_byte(bit: int, run: int, byte: int) -> tuple[int, int, int]:
    """Return last bit, its run length and stuff bits of a byte after `run` equal bits."""
    added = 0
    for position in range(7, -1, -1):
        bit_now = byte >> position & 1
        run = run + 1 if bit_now == bit else 1
        bit = bit_now
        if run == 5:
            added += 1
            bit, run = 1 - bit, 1
    return bit, run, added


def _stuff_bits(bits: int, length: int) -> int:
    """Return the number of stuff bits for `length` bits: two single bits, then whole bytes."""
    first, second = bits >> (length - 1) & 1, bits >> (length - 2) & 1
    bit, run, stuffed = second, 2 if first == second else 1, 0
    for byte in (bits & (1 << length - 2) - 1).to_bytes((length - 2) // 8, "big"):
        bit, run, added = _stuff_byte(bit, run, byte)
        stuffed += added
    return stuffed
