"""Points reach the online compensation by shared memory, bytes, an iterator or a socket."""

from __future__ import annotations

import contextlib
import json
import os
import re
import socket
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from compensation.online.point_codec import PROTOCOL, PointDecoder, greeting
from compensation.online.point_feed import PointFeed, PointGate, feed
from compensation.online.point_ring import READ, PointRing, PointsFailed
from compensation.online.point_server import PointServer, PointService, listening, serve_points
from config.errors import ConfigError, LockedError, ProtocolError, TransportError
from config.load import load_cell
from tests.builders.raised_codes import raises_code

Points = NDArray[np.float64]
LOADED = load_cell("ir361")
CELL, ROBOT = LOADED.config, LOADED.robot
GUIDE = Path(__file__).parents[3] / "docs/guide/stream-a-path.md"
HELLO = json.dumps({"protocol": PROTOCOL}).encode() + b"\n"


def path_of(count: int) -> Points:
    return np.arange(3.0 * count).reshape(count, 3) / 1e3


def gate() -> PointGate:
    return PointGate(CELL, ROBOT)


def take_points(ring: PointRing, count: int) -> Points:
    """Take up to `count` points out of the ring buffer, as the on-line stage does."""
    read = ring.points_read
    count = min(count, ring.written - read)
    rows = np.array([ring.rows[(read + k) % ring.capacity] for k in range(count)])
    ring.counters[READ] = read + count
    return rows.reshape(-1, ring.joints)


class TestRing:
    @given(st.integers(1, 20), st.lists(st.tuples(st.integers(0, 30), st.integers(0, 30))))
    def test_every_point_is_read_once_and_in_order(
        self, capacity: int, steps: list[tuple[int, int]]
    ) -> None:
        ring = PointRing.create(3, capacity)
        path, sent, got = path_of(2000), 0, []
        for write, read in steps:
            sent += ring.write(path[sent : sent + write])
            assert 0 <= ring.room <= capacity
            got.append(take_points(ring, read))
        got.append(take_points(ring, capacity))
        np.testing.assert_array_equal(np.concatenate(got), path[:sent])

    def test_the_first_end_or_failure_is_kept(self) -> None:
        ended, failed = PointRing.create(3, 4), PointRing.create(3, 4)
        ended.end()
        ended.fail(PointsFailed.LOST, "too late")
        assert ended.failed is PointsFailed.NO
        assert ended.closed
        failed.fail(PointsFailed.REFUSED, "ä" * 2000)
        failed.end()
        assert not failed.ended
        assert set(failed.failure) == {"ä"}

    def test_a_ring_without_room_is_refused(self) -> None:
        with raises_code(ConfigError, "RID-INTERNAL-ERROR"):
            PointRing.create(3, 0)


class TestBytes:
    @given(st.lists(st.integers(1, 9), max_size=8), st.integers(1, 50))
    def test_points_are_decoded_for_any_split_of_their_bytes(
        self, counts: list[int], cut: int
    ) -> None:
        path = path_of(sum(counts))
        data, at = bytearray(HELLO), 0
        for count in counts:
            data += struct.pack("<I", count) + path[at : at + count].tobytes()
            at += count
        data += struct.pack("<I", 0)
        decoder = PointDecoder(3)
        got = [decoder.decode(bytes(data[k : k + cut])) for k in range(0, len(data), cut)]
        np.testing.assert_array_equal(np.concatenate(got), path)
        assert decoder.ended

    @pytest.mark.parametrize(
        ("data", "detail"),
        [
            (b"GET / HTTP/1.1\r\n", '"rid-daq points 1"'),
            (b'{"protocol": "rid-daq points 2"}\n', '"rid-daq points 1"'),
            (b"[]\n", '"rid-daq points 1"'),
            (b"x" * 2000, '"rid-daq points 1"'),
            (HELLO + struct.pack("<I", 2**32 - 1), "4294967295 points"),
            (HELLO + struct.pack("<II", 0, 0), "the end"),
        ],
    )
    def test_any_other_bytes_are_refused(self, data: bytes, detail: str) -> None:
        with raises_code(ProtocolError, "RID-STREAM-PROTOCOL", detail):
            PointDecoder(3).decode(data)


