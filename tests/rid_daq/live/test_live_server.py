"""The process of the live page over real connections: access, refusals, and a thousand clients.

No test depends on speed: a test waits for an answer or for the end of the connection.
"""

from __future__ import annotations

import json
import os
import re
import resource
import socket
import ssl
import time
from collections.abc import Iterator
from dataclasses import replace
from importlib.resources import files
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycle_row import row_dtype
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from acquisition.task.states import TaskState
from config.load import load_cell
from rid_daq.live.live_process import LIMITS, MOST_DESCRIPTORS, run_live_page
from rid_daq.live.picture import MotionPicture, ShownMotion
from rid_daq.web.access import Access
from tests.builders.javascript_types import assert_declared

TOKEN = "t" * 40
PATIENCE_S = 120.0
STOP = b"POST /stop HTTP/1.1\r\nHost: %s\r\nContent-Type: application/json\r\n"
STOP_BODY = b"Content-Length: 2\r\n\r\n{}"


class Served:
    """The live page in a separate process; the tests write its state, and nothing moves."""

    def __init__(self, access: Access) -> None:
        loaded = load_cell("ir361")
        listener = socket.create_server((access.address, 0), backlog=128)
        self.access = replace(access, port=listener.getsockname()[1])
        self.host = f"127.0.0.1:{self.access.port}".encode()
        self.control = ControlBlock.create()
        self.ring = Ring.create(3, 64)
        self.motion = ShownMotion("A <b>motion</b>", 100, 50, loaded.config, loaded.robot)
        self.process = get_context("spawn").Process(
            target=run_live_page,
            args=(self.access, listener, self.motion, self.ring, self.control, os.getpid()),
        )
        self.process.start()
        listener.close()

    def connect(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self.access.port), timeout=PATIENCE_S)

    def ask(self, request: bytes) -> tuple[int, str, bytes]:
        """Return status, head and body of a complete answer."""
        with self.connect() as line:
            line.sendall(request)
            return _parts(_read_all(line))

    def get(self, path: str, *headers: str) -> tuple[int, str, bytes]:
        lines = [f"GET {path} HTTP/1.1", f"Host: {self.host.decode()}", *headers]
        return self.ask(("\r\n".join(lines) + "\r\n\r\n").encode())

    @property
    def bearer(self) -> str:
        return f"Authorization: Bearer {TOKEN}"

    def stop_head(self) -> bytes:
        return STOP % self.host

    def watch(self) -> socket.socket:
        """Return an open event stream.

        Try again while clients that have disconnected still count against the limit.
        """
        until_s = time.monotonic() + PATIENCE_S
        while True:
            line = self._ask_for_events()
            if line.recv(4096, socket.MSG_PEEK).startswith(b"HTTP/1.1 200"):
                return line
            line.close()
            assert time.monotonic() < until_s

    def _ask_for_events(self) -> socket.socket:
        line = self.connect()
        line.sendall(
            f"GET /events HTTP/1.1\r\nHost: {self.host.decode()}\r\n{self.bearer}\r\n\r\n".encode()
        )
        return line

    def descriptors(self) -> int:
        return len(os.listdir(f"/proc/{self.process.pid}/fd"))

    def resident_bytes(self) -> int:
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * resource.getpagesize()

    def close(self) -> None:
        self.control.task.state = TaskState.FINISHED
        self.process.join(PATIENCE_S)
        self.process.kill()
        self.process.join()


def _read_all(line: socket.socket) -> bytes:
    received = b""
    try:
        while data := line.recv(65536):
            received += data
    except ConnectionResetError:
        pass  # the client had sent more than was read
    return received


def _parts(answer: bytes) -> tuple[int, str, bytes]:
    head, _, body = answer.partition(b"\r\n\r\n")
    return int(head.split()[1]) if head else 0, head.decode(), body


