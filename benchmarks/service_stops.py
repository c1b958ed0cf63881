"""Latency of STOP until the cyclic task reacts, and until the quick stops are on the bus.

A listener on the simulated bus receives the same frames as the drives. It connects before STOP is
pressed and disconnects after the stop.
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
"""Bits of the controlword that identify a quick stop (CiA 402-2, 7.4.1.2)."""


class BusListener:
    """Listener for the controlwords on the simulated bus of a cell.

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
        """Connect to the only simulated bus below a runtime folder."""
        (path,) = (folder / "rid-daq").glob(f"*/{CELL}.sock")
        client = HubClient(path, HubRole.OBSERVER)
        try:
            yield cls(client)
        finally:
            client.close()

    def is_stopped(self, wait_s: float) -> bool:
        """Read frames for at most `wait_s`; return True if every axis received a quick stop."""
        for _, can_id, length, _, data in self._client.take_all(wait_s):
            node = self._axis.get(can_id)
            if node is None or length < 2 or length == 4:  # a velocity alone
                continue
            if int.from_bytes(data[:2], "little") & _STOPPING == ControlWord.QUICK_STOP:
                self._running.discard(node)
        return not self._running


@dataclass(frozen=True)
class Moving:
    """A running motion and the server that can stop it.

    Attributes:
        control: The motion's control block.
        folder: The runtime folder with its simulated bus.
        port: TCP port of the server.
        server: Process id of the server.
        path: URL path of the stop.
    """

    control: ControlBlock
    folder: Path
    port: int
    server: int
    path: str = "/stop"

    def post_stop(self) -> tuple[float, float]:
        """Post STOP to the server; return the latency of the task's reaction and of the bus [s]."""
        request = (
            f"POST {self.path} HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\nX-Rid-Daq: stop\r\n"
            "Content-Type: application/json\r\nContent-Length: 2\r\n\r\n{}"
        ).encode()
        with BusListener.on_the_bus(self.folder) as bus:
            began_s = time.monotonic()
            with socket.create_connection(("127.0.0.1", self.port), timeout=PATIENCE_S) as line:
                line.sendall(request)
                seen_s, _, stopped_s = self._wait_for_stop(bus)
        return seen_s - began_s, stopped_s - began_s

    def stop_by_memory(self) -> tuple[float, int]:
        """Request the stop in shared memory.

        Returns:
            Latency until the last axis's quick stop [s], and the cycles until the task reacted.
        """
        with BusListener.on_the_bus(self.folder) as bus:
            began_s, began = time.monotonic(), self.control.task.cycles
            self.control.program.request_stop(StopCode.STOP_COMMAND)
            _, cycle, stopped_s = self._wait_for_stop(bus)
        return stopped_s - began_s, cycle - began

    def end(self) -> None:
        """Request the stop in shared memory, without waiting for the reaction."""
        self.control.program.request_stop(StopCode.STOP_COMMAND)

    def _wait_for_stop(self, bus: BusListener) -> tuple[float, int, float]:
        """Wait for the stop; return time and cycle of the reaction, and the last frame's time."""
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
                raise SystemExit(f"no stop within {PATIENCE_S:g} s")


@dataclass(frozen=True)
class Stops:
    """Latencies of the stops: by the server, and over shared memory.

    Attributes:
        task_ms, bus_ms: Stops by the server: time until the task reacted, and until the last axis's
            quick stop was on the bus [ms].
        memory_ms: Stops over shared memory: time until the last axis's quick stop [ms].
        cycles: Stops over shared memory: cycles until the task reacted.
    """

    task_ms: list[float] = field(default_factory=list)
    bus_ms: list[float] = field(default_factory=list)
    memory_ms: list[float] = field(default_factory=list)
    cycles: list[int] = field(default_factory=list)

    def press(self, moving: Moving) -> None:
        """Stop a motion through the server."""
        time.sleep(random.uniform(1.0, 2.0))
        for times, took_s in zip((self.task_ms, self.bus_ms), moving.post_stop(), strict=True):
            times.append(1e3 * took_s)
        print(
            f"stop {len(self.bus_ms)}: task after {self.task_ms[-1]:.1f} ms, bus after"
            f" {self.bus_ms[-1]:.1f} ms",
            flush=True,
        )

    def press_frozen(self, moving: Moving) -> None:
        """Stop a motion over shared memory while its server is frozen."""
        os.kill(moving.server, signal.SIGSTOP)
        try:
            time.sleep(random.uniform(0.1, 0.3))
            took_s, cycles = moving.stop_by_memory()
        finally:
            os.kill(moving.server, signal.SIGCONT)
        self.memory_ms.append(1e3 * took_s)
        self.cycles.append(cycles)
        print(f"frozen {len(self.cycles)}: {cycles} cycles, {1e3 * took_s:.1f} ms", flush=True)
