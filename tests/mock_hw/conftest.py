"""Fixtures: a hub in the test's process, and a drive with an ideal axis on simulated time."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from fractions import Fraction
from io import StringIO
from pathlib import Path

import pytest

from drivers.canopen.frames import Frame, sdo_answer_cob_id, sdo_request_cob_id
from mock_hw.bus.faults import BusFaults
from mock_hw.bus.hub import CanHub
from mock_hw.bus.hub_client import HubClient
from mock_hw.bus.hub_process import listening_socket
from mock_hw.bus.hub_protocol import HubRole
from mock_hw.drive.axis import AxisPort
from mock_hw.drive.drive import SimulatedDrive
from mock_hw.drive.objects import SimulatedIdentity


class ServedHub:
    """A hub, its path, and the clients of the test."""

    def __init__(self, path: Path, log: StringIO) -> None:
        self.path = path
        self.log = log
        self.clients: list[HubClient] = []

    def join(self, role: HubRole, urgent: tuple[int, ...] = ()) -> HubClient:
        self.clients.append(HubClient(self.path, role, urgent))
        return self.clients[-1]


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., ServedHub]]:
    """Return a function that serves a hub until the test's end."""
    hubs: list[ServedHub] = []
    stoppers: list[tuple[int, threading.Thread]] = []

    def start(
        *,
        realtime: bool = False,
        bitrate: int = 1_000_000,
        pace: float | None = None,
        faults: BusFaults | None = None,
    ) -> ServedHub:
        path = tmp_path / f"hub{len(stoppers)}.sock"
        stop, stopper = os.pipe()
        log = StringIO()
        ready = threading.Event()

        def run() -> None:
            with listening_socket(path) as listener:
                hub = CanHub(
                    listener,
                    bitrate,
                    realtime=realtime,
                    pace=pace,
                    channel="test",
                    log=log,
                    faults=faults,
                )
                ready.set()
                hub.run([stop])
                hub.close()
            os.close(stop)

        thread = threading.Thread(target=run)
        thread.start()
        stoppers.append((stopper, thread))
        assert ready.wait(120.0)
        hubs.append(ServedHub(path, log))
        return hubs[-1]

    yield start
    for hub in hubs:
        for client in hub.clients:
            client.close()
    for stopper, thread in stoppers:
        os.write(stopper, b"x")
        thread.join(120.0)
        assert not thread.is_alive()
        os.close(stopper)


class IdealAxis(AxisPort):
    """An axis that follows its commands exactly, unless it is blocked."""

    def __init__(self) -> None:
        self.counts = 0.0
        self.rate = 0.0
        self.torque = 0
        self.blocked = False

    def position_counts(self) -> int:
        return round(self.counts)

    def velocity_counts_s(self) -> float:
        return self.rate

    def torque_permille(self) -> int:
        return self.torque

    def digital_inputs(self) -> int:
        return 0