def _event(line: socket.socket) -> bytes:
    """Return the next whole event of a stream."""
    received = b""
    while b"\ndata: " not in received or not received.endswith(b"\n\n\r\n"):  # the end of a chunk
        data = line.recv(65536)
        assert data, "the stream has ended"
        received += data
    return _last_event(received)


def _last_event(received: bytes) -> bytes:
    return received.rpartition(b"\ndata: ")[2].partition(b"\n\n")[0]


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    live = Served(Access("127.0.0.1", 0, TOKEN))
    yield live
    live.close()


@pytest.fixture
def unstopped(served: Served) -> Served:
    """Return the page after a reset of the stop request."""
    served.control.program._stop_code = 0
    return served


def test_the_address_from_the_terminal_opens_the_page(served: Served) -> None:
    status, head, _ = served.get(f"/?t={TOKEN}")
    assert status == 303
    assert f"\r\nlocation: /?s={served.access.session}\r\n" in head
    assert "set-cookie" not in head.lower()
    status, head, body = served.get(f"/?s={served.access.session}")
    assert status == 200
    assert b"STOP" in body
    assert "default-src 'none'; script-src 'self'" in head
    assert "unsafe" not in head
    assert "nosniff" in head
    for path in ("/page.css", "/page.js", "/stop.js", "/icon.svg"):
        assert served.get(path)[0] == 200


@pytest.mark.parametrize("path", ["/", "/events", "/?t=wrong", "/?s=wrong"])
def test_without_the_token_nothing_is_shown(served: Served, path: str) -> None:
    status, _, body = served.get(path)
    assert status == 403
    assert b"complete address" in body


def test_unknown_paths_are_not_found(served: Served) -> None:
    for path in ("/../page.js", "/%2e%2e/access.py", "/access.py", "/page.html", "/stop"):
        assert served.get(path, served.bearer)[0] == 404


def test_a_foreign_host_name_of_this_computer_is_refused(unstopped: Served) -> None:
    name = b"evil.example:%d" % unstopped.access.port
    bearer = unstopped.bearer.encode()
    for path in (b"/", b"/events", b"/?t=" + TOKEN.encode()):
        status, _, body = unstopped.ask(
            b"GET %s HTTP/1.1\r\nHost: %s\r\n%s\r\n\r\n" % (path, name, bearer)
        )
        assert (status, body) == (421, b"")
    status, _, _ = unstopped.ask(STOP % name + b"X-Rid-Daq: stop\r\n" + STOP_BODY)
    assert status == 421
    assert unstopped.ask(b"GET / HTTP/1.1\r\n\r\n")[0] == 400, "without a host name"
    assert unstopped.control.program.stop_code == 0


@pytest.mark.parametrize(
    "header", ["Origin: https://evil.example", "Origin: null", "Sec-Fetch-Site: cross-site"]
)
def test_a_page_of_another_origin_is_refused_even_with_the_token(
    unstopped: Served, header: str
) -> None:
    for path in ("/", "/events", "/page.js"):
        assert unstopped.get(path, unstopped.bearer, header)[0] == 403
    sent = unstopped.stop_head() + f"X-Rid-Daq: stop\r\n{header}\r\n".encode() + STOP_BODY
    assert unstopped.ask(sent)[0] == 403
    assert unstopped.control.program.stop_code == 0


def test_a_form_of_another_origin_stops_nothing(unstopped: Served) -> None:
    host = b"POST /stop HTTP/1.1\r\nHost: %s\r\n" % unstopped.host
    for kind in (b"text/plain", b"application/x-www-form-urlencoded", b"multipart/form-data"):
        sent = host + b"Content-Type: %s\r\nX-Rid-Daq: stop\r\n" % kind + STOP_BODY
        assert unstopped.ask(sent)[0] == 415
    assert unstopped.ask(unstopped.stop_head() + STOP_BODY)[0] == 403, (
        "a request without the header X-Rid-Daq must be refused"
    )
    assert unstopped.ask(b"GET /stop HTTP/1.1\r\nHost: %s\r\n\r\n" % unstopped.host)[0] == 404
    options = b"OPTIONS /stop HTTP/1.1\r\nHost: %s\r\nOrigin: https://evil.example\r\n\r\n"
    status, head, _ = unstopped.ask(options % unstopped.host)
    assert status == 403
    assert "access-control" not in head.lower()
    assert unstopped.control.program.stop_code == 0


