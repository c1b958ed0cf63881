"""Number of bits of a CAN frame on the wire, and load of a CAN bus (ISO 11898-1).

From the start of frame to the end of the CRC, a stuff bit follows every five equal bits. The 13
bits after the CRC have no stuff bits: CRC delimiter, acknowledge slot, acknowledge delimiter, end
of frame, and intermission. An 8-byte frame has 111 bits without stuffing and at most 135.
"""

from __future__ import annotations

import math

LOAD_LIMIT = 0.80

_UNSTUFFED_BITS = 13
_HEADER_BITS = 19
_CRC_BITS = 15


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
) -> float:
    """Return the fraction of the bus's capacity that the cyclic exchange uses; 1.0 is a full bus.

    In every cycle the bus carries SYNC and, for every axis, an RPDO and a TPDO with the numbers of
    data bytes in `frame_bytes`. The heartbeats of the master and of every drive are added, with the
    periods in `heartbeats_s`, and per axis one statusword in every `status_s` seconds. `guarded` is
    the number of drives with life guarding: they send no heartbeat, but answer the request that the
    master sends with each of its own heartbeats.
    """
    command, answer = frame_bytes
    master_s, drive_s = heartbeats_s
    per_cycle = typical_bits(0) + axes * (typical_bits(command) + typical_bits(answer))
    heartbeats = typical_bits(1) / master_s + (axes - guarded) * typical_bits(1) / drive_s
    heartbeats += guarded * (typical_bits(0) + typical_bits(1)) / master_s
    return (per_cycle / cycle_time_s + heartbeats + axes * typical_bits(2) / status_s) / bitrate