class Bench:
    """A drive with an ideal axis, and their simulated time."""

    STEP_S = 0.001

    def __init__(self, node_id: int = 3) -> None:
        self.node_id = node_id
        self.axis = IdealAxis()
        identity = SimulatedIdentity(node_id, 4096, Fraction(100), 2000)
        self.drive = SimulatedDrive(identity, self.axis)
        self.now_s = 0.0
        self.sent: list[tuple[float, Frame]] = []

    def run_to(self, time_s: float) -> None:
        """Advance time in small steps; the drive acts whenever an action is due."""
        while True:
            due_s = max(self.now_s, min(self.drive.next_s, time_s))
            while self.now_s < due_s:
                end_s = min(due_s, self.now_s + self.STEP_S)
                command = self.drive.axis.command(self.now_s, end_s)
                mean = 0.5 * (command.velocity_start + command.velocity_end)
                moves = command.powered and not self.axis.blocked
                self.axis.rate = command.velocity_end if moves else 0.0
                self.axis.counts += mean * (end_s - self.now_s) if moves else 0.0
                self.now_s = end_s
                self.drive.axis.observe(end_s)
            if self.drive.next_s > self.now_s:
                self._collect()
                if self.now_s >= time_s:
                    return
            else:
                self.drive.advance(self.now_s)

    def run_for(self, duration_s: float) -> None:
        self.run_to(self.now_s + duration_s)

    def receive(self, frame: Frame) -> None:
        self.drive.receive(frame, self.now_s)
        self._collect()

    def take(self, cob_id: int | None = None) -> list[tuple[float, Frame]]:
        """Return the frames sent since the last call, of one identifier or of all."""
        self._collect()
        kept, self.sent = self.sent, []
        return [item for item in kept if cob_id is None or item[1].cob_id == cob_id]

    def _collect(self) -> None:
        self.sent += self.drive.take_frames()

    # SDO access of a client on the bus

    def sdo(self, request: bytes) -> bytes:
        self.take()
        self.receive(Frame(sdo_request_cob_id(self.node_id), request.ljust(8, b"\0")))
        ((_, answer),) = self.take(sdo_answer_cob_id(self.node_id))
        return answer.data

    def write(self, index: int, subindex: int, value: int, size: int) -> int:
        """Write an object; return the abort code, or 0 if it was accepted."""
        data = (value & (1 << 8 * size) - 1).to_bytes(size, "little")
        command = bytes((0x23 | (4 - size) << 2,)) + index.to_bytes(2, "little")
        answer = self.sdo(command + bytes((subindex,)) + data)
        return int.from_bytes(answer[4:], "little") if answer[0] == 0x80 else 0

    def read(self, index: int, subindex: int = 0, *, signed: bool = False) -> int:
        """Read an object of at most four bytes."""
        answer = self.sdo(b"\x40" + index.to_bytes(2, "little") + bytes((subindex,)))
        assert answer[0] & 0xE3 == 0x43, answer.hex()
        size = 4 - (answer[0] >> 2 & 3)
        return int.from_bytes(answer[4 : 4 + size], "little", signed=signed)

    # The master's part

    def configure(self, **watchdogs: int) -> None:
        """Map the usual PDOs and set the watchdogs; then NMT start."""
        self.run_to(0.05)
        node = self.node_id
        for index, base, objects in (
            (0x1400, 0x200, (0x6040_0010, 0x60FF_0020, 0x60B2_0010)),
            (0x1800, 0x180, (0x6041_0010, 0x6064_0020, 0x6077_0010)),
        ):
            assert not self.write(index, 1, 0x8000_0000 | base + node, 4)
            assert not self.write(index + 0x200, 0, 0, 1)
            for place, entry in enumerate(objects, start=1):
                assert not self.write(index + 0x200, place, entry, 4)
            assert not self.write(index + 0x200, 0, 3, 1)
            assert not self.write(index, 2, 1, 1)
            assert not self.write(index, 1, base + node, 4)
        consumer = 127 << 16 | watchdogs.get("heartbeat_ms", 0)
        assert not self.write(0x1016, 1, consumer if watchdogs.get("heartbeat_ms") else 0, 4)
        assert not self.write(0x1006, 0, watchdogs.get("sync_us", 0), 4)
        assert not self.write(0x1400, 5, watchdogs.get("rpdo_ms", 0), 2)
        assert not self.write(0x6007, 0, watchdogs.get("abort_connection", 3), 2)
        assert not self.write(0x6085, 0, watchdogs.get("quick_stop_deceleration", 1_000_000), 4)
        assert not self.write(0x6060, 0, 9, 1)
        assert not self.write(0x60C2, 1, 8, 1)
        self.receive(Frame(0, b"\x01\x00"))

    def cycle(self, controlword: int, velocity: int = 0, *, beat: bool = True) -> None:
        """Run one cycle of 8 ms: SYNC, the next set-point, the master's heartbeat."""
        self.receive(Frame(0x80, b""))
        data = controlword.to_bytes(2, "little") + velocity.to_bytes(4, "little", signed=True)
        self.receive(Frame(0x200 + self.node_id, data + b"\0\0"))
        if beat:
            self.receive(Frame(0x700 + 127, b"\x05"))
        self.run_for(0.008)

    def enable(self, velocity: int = 0) -> None:
        """Bring the drive to Operation Enabled, then to a velocity in the drive's unit."""
        for word in (0x0000, 0x0006, 0x0007, 0x000F, 0x000F):
            self.cycle(word)
        for _ in range(3):
            self.cycle(0x000F, velocity)


@pytest.fixture
def bench() -> Bench:
    return Bench()
