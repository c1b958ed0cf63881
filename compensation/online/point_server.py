"""Local socket that accepts points from another program, in a separate process.

If the process hangs, fails or dies, the cyclic task continues, and stops the robot on the points
that have arrived. The process serves one client of the same user; the socket is in a folder of that
user. While the ring is full, the server reads nothing, so that the client must wait
(back-pressure).
"""

from __future__ import annotations

import contextlib
import os
import socket
import stat
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from acquisition.session.helper_process import HelperProcess, start_all
from compensation.online.point_codec import PointDecoder, farewell, greeting
from compensation.online.point_feed import PAUSE_S, PointGate, feed
from compensation.online.point_ring import PointRing, PointsFailed
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.errors import LockedError, TransportError, system_errors
from config.process.file_locks import file_holder, held_file
from config.process.termination import leave_terminal
from config.robot.robot import RobotDescription

LOOK_S: Final = 0.05
SILENCE_S: Final = 2.0
CHUNK_BYTES: Final = 16_384
_CREDENTIALS: Final = struct.Struct("3i")
_LONGEST_PATH: Final = 107


@dataclass(frozen=True)
class PointService:
    """Settings of the server's process.

    Attributes:
        cell, robot: The cell and its robot.
        buffer: Number of points between client and robot.
        silence_s: Longest time without data from the client while the ring has room [s].
    """

    cell: CellConfig
    robot: RobotDescription
    buffer: int
    silence_s: float = SILENCE_S


class PointServer:
    """Socket and process of the server; a context manager.

    Args:
        path: Path of the socket, which is removed at the end.
        ring: Ring for the points.
        service: Settings of the process.

    Raises:
        TransportError: The folder belongs to another user or is open to others, or the path is too
            long or in use.
        LockedError: Another session uses the socket.
    """

    def __init__(self, path: Path, ring: PointRing, service: PointService) -> None:
        self.path = path
        self._ring = ring
        with contextlib.ExitStack() as stack:
            self._listener = stack.enter_context(listening(path))
            self._socket = stack.pop_all()
        arguments = (self._listener, ring, service, os.getpid())
        self._process = HelperProcess("points", run_point_server, arguments, patience_s=2.0)

    def __enter__(self) -> PointServer:
        try:
            start_all([self._process])
        except BaseException as error:  # the reason is possibly a signal that arrived meanwhile
            self._end(str(error))
            raise
        finally:
            self._listener.close()
        return self

    @property
    def dead(self) -> bool:
        """True if the server's process has ended."""
        return not self._process.is_alive

    def watch(self) -> None:
        """Report a failure if the server has died, so that the motion does not wait for points."""
        if self.dead:
            self._ring.fail(PointsFailed.LOST, "the process that receives the points has died")

    def __exit__(self, _kind: object, error: BaseException | None, *_: object) -> None:
        self._end("the session has ended" if error is None else str(error))

    def _end(self, why: str) -> None:
        self._ring.conclude(why)
        self._process.end()
        self._socket.close()


@contextlib.contextmanager
def listening(path: Path) -> Iterator[socket.socket]:
    """Open a listening socket at a path in the user's folder; only this user can connect.

    A lock file next to the path reserves it for this session until the end of the `with` block. The
    path stays reserved after the client has connected and the socket has closed.

    Raises:
        TransportError: The socket cannot be made at this path.
        LockedError: Another session uses the path.
    """
    _refuse_unfit(path)
    lock = path.with_name(f"{path.name}.lock")
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(held_file(lock))
            if path.is_socket() and not _is_served(path):
                path.unlink()  # the socket was left by a program that was killed
            listener = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
            listener.bind(os.fspath(path))
            stack.callback(path.unlink, missing_ok=True)
            path.chmod(0o600)
            listener.listen(1)
        except BlockingIOError:
            raise LockedError(
                f"{path}: another session receives points here (process {file_holder(lock)})."
                " Wait until it ends, stop it (`rid-daq stop`), or choose another path with"
                " --socket",
                code="RID-CELL-BUSY",
            ) from None
        except OSError as error:
            raise TransportError(
                f"{path}: cannot make a socket: {error.strerror}; choose another path with"
                " --socket",
                code="RID-SOCKET-PATH",
            ) from error
        yield listener


