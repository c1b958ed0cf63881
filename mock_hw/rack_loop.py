"""`RackLoop`: drives, robot and plate on a lock-step hub in their process; it can run masters too.

A master that is ordered through the pipe runs in this process and thread until it returns. While it
waits, it runs the devices.
"""

from __future__ import annotations

import contextlib
import traceback
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from drivers.canopen.frames import SYNC_COB_ID, Frame
from mock_hw.bus.arbitration import WireFrame
from mock_hw.bus.embedded_client import EmbeddedClient
from mock_hw.bus.embedded_master import HostedHub, hub_joined_by_calls
from mock_hw.bus.hub_member import HubMember
from mock_hw.plate_service import DeviceClient, PlateService

if TYPE_CHECKING:
    from mock_hw.rack import DriveRack

LONGEST_WAIT_S = 0.010
"""Longest time between two snapshots of the axes while the bus is idle [s]."""


class RackLoop:
    """Lets a rack act whenever its wait on the hub is over.

    Args:
        rack: The robot with its drives.
        client: Connection to the hub in this process.
        plate: Service of the plate's amplifier; None without a plate.
        orders: Pipe through which masters are ordered to run; None without masters.
        path: The hub's socket.
    """

    def __init__(
        self,
        rack: DriveRack,
        client: EmbeddedClient,
        plate: PlateService | None,
        orders: Connection | None,
        path: Path,
    ) -> None:
        self._rack = rack
        self._client = client
        self._plate = plate
        self._orders = orders
        self._path = path

    def run(self) -> None:
        """Serve the bus, and run ordered masters, until a `TransportError` ends it."""
        self._begin_wait()
        while True:
            descriptors = self._descriptors()
            if self._orders is not None:
                descriptors.append(self._orders.fileno())
            self._take_turn(descriptors, None)
            if self._orders is not None and self._client.idle and self._orders.poll():
                self._execute_order(self._orders)

    def _run_devices(self, master: HubMember) -> None:
        self._take_turn(self._descriptors(), master)

    def _take_turn(self, descriptors: Sequence[int], master: HubMember | None) -> None:
        """Run the hub until the wait of the devices or of the master is over; let devices act."""
        if not self._client.serve(descriptors, master):
            if self._plate is not None:
                self._plate.serve_port()
        elif not self._client.idle:
            act_on_frames(self._rack, self._client, self._plate, self._client.end_wait())
            self._begin_wait()

    def _begin_wait(self) -> None:
        if self._plate is not None:
            self._plate.follow_port()
        self._client.begin_wait(*next_wait(self._rack))

    def _descriptors(self) -> list[int]:
        return [] if self._plate is None else [self._plate.fileno()]

    def _execute_order(self, orders: Connection) -> None:
        """Run an ordered master to its end; send 0, or 1 if it raised an exception."""
        failed = 0
        try:
            main, arguments = orders.recv()
            with hub_joined_by_calls(self._path, HostedHub(self._client.hub, self._run_devices)):
                main(*arguments)
        except EOFError:  # the program has ended
            self._orders = None
            return
        except Exception:
            traceback.print_exc()
            failed = 1
        with contextlib.suppress(OSError):
            orders.send(failed)


def next_wait(rack: DriveRack) -> tuple[int, bool]:
    """Return the time until which a rack waits [ns], and True if frames end the wait."""
    wake_s = min(rack.next_s, rack.time_s + LONGEST_WAIT_S)
    # Whole nanoseconds, rounded up, so that the wait never ends before `wake_s`.
    return int(wake_s * 1e9) + 1, rack.acts_on_arrival


def act_on_frames(
    rack: DriveRack,
    client: DeviceClient,
    plate: PlateService | None,
    frames: Sequence[WireFrame],
) -> None:
    """Pass received frames to the rack, advance it to the bus's time, and post its answers."""
    for frame in frames:
        data = frame.data[: frame.length]
        rack.receive(Frame(frame.can_id, data), frame.time_ns * 1e-9)
        if plate is not None and frame.can_id == SYNC_COB_ID:
            plate.note_sync(frame.time_ns * 1e-9)
    now_s = client.now_ns * 1e-9
    if now_s >= min(rack.next_s, rack.time_s + LONGEST_WAIT_S):
        rack.advance(now_s)
    for port, time_s, answer in rack.take_frames():
        client.post(answer.cob_id, answer.data, len(answer.data), port, round(time_s * 1e9))
    if plate is not None:
        plate.keep_up()
