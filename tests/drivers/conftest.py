"""Fixtures: a bus with simulated time and small scripted drives on it."""

from __future__ import annotations

import heapq
import itertools
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import can
import numpy as np
import pytest

from config.cell.cell import CanBusConfig, CellConfig, DriveAxis
from config.cell.drive_safety import DriveSafety
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from drivers.canopen.emcy import Emergency, emcy_frame
from drivers.canopen.frames import SYNC, Frame, rpdo_cob_id, tpdo_cob_id
from drivers.canopen.heartbeat import heartbeat_frame
from drivers.canopen.nmt import NmtCommand, NmtState, next_nmt_state, parse_nmt
from drivers.canopen.pdo import INVALID, MappedObject, split
from drivers.canopen.sdo import SdoAbort, SdoCode
from drivers.canopen.sdo_server import SdoServer
from drivers.ports.can_link import CanLink
from drivers.servo.axes import CanServoAxes
from drivers.servo.cia402 import PowerState, after_controlword

WIRE_S = 120e-6


class FakeClock:
    def __init__(self, bus: FakeBus) -> None:
        self._bus = bus

    def now_s(self) -> float:
        return self._bus.now_s

    def sleep_until(self, time_s: float) -> None:
        self._bus.run_until(time_s)


class FakeBus(can.BusABC):
    """Delivers device frames in time order; time advances only while the master waits."""

    channel_info = "fake"

    def __init__(self) -> None:
        super().__init__("fake")
        self.now_s = 10.0
        self.simulated_clock = FakeClock(self)
        self.devices: list[Any] = []
        self.sent: list[tuple[float, Frame]] = []
        self.closed = False
        self.broken = False
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._arrived: list[tuple[float, Frame]] = []
        self._count = itertools.count()

    def at(self, time_s: float, action: Callable[[], None]) -> None:
        """Call a function at a given time, as a device would."""
        heapq.heappush(self._events, (time_s, next(self._count), action))

    def transmit(self, frame: Frame, delay_s: float = WIRE_S) -> None:
        """Deliver a device's frame to the master after `delay_s`."""
        arrival_s = self.now_s + delay_s
        self.at(arrival_s, lambda: self._arrived.append((arrival_s, frame)))

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.broken:
            raise can.CanOperationError("no buffer space available")
        frame = Frame(msg.arbitration_id, bytes(msg.data))
        self.sent.append((self.now_s, frame))
        for device in self.devices:
            device.take(frame)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        if self.broken:
            raise can.CanOperationError("network is down")
        assert timeout is not None, "a driver must never wait without a timeout"
        until_s = self.now_s + timeout
        while not self._arrived:
            if not self._events or self._events[0][0] > until_s:
                self.now_s = max(self.now_s, until_s)
                return None
            self._step()
        time_s, frame = self._arrived.pop(0)
        return can.Message(
            timestamp=time_s, arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False
        )

    def run_until(self, time_s: float) -> None:
        while self._events and self._events[0][0] <= time_s:
            self._step()
        self.now_s = max(self.now_s, time_s)

    def _step(self) -> None:
        time_s, _, action = heapq.heappop(self._events)
        self.now_s = max(self.now_s, time_s)
        action()

    def shutdown(self) -> None:
        super().shutdown()
        self.closed = True

    def sent_to(self, cob_id: int) -> list[bytes]:
        """Return the data of all frames with an identifier, in order."""
        return [frame.data for _, frame in self.sent if frame.cob_id == cob_id]


DEFAULT_OBJECTS: dict[tuple[int, int], tuple[int, int]] = {
    # (index, subindex): (bytes, value)
    (0x1000, 0): (4, 0x0002_0192),
    (0x1001, 0): (1, 0),
    (0x1005, 0): (4, 0x80),
    (0x1006, 0): (4, 0),
    (0x1016, 1): (4, 0),
    (0x1017, 0): (2, 0),
    (0x1018, 1): (4, 0x1234),
    (0x1029, 1): (1, 0),
    (0x1400, 1): (4, 0x200),
    (0x1400, 2): (1, 255),
    (0x1400, 5): (2, 0),
    (0x1401, 1): (4, 0x300),
    (0x1800, 1): (4, 0x180),
    (0x1800, 2): (1, 255),
    (0x1801, 1): (4, 0x280),
    (0x1802, 1): (4, 0x380 | INVALID),
    (0x603F, 0): (2, 0),
    (0x6007, 0): (2, 0),
    (0x6040, 0): (2, 0),
    (0x6041, 0): (2, 0),
    (0x605A, 0): (2, 2),
    (0x605E, 0): (2, 2),
    (0x6060, 0): (1, 0),
    (0x6064, 0): (4, 1000),
    (0x6065, 0): (4, 0),
    (0x6066, 0): (2, 0),
    (0x6072, 0): (2, 1000),
    (0x6076, 0): (4, 2000),
    (0x6077, 0): (2, 50),
    (0x6085, 0): (4, 0),
    (0x608F, 1): (4, 4096),
    (0x608F, 2): (4, 1),
    (0x6091, 1): (4, 100),
    (0x6091, 2): (4, 1),
    (0x60B2, 0): (2, 0),
    (0x60C2, 1): (1, 1),
    (0x60C2, 2): (1, -3),
    (0x60FF, 0): (4, 0),
    (0x6502, 0): (4, 0x3ED),
}
ALL_MAPPINGS = {
    (0x1600 + base, sub): (1 if sub == 0 else 4, 0) for base in (0, 0x400) for sub in range(9)
}


