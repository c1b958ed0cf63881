"""Random bytes for the receiver of points give points or a typed error, in bounded memory."""

from __future__ import annotations

import contextlib
import json
import shutil
import socket
import struct
import tempfile
import threading
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compensation.online.point_codec import LONGEST_LINE, MOST_POINTS, PROTOCOL, PointDecoder
from compensation.online.point_feed import PointGate, feed
from compensation.online.point_ring import PointRing, PointsFailed
from compensation.online.point_server import CHUNK_BYTES, PointService, listening, serve_points
from config.errors import ProtocolError
from config.load import load_cell
from config.robot.bodies import Plane, Workspace
from tests.builders.raised_codes import raises_code

LOADED = load_cell("ir361")
CELL, ROBOT = LOADED.config, LOADED.robot
WALL = Workspace(planes=(Plane(name="wall", normal=(-1.0, 0.0, 0.0), offset_m=-0.6),))
WALLED = CELL.model_copy(update={"workspace": WALL})
HELLO = json.dumps({"protocol": PROTOCOL}).encode() + b"\n"
NESTED = b"[" * CHUNK_BYTES
GREATEST_BYTES = max(4 + MOST_POINTS * 24, LONGEST_LINE) + 2 * CHUNK_BYTES
"""Largest number of bytes that a decoder may keep for three joints."""

any_bytes = st.binary(max_size=200)
nasty_lines = st.sampled_from(
    [
        NESTED[:1000] + b"\n",
        NESTED[:-1] + b"\n",
        b'{"protocol":' * 1300 + b"\n",
        b"9" * 5000 + b"\n",
        b'"\\ud800"\n',
        b"\xff\xfe[\x00]\x00\n",
        b"null\n",
        b'{"protocol": NaN}\n',
        b"\n",
    ]
)
doubles = st.floats(width=64, allow_nan=True, allow_infinity=True)


@st.composite
def frames(draw: st.DrawFn) -> bytes:
    """Return a frame of points with a correct or wrong count and any numbers."""
    numbers = draw(st.lists(doubles, max_size=24))
    counts = [len(numbers) // 3, 0, 1, MOST_POINTS, MOST_POINTS + 1, 2**32 - 1]
    count = draw(st.sampled_from(counts))
    return struct.pack(f"<I{len(numbers)}d", count, *numbers)


sessions = st.one_of(
    st.lists(any_bytes, max_size=4),
    st.lists(nasty_lines, min_size=1, max_size=2),
    st.lists(st.one_of(frames(), any_bytes), max_size=6).map(lambda parts: [HELLO, *parts]),
)


@settings(max_examples=150)
@given(parts=sessions, cut=st.integers(1, CHUNK_BYTES))
def test_bytes_become_points_or_one_typed_error(parts: list[bytes], cut: int) -> None:
    data, decoder = b"".join(parts), PointDecoder(3)
    points_read = 0
    with contextlib.suppress(ProtocolError):
        for first in range(0, len(data), cut):
            points = decoder.decode(data[first : first + cut])
            assert points.shape == (len(points), 3)
            points_read += 24 * len(points)
            assert len(decoder._bytes) <= GREATEST_BYTES
    assert points_read <= len(data)


@pytest.mark.parametrize("depth", [1000, CHUNK_BYTES])
def test_a_deeply_nested_line_is_refused_as_another_protocol(depth: int) -> None:
    with raises_code(ProtocolError, "RID-STREAM-PROTOCOL"):
        PointDecoder(3).decode(b"[" * depth + b"\n")


def test_two_megabytes_of_single_points_keep_no_memory() -> None:
    decoder, frame = PointDecoder(3), struct.pack("<I3d", 1, 0.1, 0.2, 0.3)
    block = frame * (CHUNK_BYTES // len(frame))
    decoder.decode(HELLO)
    decoder.decode(block)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        for _ in range(2_000_000 // len(block)):
            assert len(decoder.decode(block)) == CHUNK_BYTES // len(frame)
        kept, peak = (bytes_ - before for bytes_ in tracemalloc.get_traced_memory())
    finally:
        tracemalloc.stop()
    assert kept < 100_000
    assert peak < 40 * CHUNK_BYTES


@settings(max_examples=60)
@given(points=st.lists(st.lists(doubles, min_size=3, max_size=3), max_size=20))
def test_any_numbers_are_accepted_by_the_gate_or_refused(points: list[list[float]]) -> None:
    ring = PointRing.create(3, 100)
    feed(ring, PointGate(WALLED, ROBOT), [np.array(points).reshape(-1, 3)])
    assert ring.failed in (PointsFailed.NO, PointsFailed.REFUSED)
    assert ring.ended or ring.failure


@settings(max_examples=40)
@given(parts=sessions)
def test_after_any_bytes_the_server_reports_the_reason_and_ends(parts: list[bytes]) -> None:
    """The client sends and disconnects; then the ring has an end or the reason, and the thread
    ends.
    """
    ring, over = PointRing.create(3, 4 * MOST_POINTS), threading.Event()
    trouble: list[BaseException] = []

    def served() -> None:
        try:
            serve_points(listener, ring, PointService(CELL, ROBOT, 64), over.is_set)
        except BaseException as error:
            trouble.append(error)

    path = Path(tempfile.mkdtemp()) / "points"
    with listening(path) as listener:
        thread = threading.Thread(target=served)
        thread.start()
        with socket.socket(socket.AF_UNIX) as client:
            client.settimeout(30.0)
            client.connect(str(path))
            with contextlib.suppress(OSError):
                for part in parts:
                    client.sendall(part)
                client.shutdown(socket.SHUT_WR)
                client.recv(4096)
            waiting = threading.Event()
            for _ in range(3000):
                if ring.ended or ring.failure:
                    break
                waiting.wait(0.01)
        over.set()
        thread.join(120.0)
    shutil.rmtree(path.parent)
    assert not thread.is_alive()
    assert trouble == []
    assert ring.ended or ring.failure