def _refuse_unfit(path: Path) -> None:
    """Refuse a path that is too long, or in a folder that other users own or can access."""
    if len(os.fsencode(path)) > _LONGEST_PATH:
        raise TransportError(
            f"{path}: longer than the {_LONGEST_PATH} bytes of a socket's path; choose a shorter"
            " folder",
            code="RID-SOCKET-PATH",
        )
    with system_errors(TransportError, f"{path}: cannot make a socket", code="RID-SOCKET-PATH"):
        folder = path.parent.lstat()
    if folder.st_uid != os.getuid() or stat.S_IMODE(folder.st_mode) & 0o077:
        raise TransportError(
            f"{path.parent}: belongs to another user or is open to others: use a folder that only"
            " you can access (chmod 700)",
            code="RID-SOCKET-PATH",
        )


def _is_served(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(os.fspath(path))
        except OSError:
            return False
        return True


def run_point_server(
    listener: socket.socket, ring: PointRing, service: PointService, parent: int
) -> None:
    """Serve one client; the main function of the server's process.

    Args:
        listener: Bound and listening socket.
        ring: Ring for the points.
        service: Settings of the process.
        parent: Process id of the program; the server ends when the program has ended.
    """
    leave_terminal()
    serve_points(listener, ring, service, lambda: ring.concluded or os.getppid() != parent)


def serve_points(
    listener: socket.socket, ring: PointRing, service: PointService, over: Callable[[], bool]
) -> None:
    """Receive a client's points until `over()`; close the listener once the client is connected."""
    with listener:
        client = _accept(listener, over)
    if client is None:
        return
    with client:
        client.settimeout(LOOK_S)
        gate = PointGate(service.cell, service.robot)
        feed(ring, gate, _receive_points(client, service, over), over)
        while not over():
            time.sleep(PAUSE_S)
        with contextlib.suppress(OSError):  # the client may have disconnected
            client.sendall(farewell(ring.points_read, ring.verdict or ring.failure))


def _receive_points(
    client: socket.socket, service: PointService, over: Callable[[], bool]
) -> Iterator[FloatArray]:
    """Yield a client's points until it announces the end.

    Raises:
        TransportError: The client disconnects or is silent for too long, or the session has ended.
        ProtocolError: The client does not follow the protocol.
    """
    names = service.robot.joint_names
    decoder = PointDecoder(len(names))
    with system_errors(
        TransportError, "the client's connection was lost", code="RID-STREAM-CLIENT"
    ):
        client.sendall(greeting(names, service.cell.cycle_time_s, service.buffer))
        heard_s = time.monotonic()
        while not decoder.ended:
            if over():
                raise TransportError("the session is over", code="RID-STREAM-CLIENT")
            try:
                data = client.recv(CHUNK_BYTES)
            except TimeoutError:
                if time.monotonic() - heard_s > service.silence_s:
                    raise TransportError(
                        f"the client sent nothing for {service.silence_s:g} s",
                        code="RID-STREAM-CLIENT",
                    ) from None
                continue
            if not data:
                raise TransportError(
                    "the client disconnected before the end of its path", code="RID-STREAM-CLIENT"
                )
            points = decoder.decode(data)
            if len(points):
                yield points
            heard_s = time.monotonic()


def _accept(listener: socket.socket, over: Callable[[], bool]) -> socket.socket | None:
    listener.settimeout(LOOK_S)
    while not over():
        try:
            client, _ = listener.accept()
        except TimeoutError:
            continue
        packed = client.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
        if _CREDENTIALS.unpack(packed)[1] == os.getuid():
            return client
        client.close()
    return None