@dataclass
class ScriptedDrive:
    """CiA 402 drive without physics: its position changes by its velocity at every SYNC."""

    bus: FakeBus
    node_id: int
    cycle_time_s: float = 0.008
    ignored: set[tuple[int, int]] = field(default_factory=set)
    state: PowerState = PowerState.SWITCH_ON_DISABLED
    nmt: NmtState = NmtState.PRE_OPERATIONAL
    mute: bool = False
    answers_sync: bool = True
    tpdo_bytes: int = 8
    boots: int = 1
    follows: int = 0x1000
    quick_stop_syncs: int = 3
    clears_fault: bool = False

    def __post_init__(self) -> None:
        self.objects = {
            key: value.to_bytes(size, "little", signed=value < 0)
            for key, (size, value) in (DEFAULT_OBJECTS | ALL_MAPPINGS).items()
        }
        self.objects[0x1008, 0] = b"drive \x1b[31mred\0"
        self.server = SdoServer(self.node_id, self.read, self.write)
        self.writes: list[tuple[int, int, int]] = []
        self.latched = b""
        self.word = 0
        self.velocity = 0
        self.beat_generation = 0
        self.bus.devices.append(self)

    def read(self, index: int, subindex: int) -> bytes:
        if (index, subindex) == (0x6041, 0):
            return self.status().to_bytes(2, "little")
        try:
            return self.objects[index, subindex]
        except KeyError:
            raise SdoAbort(SdoCode.NO_OBJECT) from None

    def write(self, index: int, subindex: int, data: bytes) -> None:
        held = self.read(index, subindex)
        if len(data) != len(held):
            raise SdoAbort(SdoCode.LENGTH_MISMATCH)
        self.writes.append((index, subindex, int.from_bytes(data, "little")))
        if (index, subindex) in self.ignored:
            return
        mapping = 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00
        if mapping and subindex and self.objects[index, 0] != b"\0":
            raise SdoAbort(SdoCode.UNSUPPORTED_ACCESS)
        if mapping and not int.from_bytes(self.objects[index - 0x200, 1], "little") & INVALID:
            raise SdoAbort(SdoCode.UNSUPPORTED_ACCESS)
        self.objects[index, subindex] = data
        if (index, subindex) == (0x1017, 0):
            self.beat_generation += 1
            self.beat(self.beat_generation)
        if (index, subindex) == (0x6040, 0):
            self.obey(int.from_bytes(data, "little"))

    def take(self, frame: Frame) -> None:
        if self.mute:
            return
        command = parse_nmt(frame, self.node_id)
        if command is not None:
            self.obey_nmt(command)
        elif frame == SYNC and self.nmt is NmtState.OPERATIONAL:
            self.on_sync()
        elif frame.cob_id == rpdo_cob_id(self.node_id):
            if self.nmt is NmtState.OPERATIONAL:
                self.latched = frame.data
        else:
            for answer in self.server.handle(frame, self.bus.now_s):
                self.bus.transmit(answer)

    def obey_nmt(self, command: NmtCommand) -> None:
        self.nmt = next_nmt_state(self.nmt, command)
        if self.nmt is NmtState.INITIALISING:
            self.beat_generation += 1
            for boot in range(self.boots):
                self.bus.transmit(
                    heartbeat_frame(self.node_id, NmtState.INITIALISING), 0.005 + boot * 0.001
                )
            self.nmt = NmtState.PRE_OPERATIONAL

    def beat(self, generation: int) -> None:
        period_ms = int.from_bytes(self.objects[0x1017, 0], "little")
        if not period_ms or generation != self.beat_generation or self.mute:
            return
        self.bus.transmit(heartbeat_frame(self.node_id, self.nmt), 0.0)
        self.bus.at(self.bus.now_s + period_ms / 1000.0, lambda: self.beat(generation))

    def mapped(self, index: int) -> tuple[MappedObject, ...]:
        subs = range(1, self.objects[index, 0][0] + 1)
        return tuple(
            MappedObject.parse(int.from_bytes(self.objects[index, sub], "little")) for sub in subs
        )

    def status(self) -> int:
        return self.state | (self.follows if self.state is PowerState.OPERATION_ENABLED else 0)

    def on_sync(self) -> None:
        if self.latched:
            objects = self.mapped(0x1600)
            for item, part in zip(objects, split(objects, self.latched), strict=True):
                self.objects[item.index, item.subindex] = part
            self.latched = b""
            self.obey(int.from_bytes(self.objects[0x6040, 0], "little"))
        moving = self.state is PowerState.OPERATION_ENABLED
        target = int.from_bytes(self.objects[0x60FF, 0], "little", signed=True)
        self.velocity = target if moving else 0
        counts = int.from_bytes(self.objects[0x6064, 0], "little", signed=True)
        counts += round(self.velocity * self.cycle_time_s)
        lowest, highest = self.position_range()
        counts = (counts - lowest) % (highest - lowest + 1) + lowest
        self.objects[0x6064, 0] = counts.to_bytes(4, "little", signed=True)
        if self.answers_sync:
            data = b"".join(self.read(item.index, item.subindex) for item in self.mapped(0x1A00))
            self.bus.transmit(
                Frame(tpdo_cob_id(self.node_id), data[: self.tpdo_bytes]), WIRE_S * self.node_id
            )
        if self.state is PowerState.QUICK_STOP_ACTIVE:
            self.quick_stop_syncs -= 1
            if self.quick_stop_syncs <= 0:
                self.state = PowerState.SWITCH_ON_DISABLED

    def position_range(self) -> tuple[int, int]:
        """Return the lowest and highest value of 6064h, from 607Bh if the drive has it."""
        if (0x607B, 1) not in self.objects:
            return -(2**31), 2**31 - 1
        held = (self.objects[0x607B, sub] for sub in (1, 2))
        lowest, highest = (int.from_bytes(data, "little", signed=True) for data in held)
        return lowest, highest

    def obey(self, word: int) -> None:
        self.state = after_controlword(self.state, word, self.word)
        self.word = word

    def emergency(self, code: int, register: int = 0x01) -> None:
        self.bus.transmit(emcy_frame(self.node_id, Emergency(code, register)))


