"""A local socket that takes points from another program: a process of its own.

It can hang, fail or die without touching the cyclic task, which then stops the robot on the points
that it has. One client is served, of the same user; the socket lies in a folder of the user's own.
While the ring is full nothing is read, so that the client's sending blocks: back-pressure.
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
from config.errors import LockedError, TransportError, system_errors
from config.process.file_locks import file_holder, held_file
from config.process.termination import leave_terminal
from config.robot.bodies import Workspace
from config.robot.robot import RobotDescription

LOOK_S: Final = 0.05
SILENCE_S: Final = 2.0
CHUNK_BYTES: Final = 16_384
_CREDENTIALS: Final = struct.Struct("3i")
_LONGEST_PATH: Final = 107


@dataclass(frozen=True)
class PointService:
    """What the server's process is told.

    Attributes:
        workspace: What stands around it.
        cycle_time_s: Time between points [s].
        buffer: Points that the robot is behind.
        silence_s: How long a client may send nothing while there is room [s].
    """

    robot: RobotDescription
    workspace: Workspace
    cycle_time_s: float
    buffer: int
    silence_s: float = SILENCE_S


class PointServer:
    """The socket and its process; a context manager.

    Args:
        path: Where the socket is made; removed in the end.
        ring: Where points go.
        service: What is served.

    Raises:
        TransportError: The folder is open to other users, the path too long, or taken.
        LockedError: Another session listens there, or is served.
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
        except BaseException as error:  # a signal that came meanwhile, perhaps
            self._end(str(error))
            raise
        finally:
            self._listener.close()
        return self

    @property
    def dead(self) -> bool:
        """Whether the server's process has ended."""
        return not self._process.is_alive

    def watch(self) -> None:
        """Let nobody wait for points from a server that has died."""
        if self.dead:
            self._ring.fail(PointsFailed.LOST, "the process that takes the points has died")

    def __exit__(self, _kind: object, error: BaseException | None, *_: object) -> None:
        self._end("the session has ended" if error is None else str(error))

    def _end(self, why: str) -> None:
        self._ring.conclude(why)
        self._process.end()
        self._socket.close()


@contextlib.contextmanager
def listening(path: Path) -> Iterator[socket.socket]:
    """Listen, for this user alone, at a path in a folder of the user's own.

    The path is this session's until the end of the `with`, also when the socket listens no more
    since its client has come: a lock file beside it says so.

    Raises:
        TransportError: No socket can be made there.
        LockedError: Another session listens there, or is served.
    """
    _refuse_unfit(path)
    lock = path.with_name(f"{path.name}.lock")
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(held_file(lock))
            if path.is_socket() and not _answers(path):
                path.unlink()  # left by a program that died
            listener = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
            listener.bind(os.fspath(path))
            stack.callback(path.unlink, missing_ok=True)
            path.chmod(0o600)
            listener.listen(1)
        except BlockingIOError:
            raise LockedError(
                f"{path}: another session takes points here (process {file_holder(lock)}). Wait"
                " until it ends, stop it (`rid-daq stop`), or choose another path with --socket",
                code="RID-CELL-BUSY",
            ) from None
        except OSError as error:
            raise TransportError(
                f"{path}: no socket can be made there: {error.strerror}",
                code="RID-SOCKET-PATH",
            ) from error
        yield listener


def _refuse_unfit(path: Path) -> None:
    """Refuse a path that is too long, or in a folder that others can reach."""
    if len(os.fsencode(path)) > _LONGEST_PATH:
        raise TransportError(
            f"{path}: longer than the {_LONGEST_PATH} bytes of a socket's path; choose a shorter"
            " folder",
            code="RID-SOCKET-PATH",
        )
    with system_errors(
        TransportError, f"{path}: no socket can be made there", code="RID-SOCKET-PATH"
    ):
        folder = path.parent.lstat()
    if folder.st_uid != os.getuid() or stat.S_IMODE(folder.st_mode) & 0o077:
        raise TransportError(
            f"{path.parent}: is open to other users, and a socket there would be too: give one"
            " in a folder of your own (chmod 700)",
            code="RID-SOCKET-PATH",
        )


def _answers(path: Path) -> bool:
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
        listener: Bound and listening.
        ring: Where points go.
        service: What is served.
        parent: Process id of the program: without it, there is nobody to take points for.
    """
    leave_terminal()
    serve(listener, ring, service, lambda: ring.concluded or os.getppid() != parent)


def serve(
    listener: socket.socket, ring: PointRing, service: PointService, over: Callable[[], bool]
) -> None:
    """Take one client's points until `over`; close the listener once it has come."""
    with listener:
        client = _accept(listener, over)
    if client is None:
        return
    with client:
        client.settimeout(LOOK_S)
        gate = PointGate(service.robot, service.workspace, service.cycle_time_s)
        feed(ring, gate, _points(client, service, over), over)
        while not over():
            time.sleep(PAUSE_S)
        with contextlib.suppress(OSError):  # it may have hung up
            client.sendall(farewell(ring.taken, ring.verdict or ring.failure))


def _points(
    client: socket.socket, service: PointService, over: Callable[[], bool]
) -> Iterator[FloatArray]:
    """Yield a client's points until it announces the end.

    Raises:
        TransportError: It hangs up, says nothing for too long, or there is nobody left to take
            points for.
        ProtocolError: What it sends is not the protocol.
    """
    names = service.robot.joint_names
    decoder = PointDecoder(len(names))
    with system_errors(
        TransportError, "the client's connection was lost", code="RID-STREAM-CLIENT"
    ):
        client.sendall(greeting(names, service.cycle_time_s, service.buffer))
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
                    "the client hung up before the end of its path", code="RID-STREAM-CLIENT"
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
