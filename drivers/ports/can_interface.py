"""`CanInterface`: what the kernel says of a SocketCAN interface: up or down, bit rate, restart."""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

_PATIENCE_S: Final = 5.0


@dataclass(frozen=True)
class CanInterface:
    """An interface as `ip -details link show` has it.

    Attributes:
        up: Whether it is switched on.
        controller: State of its CAN controller, as ``"ERROR-ACTIVE"``; empty for one without a
            controller.
        bitrate: Bit rate [bit/s]; None if its driver does not say (vcan, slcan).
        restart_ms: After which time the controller leaves bus-off by itself [ms], 0 for never; None
            if its driver does not say.
    """

    up: bool
    controller: str = ""
    bitrate: int | None = None
    restart_ms: int | None = None

    @classmethod
    def parse(cls, answer: str) -> CanInterface | None:
        """Return the interface in the JSON of ``ip -json``; None if it is not in there."""
        try:
            (link,) = json.loads(answer)
            data: dict[str, Any] = link.get("linkinfo", {}).get("info_data", {})
            bitrate, restart = data.get("bittiming", {}).get("bitrate"), data.get("restart_ms")
            return cls(
                up="UP" in link.get("flags", ()),
                controller=str(data.get("state", "")),
                bitrate=None if bitrate is None else int(bitrate),
                restart_ms=None if restart is None else int(restart),
            )
        except (AttributeError, TypeError, ValueError):
            return None


def read_interface(channel: str) -> CanInterface | None:
    """Return a SocketCAN interface by its name; None if it does not exist or cannot be asked."""
    command = ["ip", "-json", "-details", "link", "show", "dev", channel]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=_PATIENCE_S
        )
    except (OSError, ValueError, subprocess.TimeoutExpired):
        return None
    return CanInterface.parse(done.stdout) if done.returncode == 0 else None


def transmit_queue_frames(channel: str) -> int | None:
    """Return how many frames may wait in an interface's transmit queue (txqueuelen).

    None if the interface does not say.
    """
    try:
        text = Path(f"/sys/class/net/{channel}/tx_queue_len").read_text(encoding="ascii")
        return int(text)
    except (OSError, ValueError):
        return None
