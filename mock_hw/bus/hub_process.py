"""The hub's listening socket, and the hub as a process, with its signals and its end."""

from __future__ import annotations

import contextlib
import fcntl
import multiprocessing
import os
import shutil
import socket
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

from config.errors import RidDaqError, TransportError
from config.simulation.faults import NO_SCRIPT, FaultScript
from mock_hw.bus.faults import BusFaults
from mock_hw.bus.hub import CanHub
from mock_hw.host.device_process import (
    catch_terminate,
    leave_signals_to_parent,
    request_exact_timing,
)
from mock_hw.host.runtime_directory import folder_in_use

LINGER_NS = 3_000_000_000
"""Time for which the hub continues after the end of its parent process, so that the drives can
detect this and stop [ns]."""


@dataclass(frozen=True)
class HubSettings:
    """Settings of the hub process.

    Attributes:
        path: Path of the listening socket.
        bitrate: Bit rate of the bus [bit/s].
        realtime: True for real time, False for lock-step.
        channel: Name of the bus in the log.
        log: File for all frames; None for no file.
        private_folder: True if the socket's folder contains only this bus; the folder is then
            removed at the end.
        faults: Faults of the bus.
        nodes: Node ids of the drives, by joint.
        master: Node id of the computer.
        places: Places of the controlwords, from `controlword_places`.
        pace: Largest number of simulated seconds per second, in lock-step.
    """

    path: Path
    bitrate: int
    realtime: bool
    channel: str
    log: Path | None = None
    private_folder: bool = False
    faults: FaultScript = NO_SCRIPT
    nodes: Mapping[str, int] = field(default_factory=dict)
    master: int = 127
    places: Mapping[int, int] = field(default_factory=dict)
    pace: float | None = None


def serve_hub(settings: HubSettings, ready: Connection) -> None:
    """Run a hub until SIGTERM, or until some seconds after the end of the parent process.

    When clients can connect, the function sends None through `ready`; after an error, it sends the
    error's text.
    """
    leave_signals_to_parent()
    stop_fd = catch_terminate()
    request_exact_timing(settings.realtime)
    try:
        with contextlib.ExitStack() as stack:
            if settings.private_folder:
                stack.callback(shutil.rmtree, settings.path.parent, ignore_errors=True)
                stack.enter_context(folder_in_use(settings.path.parent))
            hub = stack.enter_context(open_hub(settings))
            ready.send(None)
            ready.close()
            _run(hub, stop_fd)
    except (MemoryError, OSError, RidDaqError) as error:
        with contextlib.suppress(OSError):
            ready.send(str(error))


@contextlib.contextmanager
def open_hub(settings: HubSettings) -> Iterator[CanHub]:
    """Listen at the hub's path and yield the hub; close socket and hub at the end.

    Raises:
        TransportError: The path cannot be used.
        OSError: The log cannot be written.
    """
    with contextlib.ExitStack() as stack:
        log = None
        if settings.log is not None:
            log = stack.enter_context(settings.log.open("w", encoding="ascii"))
        listener = stack.enter_context(listening_socket(settings.path))
        hub = CanHub(
            listener,
            settings.bitrate,
            realtime=settings.realtime,
            pace=settings.pace,
            channel=settings.channel,
            log=log,
            faults=_faults(settings),
        )
        stack.callback(hub.close)
        yield hub


def _faults(settings: HubSettings) -> BusFaults | None:
    if not settings.faults.bus:
        return None
    start_ns = time.monotonic_ns() if settings.realtime else 0
    return BusFaults(settings.faults, settings.nodes, settings.master, settings.places, start_ns)


def _run(hub: CanHub, stop_fd: int) -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        hub.run([stop_fd, parent.sentinel])
        if parent.is_alive():
            return
        hub.run([stop_fd], time.monotonic_ns() + LINGER_NS)
    else:
        hub.run([stop_fd])


@contextlib.contextmanager
def listening_socket(path: Path) -> Iterator[socket.socket]:
    """Yield a SEQPACKET socket that listens at `path`; close it and remove the path at the end.

    Raises:
        TransportError: Another process listens at the path, or the socket cannot be created.
    """
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            fcntl.flock(folder, fcntl.LOCK_EX)
            _remove_stale(path)
            listener.bind(str(path))
            listener.listen(16)
            path.chmod(0o600)
        finally:
            os.close(folder)
    except OSError as error:
        listener.close()
        raise TransportError(
            f"{path}: cannot listen here ({error})", code="RID-SOCKET-PATH"
        ) from error
    except TransportError:
        listener.close()
        raise
    listener.setblocking(False)
    try:
        yield listener
    finally:
        listener.close()
        path.unlink(missing_ok=True)


def _remove_stale(path: Path) -> None:
    """Remove the socket file of a killed hub; raise an error if a hub still listens at it."""
    if not path.is_socket():
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as probe:
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
            return
    raise TransportError(
        f"{path}: another simulated bus already uses this path; stop it first",
        code="RID-MOCK-SERVED",
    )