@dataclass
class Bench:
    """Cell under test: bus, drives and the driver."""

    bus: FakeBus
    drives: list[ScriptedDrive]
    cell: CellConfig
    robot: RobotDescription
    link: CanLink
    axes: CanServoAxes
    sync_time_s: float = 0.0

    def enabled(self) -> CanServoAxes:
        self.axes.bring_up()
        self.axes.start()
        self.sync_time_s = self.axes.enable()
        return self.axes

    def cycle(self, velocity: Any) -> bool:
        clock = self.link.clock
        clock.sleep_until(self.sync_time_s + self.cell.cycle_time_s)
        self.sync_time_s = self.axes.exchange()
        sent = self.axes.command(np.array(velocity, dtype=np.float64))
        self.axes.send_heartbeat(clock.now_s())
        return sent

    def commands(self, node: int) -> list[tuple[int, int]]:  # controlword, velocity
        return [struct.unpack("<Hi", data) for data in self.bus.sent_to(0x200 + node)]

    def arrives(self, frame: Frame, after_next_sync_s: float) -> None:
        """Let a frame arrive `after_next_sync_s` after the next SYNC."""
        at_s = self.sync_time_s + self.cell.cycle_time_s + after_next_sync_s
        self.bus.transmit(frame, at_s - self.bus.now_s)

    def found(self, object_name: str, node_id: int = 1) -> Any:
        (setting,) = (
            s for s in self.axes.settings() if s.object_name == object_name and s.node_id == node_id
        )
        return setting


def joint(name: str) -> Joint:
    limits = JointLimits(
        position_min=-3.0, position_max=3.0, velocity=2.0, acceleration=10.0, torque=500.0
    )
    return Joint(name=name, limits=limits, gear_ratio=100.0)


@pytest.fixture
def default_objects() -> dict[tuple[int, int], tuple[int, int]]:
    """Every object of the scripted drive: (index, subindex) to (size in bytes, value)."""
    return DEFAULT_OBJECTS | ALL_MAPPINGS


@pytest.fixture
def robot() -> RobotDescription:
    rows = tuple(KinematicRow(a_m=0.1) for _ in range(3))
    return RobotDescription(
        name="three",
        kinematics=Kinematics(convention="modified_dh", rows=rows),
        joints=(joint("base"), joint("shoulder"), joint("elbow")),
    )


@pytest.fixture
def cell() -> CellConfig:
    return CellConfig(
        name="bench",
        robot="three",
        cycle_time_ms=8,
        can=CanBusConfig(interface="virtual", channel="bench"),
        axes=(
            DriveAxis(joint="shoulder", node_id=2, direction=-1),
            DriveAxis(joint="base", node_id=1, position_zero_counts=1000),
            DriveAxis(joint="elbow", node_id=3, velocity_unit="0.1rpm"),
        ),
        position_gain_per_s=10.0,
        drive_safety=DriveSafety(quick_stop_deceleration_rad_s2=10.0, following_error_rad=0.05),
    )


@pytest.fixture
def make_bench(robot: RobotDescription) -> Iterator[Callable[[CellConfig], Bench]]:
    buses: list[FakeBus] = []

    def make(cell: CellConfig) -> Bench:
        bus = FakeBus()
        buses.append(bus)
        drives = [ScriptedDrive(bus, node) for node in (1, 2, 3)]
        link = CanLink(bus)
        return Bench(bus, drives, cell, robot, link, CanServoAxes(link, cell, robot))

    yield make
    for bus in buses:
        bus.shutdown()


@pytest.fixture
def bench(make_bench: Callable[[CellConfig], Bench], cell: CellConfig) -> Bench:
    return make_bench(cell)
