"""How long a stop takes: until the cyclic task sees it, and until every axis was told on the bus.

A listener on the simulated bus sees the frames as the drives do. It is there before STOP is
pressed, takes what comes while it waits for the stop, and is gone afterwards.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import socket
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from config.load import load_cell
from drivers.canopen.frames import rpdo_cob_id
from drivers.servo.cia402 import ControlWord
from mock_hw.bus.hub_client import HubClient
from mock_hw.bus.hub_protocol import HubRole

PATIENCE_S: Final = 300.0
CELL: Final = "ir361"
_LOOK_S: Final = 0.0002
_STOPPING: Final = 0x86
"""The bits of a controlword that tell a quick stop from all else (CiA 402-2, 7.4.1.2)."""


class BusListener:
    """Listens to the controlwords on the simulated bus of a cell.

    Args:
        client: An observer of the bus.
    """

    def __init__(self, client: HubClient) -> None:
        self._client = client
        self._axis = {
            rpdo_cob_id(axis.node_id, number): axis.node_id
            for axis in load_cell(CELL).config.axes
            for number in (1, 2)
        }
        self._running = set(self._axis.values())

    @classmethod
    @contextlib.contextmanager
    def on_the_bus(cls, folder: Path) -> Iterator[BusListener]:
        """Listen to the one simulated bus below a runtime folder."""
        (path,) = (folder / "rid-daq").glob(f"*/{CELL}.sock")
        client = HubClient(path, HubRole.OBSERVER)
        try:
            yield cls(client)
        finally:
            client.close()

    def is_stopped(self, wait_s: float) -> bool:
        """Take what has come, waiting at most `wait_s`; return whether every axis was told."""
        for _, can_id, length, _, data in self._client.take_all(wait_s):
            node = self._axis.get(can_id)
            if node is None or length < 2 or length == 4:  # a velocity alone
                continue
            if int.from_bytes(data[:2], "little") & _STOPPING == ControlWord.QUICK_STOP:
                self._running.discard(node)
        return not self._running


@dataclass(frozen=True)
class Moving:
    """A motion that is under way, and whom to ask for its stop.

    Attributes:
        control: The motion's words.
        folder: The runtime folder that its simulated bus is in.
        port: Where the server listens.
        server: The server's process.
        path: What is posted to.
    """

    control: ControlBlock
    folder: Path
    port: int
    server: int
    path: str = "/stop"

    def post_stop(self) -> tuple[float, float]:
        """Ask the server for the stop; return when the task and the last axis were told [s]."""
        request = (
            f"POST {self.path} HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\nX-Rid-Daq: stop\r\n"
            "Content-Type: application/json\r\nContent-Length: 2\r\n\r\n{}"
        ).encode()
        with BusListener.on_the_bus(self.folder) as bus:
            began_s = time.monotonic()
            with socket.create_connection(("127.0.0.1", self.port), timeout=PATIENCE_S) as line:
                line.sendall(request)
                seen_s, _, stopped_s = self._told(bus)
        return seen_s - began_s, stopped_s - began_s

    def stop_by_memory(self) -> tuple[float, int]:
        """Write the stop's word; return when the last axis was told [s].

        Returns:
            That, and the cycles until the task saw the word.
        """
        with BusListener.on_the_bus(self.folder) as bus:
            began_s, began = time.monotonic(), self.control.task.cycles
            self.control.program.request_stop(StopCode.STOP_COMMAND)
            _, cycle, stopped_s = self._told(bus)
        return stopped_s - began_s, cycle - began

    def end(self) -> None:
        """Write the stop's word."""
        self.control.program.request_stop(StopCode.STOP_COMMAND)

    def _told(self, bus: BusListener) -> tuple[float, int, float]:
        """Wait for the stop; return when the task saw it, in which cycle, and its last frame."""
        task, until_s = self.control.task, time.monotonic() + PATIENCE_S
        seen: tuple[float, int] | None = None
        while True:
            stopped = bus.is_stopped(_LOOK_S)
            now_s = time.monotonic()
            if seen is None and task.stop_reason is not None:
                seen = now_s, task.cycles
            if stopped and seen is not None:
                return *seen, now_s
            if now_s > until_s:
                raise SystemExit("the stop was not seen")


@dataclass(frozen=True)
class Stops:
    """Stops that were pressed: those by the server, and those over shared memory.

    Attributes:
        task_ms, bus_ms: How long each by the server took until the task saw it, and until the last
            axis's quick stop was on the bus [ms].
        memory_ms: The latter of those over shared memory [ms].
        cycles: Within how many cycles those over shared memory were seen.
    """

    task_ms: list[float] = field(default_factory=list)
    bus_ms: list[float] = field(default_factory=list)
    memory_ms: list[float] = field(default_factory=list)
    cycles: list[int] = field(default_factory=list)

    def press(self, moving: Moving) -> None:
        """Stop a motion by the server."""
        time.sleep(random.uniform(1.0, 2.0))
        for times, took_s in zip((self.task_ms, self.bus_ms), moving.post_stop(), strict=True):
            times.append(1e3 * took_s)
        print(
            f"stop {len(self.bus_ms)}: seen {self.task_ms[-1]:.1f} ms, on the bus"
            f" {self.bus_ms[-1]:.1f} ms",
            flush=True,
        )

    def press_frozen(self, moving: Moving) -> None:
        """Stop a motion over shared memory, its server frozen."""
        os.kill(moving.server, signal.SIGSTOP)
        try:
            time.sleep(random.uniform(0.1, 0.3))
            took_s, cycles = moving.stop_by_memory()
        finally:
            os.kill(moving.server, signal.SIGCONT)
        self.memory_ms.append(1e3 * took_s)
        self.cycles.append(cycles)
        print(f"frozen {len(self.cycles)}: {cycles} cycles, {1e3 * took_s:.1f} ms", flush=True)
