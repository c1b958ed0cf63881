"""A client that sends points to `rid-daq stream`."""

from __future__ import annotations

import json
import socket
import struct
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensation.online.point_codec import PROTOCOL


@contextmanager
def send_batches(
    path: Path, batches: Sequence[NDArray[np.float64]], *, end: bool = True
) -> Iterator[list[dict[str, Any]]]:
    """Send batches to a listening socket; yield a list that receives the answer at the end.

    Each batch has shape (points, joints) [rad]. With `end`, the client ends the stream and waits
    for the answer. Without it, the client disconnects after the last batch.
    """
    messages: list[dict[str, Any]] = []

    def send() -> None:
        with socket.socket(socket.AF_UNIX) as robot:
            robot.settimeout(180.0)
            _connect(robot, path)
            lines = robot.makefile("rb")
            lines.readline()
            robot.sendall(json.dumps({"protocol": PROTOCOL}).encode() + b"\n")
            for batch in batches:
                robot.sendall(struct.pack("<I", len(batch)) + batch.astype("<f8").tobytes())
            if not end:
                lines.close()
                return
            robot.sendall(struct.pack("<I", 0))
            messages.append(json.loads(lines.readline()))
            lines.close()

    sender = threading.Thread(target=send)
    sender.start()
    try:
        yield messages
    finally:
        sender.join(120.0)
    assert not sender.is_alive()


def _connect(client: socket.socket, path: Path) -> None:
    waiting = threading.Event()
    for _ in range(6000):
        try:
            client.connect(str(path))
        except OSError:
            waiting.wait(0.01)
        else:
            return
    raise AssertionError("nobody listens")
