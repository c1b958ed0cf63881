"""What the preflight looks at on a SocketCAN interface before anything is sent."""

from __future__ import annotations

from config.cell import CellConfig
from drivers.socketcan_port import transmit_queue_frames
from rid_daq.check_line import CheckLine

LONGEST_QUEUE = 128
SPARE_FRAMES = 2


def bus_lines(cell: CellConfig) -> list[CheckLine]:
    """Return whether the interface's transmit queue holds a cycle, and little more.

    What waits there cannot be taken back: after a pulled cable it would go out when nobody expects
    it. One that does not hold a cycle refuses frames. Nothing on other buses.
    """
    if cell.can.interface != "socketcan":
        return []
    least = len(cell.axes) + SPARE_FRAMES
    found = transmit_queue_frames(cell.can.channel)
    good = found is not None and least <= found <= LONGEST_QUEUE
    return [
        CheckLine(
            where=f"socketcan:{cell.can.channel}",
            what="transmit queue (txqueuelen)",
            required=f"{least} to {LONGEST_QUEUE}",
            found="unknown" if found is None else str(found),
            verdict="ok" if good else "red",
            next_action=f"ip link set {cell.can.channel} txqueuelen {max(10, least)}",
        )
    ]
