"""`PlateService`: runs the plate's amplifier in the drives' process, in step with the robot.

In lock-step, a command to the amplifier arrives at the same simulated time in every run with the
same program. For this purpose, the amplifier receives all commands that were sent before a packet
of the master, before the hub reads this packet.
"""

from __future__ import annotations

import contextlib
import select
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from mock_hw.amplifier.port import AmplifierPort
from mock_hw.bus.arbitration import WireFrame
from mock_hw.bus.bus_client import BusClient
from mock_hw.bus.embedded_client import EmbeddedClient
from mock_hw.bus.hub_client import HubClient

if TYPE_CHECKING:
    from mock_hw.rack import DriveRack

DeviceClient = HubClient | BusClient | EmbeddedClient
"""Type of the connection between the drives and their bus."""

LOCKSTEP_BATCH_S = 0.045
IDLE_BATCH_S = 1.0
"""Longest time by which the amplifier's simulated time is behind the robot's, in lock-step while
the amplifier works, and while it is idle [s]."""


class PlateService:
    """Connects the rack, which moves the robot, with the amplifier of the plate under the robot.

    Args:
        port: The amplifier with its port.
        rack: The robot with its drives.
        client: Connection to the bus, which provides the time.
    """

    def __init__(
        self,
        port: AmplifierPort,
        rack: DriveRack,
        client: DeviceClient,
    ) -> None:
        self._port = port
        self._rack = rack
        self._client = client
        self._edges: list[float] = []
        self._commanded = False
        self._port_fd = -1
        self._epoll = select.epoll()
        if not isinstance(client, EmbeddedClient):
            self._epoll.register(client.fileno(), select.EPOLLIN)

    def note_sync(self, time_s: float) -> None:
        """Store an edge at the amplifier's trigger input, which every SYNC causes."""
        self._edges.append(time_s)

    def keep_up(self) -> None:
        """Advance the amplifier to the robot's time, if it is further behind than allowed."""
        behind_s = self._rack.time_s - self._port.time_s
        if not self._port.works:
            allowed_s = IDLE_BATCH_S
        else:
            allowed_s = LOCKSTEP_BATCH_S if self._client.lockstep else 0.0
        if behind_s > allowed_s:
            self._catch_up()

    def wait(self, until_ns: int, on_frames: bool) -> Sequence[WireFrame]:
        """Wait as `BusClient.wait` does; execute commands from the port during the wait.

        Raises:
            TransportError: The hub has ended.
        """
        self.follow_port()
        frames = self._client.wait(0)
        if frames:
            return frames
        until_s = min(until_ns * 1e-9, self._port.next_s)
        self._poll(max(0.0, until_s - time.monotonic()))
        if self._commanded:
            self._execute_commands(time.monotonic())
        else:
            self._port.advance(time.monotonic())
        return self._client.wait(0)

    def fileno(self) -> int:
        """Return the file descriptor that is readable if a command may wait at the port."""
        return self._epoll.fileno()

    def serve_port(self) -> None:
        """Execute the commands at the port, in lock-step."""
        self._poll(0.0)
        if self._commanded:
            self._execute_commands(None)

    def follow_port(self) -> None:
        """Register the port's present file descriptor in epoll, before each wait.

        The registration is edge-triggered, because a port that no program has open is always ready.
        """
        fd = self._port.fileno()
        if fd == self._port_fd:
            return
        if self._port_fd >= 0:
            with contextlib.suppress(OSError):  # epoll removes closed ports itself
                self._epoll.unregister(self._port_fd)
        if fd >= 0:
            self._epoll.register(fd, select.EPOLLIN | select.EPOLLET)
        self._port_fd = fd

    def close(self) -> None:
        """Close the port."""
        self._epoll.close()
        self._port.close()

    def _poll(self, timeout_s: float) -> None:
        """Wait for commands at the port and, in real time, for frames of the bus."""
        if any(fd == self._port_fd for fd, _ in self._epoll.poll(timeout_s)):
            self._commanded = True

    def _execute_commands(self, now_s: float | None) -> None:
        self._commanded = False
        data = self._port.read()
        if not data:  # a program opened or closed the port
            return
        self._catch_up()
        self._port.receive(data, self._rack.base_wrench, now_s)
        self._rack.watch_base(self._port.watches)

    def _catch_up(self) -> None:
        edges, self._edges = self._edges, []
        ends_s, wrenches = self._rack.take_base_wrenches()
        self._port.apply_loads(self._rack.time_s, ends_s, wrenches, edges)
