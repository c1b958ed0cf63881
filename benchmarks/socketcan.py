"""Processor time of one cycle on SocketCAN: our raw socket compared with python-can.

A cycle sends SYNC and six set-points and receives six answers, which a second socket sends.

Run it with ``python -m benchmarks.socketcan [--quick] --interface vcan0``. If the kernel has no
CAN, run it in the virtual machine of tests/socketcan.
"""

from __future__ import annotations

import gc
import json
import socket
import struct
import sys
import time
from collections.abc import Callable

import can

from drivers.ports.can_ports import FramePort, PythonCanPort
from drivers.ports.socketcan_port import SocketCanPort

AXES = 6
FRAME = struct.Struct("=IB3x8s")
COMMANDS: list[tuple[int, bytes | bytearray]] = [(0x080, b"")]
COMMANDS += [(0x201 + axis, bytearray(8)) for axis in range(AXES)]
ANSWERS = [FRAME.pack(0x181 + axis, 8, bytes(8)) for axis in range(AXES)]


def exchange(port: FramePort, peer: socket.socket) -> Callable[[], float]:
    """Return a function that runs one cycle and returns its processor time [s]."""

    def cycle() -> float:
        began_s = time.process_time()
        port.send_frames(COMMANDS)
        spent_s = time.process_time() - began_s
        for _ in COMMANDS:
            peer.recv(16)
        for answer in ANSWERS:
            peer.send(answer)
        began_s = time.process_time()
        missing = AXES
        while missing:
            missing -= len(port.receive_frames(1.0) or ())
        return spent_s + time.process_time() - began_s

    return cycle


def cpu_us(cycle: Callable[[], float], cycles: int) -> float:
    """Return the least processor time of a cycle, averaged over `cycles`, of five rounds [us]."""
    return min(sum(cycle() for _ in range(cycles)) / cycles for _ in range(5)) * 1e6


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    if "--interface" not in sys.argv[:-1]:
        print("missing option --interface: use vcan0 or another interface that is up and unused")
        return 2
    channel = sys.argv[sys.argv.index("--interface") + 1]
    cycles = 100 if "--quick" in sys.argv else 1000
    gc.freeze()
    gc.disable()
    figures = {}
    for name in ("raw socket", "python-can"):
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as peer:
            peer.bind((channel,))
            port: FramePort = SocketCanPort(channel)
            if name == "python-can":
                port.shutdown()
                bus = can.Bus(interface="socketcan", channel=channel)
                port = PythonCanPort(bus, simulated=False)
            figures[name] = cpu_us(exchange(port, peer), cycles)
            port.shutdown()
        print(f"{name}: {figures[name]:.1f} us of CPU a cycle of {AXES} axes")
    ratio = figures["python-can"] / figures["raw socket"]
    result = {
        "name": "socketcan",
        "value": round(figures["raw socket"], 1),
        "unit": f"us CPU per cycle of {AXES} axes",
        "ratios": {"python-can's": round(ratio, 2)},
        "bar": "less than python-can's SocketCAN interface",
        "holds": ratio > 1.0,
    }
    print(json.dumps(result))
    return 0 if ratio > 1.0 else 1


if __name__ == "__main__":
    sys.exit(main())
