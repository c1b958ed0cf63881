"""Protocol between a client that sends points and the socket server, without the socket itself.

One line of JSON each way, then frames:

    server   {"protocol": "rid-daq points 1", "joints": [...], "cycle_time_s": ..., "buffer": ...}
    client   {"protocol": "rid-daq points 1"}
    client   frames: a count (unsigned 32 bits), then count x joints doubles, point by point, all
             little endian; a count of 0 is the end of the path, at rest
    server   {"points": ..., "error": null or "..."} when the motion is over, and closes
"""

from __future__ import annotations

import contextlib
import json
import struct
from collections.abc import Sequence
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ProtocolError

PROTOCOL: Final = "rid-daq points 1"
MOST_POINTS: Final = 4096
LONGEST_LINE: Final = 1024
_COUNT: Final = struct.Struct("<I")


def greeting(joint_names: Sequence[str], cycle_time_s: float, buffer: int) -> bytes:
    """Return the server's first line.

    Args:
        joint_names: Base to flange: the order of a point's numbers.
        cycle_time_s: Time between points [s].
        buffer: Number of points between client and robot during the motion.
    """
    return _line(
        {
            "protocol": PROTOCOL,
            "joints": list(joint_names),
            "cycle_time_s": cycle_time_s,
            "buffer": buffer,
        }
    )


def farewell(points: int, error: str) -> bytes:
    """Return the server's last line: the number of accepted points and the error, if any."""
    return _line({"points": points, "error": error or None})


def _line(document: dict[str, object]) -> bytes:
    return json.dumps(document).encode() + b"\n"


class PointDecoder:
    """Decoder of a client's bytes into points.

    Args:
        joints: Number of joints, and of values per point.

    Attributes:
        ended: True if the client has announced the end of the path.
    """

    def __init__(self, joints: int) -> None:
        self._point_bytes = 8 * joints
        self._joints = joints
        self._greeted = False
        self._bytes = bytearray()
        self.ended = False

    def decode(self, data: bytes) -> FloatArray:
        """Decode more bytes; return the complete points, shape (any, joints).

        Raises:
            ProtocolError: The client uses another protocol, sends too large a frame, or continues
                after the end.
        """
        self._bytes += data
        if not self._greeted and not self._greet():
            return np.empty((0, self._joints))
        frames = []
        while len(self._bytes) >= _COUNT.size:
            if self.ended:
                raise ProtocolError(
                    "the client sent data after the end of its path",
                    code="RID-STREAM-PROTOCOL",
                )
            (count,) = _COUNT.unpack_from(self._bytes)
            if count > MOST_POINTS:
                raise ProtocolError(
                    f"the client announced a frame of {count} points; at most {MOST_POINTS} are"
                    " allowed",
                    code="RID-STREAM-PROTOCOL",
                )
            size = _COUNT.size + count * self._point_bytes
            if len(self._bytes) < size:
                break
            self.ended = count == 0
            frames.append(bytes(self._bytes[_COUNT.size : size]))
            del self._bytes[:size]
        return np.frombuffer(b"".join(frames), dtype="<f8").reshape(-1, self._joints)

    def _greet(self) -> bool:
        end = self._bytes.find(b"\n")
        if end < 0 and len(self._bytes) <= LONGEST_LINE:
            return False
        document = None
        if 0 <= end <= LONGEST_LINE:
            with contextlib.suppress(ValueError, RecursionError):
                document = json.loads(self._bytes[:end])
        if not isinstance(document, dict) or document.get("protocol") != PROTOCOL:
            raise ProtocolError(
                'the client does not use this protocol: its first line must be {"protocol":'
                f' "{PROTOCOL}"}}',
                code="RID-STREAM-PROTOCOL",
            )
        del self._bytes[: end + 1]
        self._greeted = True
        return True