def test_on_this_computer_only_the_stop_needs_no_token(
    unstopped: Served,
) -> None:
    origin = b"Origin: http://%s\r\nSec-Fetch-Site: same-origin\r\n" % unstopped.host
    for path in (b"/start", b"/", b"/events", b"/page.js", b"/run"):
        sent = (unstopped.stop_head() + b"X-Rid-Daq: stop\r\n" + STOP_BODY).replace(b"/stop", path)
        assert unstopped.ask(sent)[0] == 404
    assert unstopped.control.program.stop_code == 0
    status, _, body = unstopped.ask(
        unstopped.stop_head() + b"X-Rid-Daq: stop\r\n" + origin + STOP_BODY
    )
    assert (status, json.loads(body)) == (202, {"stop": "asked for"})
    assert unstopped.control.program.stop_code == StopCode.STOP_BUTTON


def test_a_request_sent_in_single_bytes_is_answered(unstopped: Served) -> None:
    with unstopped.connect() as line:
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for byte in unstopped.stop_head() + b"X-Rid-Daq: stop\r\n" + STOP_BODY:
            line.send(bytes((byte,)))
        assert _parts(_read_all(line))[0] == 202


def test_oversized_requests_are_refused(served: Served) -> None:
    long = b"GET / HTTP/1.1\r\nHost: x\r\nX: " + b"y" * 20000
    assert served.ask(long)[0] in (431, 0)
    many = b"GET / HTTP/1.1\r\nHost: x\r\n" + b"".join(b"X-%d: y\r\n" % i for i in range(2000))
    assert served.ask(many)[0] in (431, 0)
    sent = served.stop_head() + b"X-Rid-Daq: stop\r\nContent-Length: 1000000\r\n\r\n"
    assert served.ask(sent)[0] == 413


def test_slow_requests_are_ended(served: Served) -> None:
    heads = (b"", b"GET / HTTP/1.1\r\nHos", served.stop_head() + b"Content-Length: 5\r\n\r\n{")
    lines = [served.connect() for _ in heads]
    for line, head in zip(lines, heads, strict=True):
        line.sendall(head)
    for line in lines:
        assert _read_all(line) == b""
        line.close()


@pytest.mark.fault(22)
def test_a_thousand_clients_use_bounded_memory_and_a_stop_still_works(
    unstopped: Served, measured: object
) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, max(soft, 4096)), hard))
    with unstopped.watch() as viewer:
        _event(viewer)
        before = unstopped.resident_bytes()
        lines = []
        for _ in range(1000):
            line = unstopped.connect()
            line.sendall(b"GET / HTTP/1.1\r\nX-Slow: " + b"z" * 4000)
            lines.append(line)
        descriptors, grown = unstopped.descriptors(), unstopped.resident_bytes() - before
        sent = unstopped.stop_head() + b"X-Rid-Daq: stop\r\n" + STOP_BODY
        assert unstopped.ask(sent)[0] == 202
        assert unstopped.control.program.stop_code == StopCode.STOP_BUTTON
        assert json.loads(_event(viewer)), "the admitted viewer still receives events"
        for line in lines:
            line.close()
    assert descriptors <= MOST_DESCRIPTORS
    assert grown < 32 << 20
    assert callable(measured)
    measured(
        f"1000 slow clients: {descriptors} file descriptors, {grown / 2**20:.0f} MB more; a stop is"
        " still executed"
    )


