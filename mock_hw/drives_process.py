"""The simulated drives and their robot as a process: between the bus and a `DriveRack`."""

from __future__ import annotations

import contextlib
import gc
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from config.cell import CellConfig
from config.errors import RidDaqError, TransportError
from config.plant import PlantConfig
from config.robot import RobotDescription
from drivers.canopen.frames import NMT_COB_ID, SYNC_COB_ID, Frame, sdo_request_cob_id
from mock_hw.axis_snapshot import SnapshotWriter
from mock_hw.drive_rack import DriveRack
from mock_hw.hub_client import HubClient
from mock_hw.hub_process import leave_interrupts_to_parent
from mock_hw.hub_protocol import Role

LONGEST_WAIT_S = 0.010
"""How old the axes' snapshot may become while nothing happens on the bus [s]."""


@dataclass(frozen=True)
class DrivesSettings:
    """What the drives' process is told."""

    cell: CellConfig
    robot: RobotDescription
    plant: PlantConfig
    seed: int
    socket: Path
    snapshot: Path


def serve_drives(settings: DrivesSettings, ready: Connection) -> None:
    """Be a cell's drives until the hub is gone.

    Sends None through `ready` once they are on the bus, or the text of what went wrong.
    """
    leave_interrupts_to_parent()
    try:
        _warm_up(settings)
        urgent = [NMT_COB_ID, SYNC_COB_ID]
        urgent += [sdo_request_cob_id(axis.node_id) for axis in settings.cell.axes]
        snapshots = SnapshotWriter(settings.snapshot, len(settings.robot.joints))
        client = HubClient(settings.socket, Role.DEVICE, urgent)
        rack = DriveRack(
            settings.cell,
            settings.robot,
            settings.plant,
            settings.seed,
            snapshots,
            client.now_ns * 1e-9,
        )
    except (OSError, RidDaqError) as error:
        with contextlib.suppress(OSError):
            ready.send(str(error))
        return
    gc.freeze()
    ready.send(None)
    ready.close()
    with contextlib.suppress(TransportError):
        run_rack(rack, client)
    client.close()


def run_rack(rack: DriveRack, client: HubClient) -> None:
    """Serve the bus; ends with the `TransportError` of a hub that is gone."""
    while True:
        wake_s = min(rack.next_s, rack.time_s + LONGEST_WAIT_S)
        # The first whole nanosecond that is surely not before it.
        frames = client.wait(int(wake_s * 1e9) + 1, on_frames=rack.acts_on_arrival)
        for frame in frames:
            data = frame.data[: frame.length]
            rack.receive(Frame(frame.can_id, data), frame.time_ns * 1e-9)
        now_s = client.now_ns * 1e-9
        if now_s >= min(rack.next_s, rack.time_s + LONGEST_WAIT_S):
            rack.advance_to(now_s)
        for port, time_s, answer in rack.take_frames():
            client.post(answer.cob_id, answer.data, len(answer.data), port, round(time_s * 1e9))


def _warm_up(settings: DrivesSettings) -> None:
    """Have the plant's kernels compiled before anybody waits for them."""
    cell, robot, plant = settings.cell, settings.robot, settings.plant
    DriveRack(cell, robot, plant, settings.seed).advance_to(LONGEST_WAIT_S)
