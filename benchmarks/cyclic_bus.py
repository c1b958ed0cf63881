"""Simulated bus of `benchmarks.cyclic` with transmission times, and drives that answer SYNC."""

from __future__ import annotations

import gc
import math
import multiprocessing
import shutil
import struct
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from drivers.canopen.bus_load import cyclic_load
from drivers.canopen.frames import SYNC_COB_ID, heartbeat_cob_id, rpdo_cob_id, tpdo_cob_id
from mock_hw.bus.hub_client import HubClient
from mock_hw.bus.hub_process import HubSettings, serve_hub
from mock_hw.bus.hub_protocol import HubRole
from mock_hw.host.device_process import request_exact_timing

BITRATE = 1_000_000
HEARTBEAT_S, DRIVE_HEARTBEAT_S, STATUS_S = 0.025, 0.05, 0.1
STATUS_ENABLED = 0x1637
ANSWER_NS = 20_000
"""Response time of a drive [ns]."""

FULL, TRIMMED = struct.Struct("<Hih"), struct.Struct("<ih")


@dataclass(frozen=True)
class Scenario:
    """Scenario of a measurement: number of axes, cycle time, and full or trimmed frames."""

    axes: int
    cycle_time_s: float
    trimmed: bool

    def __str__(self) -> str:
        """Return a short description."""
        frames = "trimmed" if self.trimmed else "full"
        return f"{self.axes} axes, {1 / self.cycle_time_s:.0f} Hz, {frames} frames"

    @property
    def burst_s(self) -> float:
        """Shortest time of SYNC and all answers on the wire [s]."""
        bits = (self.axes + 1) * 47 + 8 * (6 if self.trimmed else 8) * self.axes
        return bits / BITRATE

    @property
    def load(self) -> float:
        """Bus load, as a fraction of the bandwidth."""
        return cyclic_load(
            self.axes,
            self.cycle_time_s,
            BITRATE,
            heartbeats_s=(HEARTBEAT_S, DRIVE_HEARTBEAT_S),
            frame_bytes=(4, 6) if self.trimmed else (6, 8),
            status_s=STATUS_S if self.trimmed else math.inf,
        )


def play_drives(path: Path, pipe: Connection) -> None:
    """Answer every SYNC until the pipe has a message; then send the counts of SYNCs and targets."""
    scenario: Scenario = pipe.recv()
    client = HubClient(path, HubRole.DEVICE)
    gc.freeze()
    gc.disable()
    request_exact_timing(realtime=True)
    nodes = range(1, scenario.axes + 1)
    commands = {rpdo_cob_id(node) for node in nodes}
    beats, statuses = (round(s / scenario.cycle_time_s) for s in (DRIVE_HEARTBEAT_S, STATUS_S))
    syncs = set_points = 0
    pipe.send(None)
    while not pipe.poll(0):
        for frame in client.wait(time.monotonic_ns() + 100_000_000):
            set_points += frame.can_id in commands
            if frame.can_id != SYNC_COB_ID:
                continue
            syncs += 1
            at_ns = frame.time_ns + ANSWER_NS
            for node in nodes:
                counts = (1000 + syncs) * node
                if scenario.trimmed:
                    client.post(tpdo_cob_id(node), TRIMMED.pack(counts, 5), 6, node, at_ns)
                    if syncs % statuses == 10 * node:
                        status = STATUS_ENABLED.to_bytes(2, "little")
                        client.post(tpdo_cob_id(node, 2), status, 2, node, at_ns)
                else:
                    data = FULL.pack(STATUS_ENABLED, counts, 5)
                    client.post(tpdo_cob_id(node), data, 8, node, at_ns)
                if syncs % beats == 3 * node:
                    client.post(heartbeat_cob_id(node), b"\x05", 1, node, at_ns)
    pipe.send((syncs, set_points))
    client.close()


@contextmanager
def serve_bus(scenario: Scenario) -> Iterator[tuple[Path, Connection]]:
    """Run the bus and its drives; yield the path of the bus and the pipe to the drives."""
    context = multiprocessing.get_context("spawn")
    folder = Path(tempfile.mkdtemp(prefix="cyclic-"))
    path = folder / "bus.sock"
    hub_pipe, hub_end = context.Pipe()
    hub = context.Process(
        target=serve_hub, args=(HubSettings(path, BITRATE, True, "bus"), hub_end), daemon=True
    )
    hub.start()
    assert hub_pipe.recv() is None
    pipe, end = context.Pipe()
    drives = context.Process(target=play_drives, args=(path, end), daemon=True)
    drives.start()
    pipe.send(scenario)
    pipe.recv()
    try:
        yield path, pipe
    finally:
        drives.terminate()
        hub.terminate()
        drives.join()
        hub.join()
        shutil.rmtree(folder, ignore_errors=True)