def test_too_many_viewers_are_refused_with_retry_after(served: Served) -> None:
    viewers, answers = [], []
    for _ in range(LIMITS.streams + 1):  # one by one: too many unanswered requests close the oldest
        viewers.append(served._ask_for_events())
        answers.append(_parts(viewers[-1].recv(65536)))
    for viewer in viewers:
        viewer.close()
    refused = [head for status, head, _ in answers if status == 503]
    # a client of an earlier test can still occupy a place
    assert 1 <= len(refused) <= 2
    assert all("retry-after" in head.lower() for head in refused)
    assert LIMITS.streams + LIMITS.answering + LIMITS.waiting < MOST_DESCRIPTORS


def test_texts_of_devices_cannot_become_markup_or_events(served: Served) -> None:
    text = 'drive says <script>alert("1")</script>\n\ndata: {"over": true}\x1b[31m \u2028'
    served.control.task._reason_code = 0
    served.control.task.report_stop(StopReason(StopCode.EMERGENCY, text, "axis1"))
    with served.watch() as viewer:
        events = iter(lambda: _event(viewer), None)  # the first event can be an earlier one
        event = next(each for each in events if json.loads(each)["stop_joint"] == "axis1")
    assert event.isascii()
    assert b"\n" not in event
    assert b"\x1b" not in event
    assert json.loads(event)["stop"] == text
    script = files("rid_daq.live").joinpath("page.js").read_text(encoding="utf-8")
    page = files("rid_daq.live").joinpath("page.html").read_text(encoding="utf-8")
    for way in ("innerHTML", "outerHTML", "insertAdjacent", "eval(", "Function(", "document.write"):
        assert way not in script
    for way in ("<style", "style=", "onclick", "<script>", "http:", "https:", "//cdn"):
        assert way not in page
    assert not re.search(r"https?://", script + page)


def test_the_picture_shows_every_joint_relative_to_its_limits(served: Served) -> None:
    picture = MotionPicture(served.motion, served.ring, served.control)
    row = np.zeros((), dtype=row_dtype(3))
    row["position"] = (0.1, 0.2, np.nan)
    row["torque_nm"] = (45.0, -90.0, 0.0)
    row["valid"] = 1
    values = [v for name in row.dtype.names or () for v in np.atleast_1d(row[name]).tolist()]
    assert served.ring.write(tuple(values))
    served.control.program.announce_monitor(3)
    served.control.monitor.show_temperatures([300.15, float("nan"), 310.15], [])
    shown = json.loads(picture.document())
    assert_declared(shown, "LivePicture")
    one, two, three = shown["joints"]
    assert_declared(one, "LiveJoint")
    limits = served.motion.robot.joints[0].limits
    assert one["torque_share"] == pytest.approx(45.0 / limits.torque, rel=1e-4)
    assert (one["temperature_c"], two["temperature_c"]) == (27.0, None)
    assert three["position"] is None
    assert (one["position_min"], one["velocity_limit"]) == (limits.position_min, limits.velocity)


def test_another_address_needs_tls_and_the_token(certificate: Path) -> None:
    live = Served(Access("0.0.0.0", 0, TOKEN, certificate))
    try:
        trust = ssl.create_default_context(cafile=str(certificate))
        trust.check_hostname = False

        def ask(headers: str) -> int:
            host = live.host.decode()
            with trust.wrap_socket(live.connect()) as line:
                line.sendall(f"GET / HTTP/1.1\r\nHost: {host}\r\n{headers}\r\n".encode())
                return _parts(_read_all(line))[0]

        assert ask("") == 403
        assert ask(live.bearer + "\r\n") == 200
        assert live.ask(b"GET / HTTP/1.1\r\nHost: %s\r\n\r\n" % live.host)[0] == 0, (
            "plain text is refused"
        )
    finally:
        live.close()


def test_the_page_ends_with_the_motion_and_viewers_receive_the_end() -> None:
    live = Served(Access("127.0.0.1", 0, TOKEN))
    with live.watch() as viewer:
        _event(viewer)
        began_s = time.monotonic()
        live.close()
        rest = _read_all(viewer)
    assert json.loads(_last_event(rest))["over"]
    assert live.process.exitcode == 0, f"after {time.monotonic() - began_s:.1f} s"
