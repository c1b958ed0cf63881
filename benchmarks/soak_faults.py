"""Faults of a soak test and the correct reactions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from acquisition.supervision.stop_reason import StopCode


@dataclass(frozen=True)
class Fault:
    """A fault and the correct reactions.

    Attributes:
        name: Description.
        part: Section of the fault script.
        keys: Keys in the fault script.
        stops: Correct stop codes; empty if the motion must continue.
        tears_the_file: True if the recording may be left unfinished.
    """

    name: str
    part: str
    keys: dict[str, Any]
    stops: tuple[StopCode, ...] = ()
    tears_the_file: bool = False


_BLOCKED = (StopCode.TORQUE_LIMIT, StopCode.FOLLOWING_ERROR, StopCode.STUCK_ENCODER)
_POWERLESS = (StopCode.NOT_ENABLED, StopCode.EMERGENCY, StopCode.DRIVE_FAULT)
_FAULT = (StopCode.EMERGENCY, StopCode.DRIVE_FAULT)
_SILENT = {"kind": "heartbeat_stops", "joint": "axis1", "duration_s": 2.0}

QUICK: Final = (
    Fault("a strange frame", "bus", {"kind": "strange", "identifier": 0x555}),
    Fault(
        "three answers are lost",
        "bus",
        {"kind": "drop", "joint": "axis1", "count": 3},
        (StopCode.MISSED_FRAMES,),
    ),
    Fault(
        "the recorder is killed",
        "program",
        {"kind": "kill", "process": "recorder"},
        (StopCode.RECORDER,),
        tears_the_file=True,
    ),
    Fault(
        "a drive boots",
        "drives",
        {"kind": "reset", "joint": "axis3"},
        (StopCode.DRIVE_RESTARTED,),
    ),
)
FAULTS: Final = (
    *QUICK,
    Fault("one answer is lost", "bus", {"kind": "drop", "joint": "axis2"}),
    Fault("an answer comes twice", "bus", {"kind": "duplicate"}),
    Fault(
        "another node answers first",
        "bus",
        {"kind": "spoof", "joint": "axis3", "count": 12, "torque_permille": 100},
        (StopCode.SECOND_ANSWERS,),
    ),
    Fault("Ctrl-Z", "program", {"kind": "signal", "signal": "TSTP"}),
    Fault(
        "the operator stops",
        "program",
        {"kind": "signal", "signal": "INT"},
        (StopCode.INTERRUPTED,),
    ),
    Fault(
        "an emergency message",
        "drives",
        {"kind": "emergency", "joint": "axis1"},
        (StopCode.EMERGENCY,),
    ),
    Fault("a drive's fault", "drives", {"kind": "fault", "joint": "axis2"}, _FAULT),
    Fault(
        "the task is killed",
        "program",
        {"kind": "kill", "process": "task"},
        (StopCode.TASK_DIED,),
    ),
    Fault("the disk stands still", "program", {"kind": "disk_stall", "duration_s": 0.3}),
    Fault(
        "a write fails",
        "program",
        {"kind": "disk_error"},
        (StopCode.RECORDER,),
        tears_the_file=True,
    ),
    Fault("a clock runs 1 % slow", "drives", {"kind": "clock", "joint": "axis2", "factor": 0.99}),
    Fault(
        "an axis is blocked",
        "drives",
        {"kind": "blocked", "joint": "axis2", "duration_s": 2.0},
        _BLOCKED,
    ),
    Fault(
        "an emergency stop",
        "drives",
        {"kind": "motor_power_lost", "duration_s": 2.0},
        _POWERLESS,
    ),
    Fault("a drive falls silent", "drives", _SILENT, (StopCode.HEARTBEAT_LOST,)),
)