class TestIterator:
    def test_points_are_accepted_one_by_one_and_in_blocks(self) -> None:
        path, ring = path_of(7), PointRing.create(3, 10)
        feed(ring, gate(), [path[0], path[1:4], path[4], path[5:]])
        np.testing.assert_array_equal(take_points(ring, 10), path)
        assert ring.ended

    def test_a_full_ring_blocks_the_iterator(self) -> None:
        path, ring = path_of(500), PointRing.create(3, 20)
        drawn = 0

        def points() -> Iterator[Points]:
            nonlocal drawn
            for point in path:
                drawn += 1
                yield point

        with PointFeed(ring, gate(), points()) as fed:
            fed.wait(20, 120.0)
            assert drawn <= 21
            got: list[Points] = []
            while not ring.ended or ring.room < 20:
                got.append(take_points(ring, 7))
        np.testing.assert_array_equal(np.concatenate(got), path)

    def test_an_iterator_that_raises_fails_the_stream_after_its_points(self) -> None:
        def points() -> Iterator[Points]:
            yield path_of(3)
            raise ValueError("no inverse kinematics here")

        ring = PointRing.create(3, 10)
        with PointFeed(ring, gate(), points()) as fed:
            fed.wait(10, 120.0)
        assert ring.written == 3
        assert ring.failed is PointsFailed.LOST
        assert "no inverse kinematics here" in ring.failure

    def test_an_iterator_that_raises_at_once_is_a_clear_error(self) -> None:
        def no_file() -> Points:
            raise ValueError("no file")

        def points() -> Iterator[Points]:
            yield no_file()

        ring = PointRing.create(3, 10)
        with (
            PointFeed(ring, gate(), points()) as fed,
            raises_code(ConfigError, "RID-STREAM-POINTS", "points"),
        ):
            fed.wait(10, 120.0)

    def test_points_of_another_robot_are_refused(self) -> None:
        ring = PointRing.create(3, 10)
        feed(ring, gate(), [np.zeros((2, 6))])
        assert ring.failed is PointsFailed.REFUSED
        assert "3 joint positions" in ring.failure


@contextlib.contextmanager
def serving(silence_s: float) -> Iterator[tuple[Path, PointRing]]:
    """Run the server in a thread of this process, at a socket in a private folder."""
    ring = PointRing.create(3, 50)
    over = threading.Event()
    with tempfile.TemporaryDirectory() as folder, listening(Path(folder) / "points") as listener:
        path = Path(folder) / "points"
        service = PointService(CELL, ROBOT, 64, silence_s)
        thread = threading.Thread(target=serve_points, args=(listener, ring, service, over.is_set))
        thread.start()
        try:
            yield path, ring
        finally:
            over.set()
            thread.join(120.0)
        assert not thread.is_alive()


@pytest.fixture
def served() -> Iterator[tuple[Path, PointRing]]:
    """A server with a long timeout, for a client on a busy computer."""
    with serving(silence_s=600.0) as path_and_ring:
        yield path_and_ring


def client(path: Path) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX)
    connection.settimeout(30.0)
    try:
        connection.connect(str(path))
    except OSError:
        connection.close()
        raise
    return connection


def wait_until(condition: Callable[[], bool]) -> None:
    waiting = threading.Event()
    for _ in range(3000):
        if condition():
            return
        waiting.wait(0.01)
    raise AssertionError("the condition was not met in time")


def guide_client() -> Any:
    """Return the function `send_path` of the program in the guide."""
    text = GUIDE.read_text()
    code = text.split("```python\n", 1)[1].split("```", 1)[0]
    namespace: dict[str, Any] = {}
    exec(compile(code, str(GUIDE), "exec"), namespace)
    return namespace["send_path"]


