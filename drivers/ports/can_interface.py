"""`CanInterface`: state of a SocketCAN interface in the kernel: up or down, bit rate, restart."""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

_TIMEOUT_S: Final = 5.0


@dataclass(frozen=True)
class CanInterface:
    """State of a SocketCAN interface, as `ip -details link show` reports it.

    Attributes:
        up: True if the interface is switched on.
        controller: State of its CAN controller, such as ``"ERROR-ACTIVE"``; empty without a
            controller.
        bitrate: Bit rate [bit/s]; None if its driver does not report it (vcan, slcan).
        restart_ms: Time after which the controller restarts by itself after bus-off [ms]; 0: it
            does not; None: its driver does not report the time.
    """

    up: bool
    controller: str = ""
    bitrate: int | None = None
    restart_ms: int | None = None

    @classmethod
    def parse(cls, answer: str) -> CanInterface | None:
        """Return the interface in a JSON text from ``ip -json``; None if it cannot be read."""
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
    """Return the state of the interface `channel`; None if it does not exist or cannot be read."""
    command = ["ip", "-json", "-details", "link", "show", "dev", channel]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=_TIMEOUT_S
        )
    except (OSError, ValueError, subprocess.TimeoutExpired):
        return None
    return CanInterface.parse(done.stdout) if done.returncode == 0 else None


def transmit_queue_frames(channel: str) -> int | None:
    """Return an interface's transmit queue length (txqueuelen) [frames]; None if unknown."""
    try:
        text = Path(f"/sys/class/net/{channel}/tx_queue_len").read_text(encoding="ascii")
        return int(text)
    except (OSError, ValueError):
        return None
