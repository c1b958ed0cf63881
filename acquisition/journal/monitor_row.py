"""The row that the drive monitor writes every round: what the drives say of themselves."""

from __future__ import annotations

import struct
from functools import cache
from typing import Any

import numpy as np

from acquisition.journal.header import HeaderModel
from drivers.interfaces.drive_monitor import MonitorReading

MONITOR = "monitor.mcap"
TOPIC = "/drive_monitor"
MESSAGE_NAME = "rid_daq/msg/DriveMonitor"

_FIELDS = (
    ("temperature_k", "f8", "of the motors; NaN where a drive did not answer [K]"),
    ("operating_time_s", "f8", "since the drives were switched on, by their own clocks [s]"),
    ("valid", "u1", "1 where the drive answered"),
)
_MESSAGE_TYPE = {"f8": "float64", "u1": "uint8"}


class MonitorHeader(HeaderModel):
    """What a monitor's file says about itself."""

    joint_names: tuple[str, ...]
    period_s: float
    cell_name: str = ""
    robot_name: str = ""
    run_id: str = ""


@cache
def monitor_dtype(joints: int) -> np.dtype[Any]:
    """Return the packed record of a row for a robot with `joints` joints."""
    fields = [(name, "<" + kind, (joints,)) for name, kind, _ in _FIELDS]
    return np.dtype([("time_s", "<f8"), *fields])


def monitor_body(time_s: float, reading: MonitorReading) -> bytes:
    """Return the bytes of a row; `time_s` is on the clock of the cycles [s]."""
    n = len(reading.temperature_k)
    valid = np.isfinite(reading.temperature_k).tolist()
    return struct.pack(
        f"<d{n}d{n}d{n}B", time_s, *reading.temperature_k, *reading.operating_time_s, *valid
    )


def message_definition(joints: int) -> str:
    """Return the ROS 2 message definition (`.msg` text) of a row."""
    lines = ["float64 time_s  # on the clock of the cycles [s]"]
    lines += [f"{_MESSAGE_TYPE[kind]}[{joints}] {name}  # {text}" for name, kind, text in _FIELDS]
    return "\n".join(lines) + "\n"