class TestSocket:
    def test_the_guides_client_sends_a_path_and_receives_its_outcome(
        self, served: tuple[Path, PointRing]
    ) -> None:
        path, ring = served
        points, hellos, outcomes = path_of(500), [], []

        def points_of(hello: dict[str, Any]) -> Iterator[Points]:
            hellos.append(hello)
            yield points[:300]
            yield points[300:]

        sender = threading.Thread(
            target=lambda: outcomes.append(guide_client()(str(path), points_of))
        )
        sender.start()
        wait_until(lambda: ring.room == 0)
        got: list[Points] = []

        def take() -> bool:
            ended = ring.ended
            got.append(take_points(ring, 50))
            return ended

        wait_until(take)
        np.testing.assert_array_equal(np.concatenate(got), points)
        assert hellos == [json.loads(greeting(ROBOT.joint_names, 0.008, 64))]
        assert not outcomes, "the outcome was sent before the end of the motion"

    @pytest.mark.parametrize(
        ("data", "hang_up", "text"),
        [
            (HELLO, True, "disconnected before the end"),
            (HELLO, False, r"sent nothing for 1 s"),
            (b"", False, r"sent nothing for 1 s"),
            (b"hello\n", False, "does not use this protocol"),
            (HELLO + struct.pack("<I", 5000), False, "a frame of 5000 points"),
        ],
    )
    def test_a_client_that_dies_stalls_or_sends_errors_fails_the_stream(
        self, data: bytes, hang_up: bool, text: str
    ) -> None:
        good = struct.pack("<I", 5) + path_of(5).tobytes() if data == HELLO else b""
        silence_s = 1.0 if "nothing" in text else 600.0
        with serving(silence_s) as (path, ring), client(path) as connection:
            connection.recv(500)
            connection.sendall(data + good)
            if hang_up:
                connection.close()
            wait_until(lambda: bool(ring.failed))
        assert ring.failed is PointsFailed.LOST
        assert ring.written == (5 if good else 0), "points before the failure were lost"
        assert re.search(text, ring.failure)

    def test_a_second_client_is_refused(self, served: tuple[Path, PointRing]) -> None:
        path, ring = served
        with client(path) as first:
            first.recv(10)
            wait_until(lambda: is_refused(path))
            first.sendall(HELLO + struct.pack("<I", 0))
            wait_until(lambda: ring.ended)

    @pytest.mark.fault(46)
    def test_a_second_session_is_refused_without_effect_on_the_first(
        self, served: tuple[Path, PointRing], measured: Callable[[str], None]
    ) -> None:
        path, ring = served
        points = path_of(40)

        def second_is_refused() -> None:
            holder = (f"{path}: ", f"(process {os.getpid()})")
            with raises_code(LockedError, "RID-CELL-BUSY", *holder):
                PointServer(path, PointRing.create(3, 50), PointService(CELL, ROBOT, 64))
            assert path.is_socket()

        second_is_refused()  # while the first session waits for a client
        with client(path) as first:
            first.recv(500)
            wait_until(lambda: is_refused(path))
            second_is_refused()  # while it serves a client: its socket no longer listens
            first.sendall(HELLO + struct.pack("<I", 40) + points.tobytes() + struct.pack("<I", 0))
            wait_until(lambda: ring.ended)
        np.testing.assert_array_equal(take_points(ring, 50), points)
        measured(
            "second session refused before and while the first serves a client; 0 points changed"
        )

    def test_the_socket_of_a_killed_session_is_reused(self, tmp_path: Path) -> None:
        tmp_path.chmod(0o700)
        path = tmp_path / "points"
        program = f"""
import os, signal
from pathlib import Path
from compensation.online.point_server import listening
with listening(Path({str(path)!r})):
    os.kill(os.getpid(), signal.SIGKILL)
"""
        assert subprocess.run([sys.executable, "-c", program], check=False).returncode == -9
        assert {left.name for left in tmp_path.iterdir()} == {"points", "points.lock"}
        with listening(path):
            client(path).close()
        assert [*tmp_path.iterdir()] == []

    def test_a_folder_accessible_to_others_is_refused(self, tmp_path: Path) -> None:
        tmp_path.chmod(0o755)
        with (
            raises_code(TransportError, "RID-SOCKET-PATH", "700"),
            listening(tmp_path / "points"),
        ):
            pass
        assert [*tmp_path.iterdir()] == []

    def test_a_socket_of_a_dead_program_is_replaced_and_a_live_one_is_not(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "points"
            with socket.socket(socket.AF_UNIX) as other:
                other.bind(str(path))
            with listening(path):
                assert not is_refused(path)
            with socket.socket(socket.AF_UNIX) as other:
                other.bind(str(path))
                other.listen()
                with (
                    raises_code(TransportError, "RID-SOCKET-PATH"),
                    listening(path),
                ):
                    pass
                assert not is_refused(path)

    def test_a_socket_path_that_is_too_long_is_refused(self) -> None:
        with (
            raises_code(TransportError, "RID-SOCKET-PATH", "107"),
            listening(Path("/tmp") / ("x" * 120) / "points"),
        ):
            pass


def is_refused(path: Path) -> bool:
    try:
        client(path).close()
    except OSError:
        return True
    return False
