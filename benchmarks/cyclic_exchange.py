"""CPU time of one cycle of the CAN driver, compared with a minimal loop with the same frames.

A separate process simulates three drives over a local socket. A cycle is SYNC, three answers that
are decoded into arrays, and three set-points.

Run it with ``python -m benchmarks.cyclic_exchange [--quick]``.
"""

from __future__ import annotations

import gc
import json
import multiprocessing
import select
import socket
import struct
import sys
import time
from collections.abc import Callable

import can
import numpy as np

from benchmarks.short_form import is_short
from config.cell.drive_safety import DriveSafety
from drivers.ports.can_link import CanLink
from drivers.ports.can_ports import FramePort
from drivers.ports.socketcan_port import SocketCanPort
from drivers.servo.cia402 import AxisUnits
from drivers.servo.cyclic_exchange import CyclicExchange
from drivers.servo.drive_watch import DriveWatch

AXES = 3
BAR_US = 150.0
CAN_FRAME = struct.Struct("<IB3x8s")
ANSWERS = [
    CAN_FRAME.pack(0x181 + axis, 8, struct.pack("<Hih", 0x1027, 1000, 5)) for axis in range(AXES)
]


def play_drives(bus: socket.socket) -> None:
    """Answer every SYNC with all TPDOs until the other end closes."""
    while data := bus.recv(16):
        if CAN_FRAME.unpack(data)[0] == 0x80:
            for answer in ANSWERS:
                bus.send(answer)


class SocketBus(can.BusABC):
    """Minimal python-can bus on a socket with 16-byte frames."""

    channel_info = "local socket"

    def __init__(self, bus: socket.socket) -> None:
        self._bus = bus
        super().__init__("local")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send one frame."""
        self._bus.send(CAN_FRAME.pack(msg.arbitration_id, msg.dlc, bytes(msg.data)))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not select.select([self._bus], [], [], timeout)[0]:
            return None, True
        cob_id, length, data = CAN_FRAME.unpack(self._bus.recv(16))
        return can.Message(arbitration_id=cob_id, data=data[:length], is_extended_id=False), True


class LocalSocketCanPort(SocketCanPort):
    """`SocketCanPort` on a local socket with 16-byte frames, instead of a CAN interface."""

    def __init__(self, bus: socket.socket) -> None:
        self._bus = bus
        super().__init__("local")

    def _open(self, channel: str, watch_errors: bool) -> socket.socket:
        return self._bus


def driver_cycle(bus: can.BusABC | FramePort) -> Callable[[], None]:
    """Return a function that runs one exchange cycle with our driver."""
    nodes = tuple(range(1, AXES + 1))
    safety = DriveSafety(quick_stop_deceleration_rad_s2=10.0, following_error_rad=0.1)
    watch = DriveWatch([f"joint{node}" for node in nodes], nodes, safety)
    exchange = CyclicExchange(CanLink(bus), nodes, watch)
    exchange.use_units([AxisUnits(65190.0, 65190.0, 65190.0, 0.2)] * AXES)
    velocity = np.full(AXES, 0.1)

    def cycle() -> None:
        exchange.collect(exchange.sync() + 1.0)
        exchange.send_velocities(velocity)

    return cycle


def bare_cycle(bus: socket.socket) -> Callable[[], None]:
    """Return the limit: the same frames without python-can, units, checks or arrays."""
    sync = CAN_FRAME.pack(0x80, 0, b"")
    commands = [CAN_FRAME.pack(0x201 + axis, 8, bytes(8)) for axis in range(AXES)]

    def cycle() -> None:
        bus.send(sync)
        for _ in range(AXES):
            select.select([bus], [], [], 1.0)
            CAN_FRAME.unpack(bus.recv(16))
        for command in commands:
            bus.send(command)

    return cycle


def cpu_us(cycle: Callable[[], None], cycles: int, pause_s: float) -> float:
    """Return the CPU time per cycle, averaged over `cycles`; the lowest of five rounds [us]."""
    rounds = []
    for _ in range(5):
        began_s = time.process_time()
        for _ in range(cycles):
            if pause_s:
                time.sleep(pause_s)
            cycle()
        rounds.append((time.process_time() - began_s) / cycles * 1e6)
    return min(rounds)


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    cycles = 500 if is_short(__doc__) else 4000
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    context = multiprocessing.get_context("spawn")
    drives = context.Process(target=play_drives, args=(theirs,), daemon=True)
    drives.start()
    theirs.close()
    gc.freeze()
    gc.disable()
    bus = SocketBus(ours)
    driver, bare = driver_cycle(bus), bare_cycle(ours)
    value, limit = cpu_us(driver, cycles, 0.0), cpu_us(bare, cycles, 0.0)
    paused = cycles // 10
    value_8ms, limit_8ms = cpu_us(driver, paused, 0.008), cpu_us(bare, paused, 0.008)
    bus.shutdown()
    ours.close()
    drives.join(10.0)
    print(f"back to back: driver {value:.1f} us, bare loop {limit:.1f} us of CPU a cycle")
    print(f"every 8 ms:   driver {value_8ms:.1f} us, bare loop {limit_8ms:.1f} us (sleep included)")
    holds = value <= BAR_US
    result = {
        "name": "cyclic_exchange",
        "value": round(value, 1),
        "unit": "us CPU per cycle of three axes",
        "ratios": {
            "bare loop, back to back": round(value / limit, 2),
            "bare loop, every 8 ms": round(value_8ms / limit_8ms, 2),
        },
        "bar": f"at most {BAR_US:g} us of CPU per cycle back to back",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
