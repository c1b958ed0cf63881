"""`WatchTrial`: both heartbeat watches let run out once, with the axes at rest, to see them act.

A setting that reads back right is a promise; this sees it kept. First each drive's heartbeat is
switched off: this computer must notice. Then this computer's own is withheld while everything else
goes on: each drive must leave its state by itself, a quick stop where it was powered.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from config.cell.cell import CellConfig
from drivers.interfaces.servo_axes import EventKind
from drivers.ports.clock import Clock
from drivers.servo.axes import CanServoAxes
from drivers.servo.cia402 import PowerState

HEARTBEAT_LOST = 0x8130


@dataclass(frozen=True, slots=True)
class WatchTrial:
    """What one drive did.

    Attributes
    ----------
    joint, node_id : str, int
        Which drive.
    noticed_s : float
        How long this computer took to notice that the drive fell silent [s]; NaN: it did not.
    acted_s : float
        How long the drive took to act after this computer's last heartbeat [s]; NaN: it did not.
    how : str
        What it did, in words.
    powered : bool
        Whether it was switched on, so that what was seen was its quick stop.
    """

    joint: str
    node_id: int
    noticed_s: float
    acted_s: float
    how: str
    powered: bool


def try_watches(axes: CanServoAxes, clock: Clock, cell: CellConfig) -> tuple[WatchTrial, ...]:
    """Let both watches run out once; the drives are configured before, between and after.

    With `drive_safety.trip_watchdog_with_power` the drives are switched on for the second part, at
    velocity 0, so that their quick stop is seen; otherwise it is their emergency message.

    Raises
    ------
    LockedError, PreflightError, DeviceTimeoutError, DeviceFaultError, TransportError
        As of `bring_up`, `start` and `enable`.
    """
    noticed = _silent_drives(axes, clock, cell)
    powered = cell.drive_safety.trip_watchdog_with_power
    acted = _silent_computer(axes, clock, cell, powered=powered)
    axes.bring_up()
    return tuple(
        WatchTrial(axis.joint, axis.node_id, noticed[axis.joint], *acted[axis.joint], powered)
        for axis in cell.axes
    )


def _silent_drives(axes: CanServoAxes, clock: Clock, cell: CellConfig) -> dict[str, float]:
    """Switch the drives' heartbeats off; return how long it took to notice each [s]."""
    noticed = dict.fromkeys(axes.joint_names, math.nan)
    axes.bring_up()
    axes.start()
    since_s = clock.now_s()
    axes.service.silence_drives()
    patience_s = 3e-3 * cell.drive_safety.drive_heartbeat_timeout_ms
    due_s = clock.now_s()
    while clock.now_s() < since_s + patience_s and any(map(math.isnan, noticed.values())):
        due_s = _cycle(axes, clock, cell, due_s)
        axes.send_heartbeat(clock.now_s())
        axes.quick_stop()  # the drives watch for set-points; this one moves nothing
        for event in axes.take_events():
            if event.kind is EventKind.HEARTBEAT_LOST and math.isnan(noticed[event.joint]):
                noticed[event.joint] = event.time_s - since_s
    return noticed


def _silent_computer(
    axes: CanServoAxes, clock: Clock, cell: CellConfig, *, powered: bool
) -> dict[str, tuple[float, str]]:
    """Withhold this computer's heartbeat; return when each drive acted [s], and how."""
    acted: dict[str, tuple[float, str]] = {}
    for joint in axes.joint_names:
        acted[joint] = (math.nan, "nothing")
    axes.bring_up()
    axes.start()
    due_s = axes.enable() if powered else clock.now_s()
    since_s = axes.last_heartbeat_s
    patience_s = 3e-3 * cell.drive_safety.master_heartbeat_timeout_ms
    rest = np.zeros(len(axes.joint_names))
    while clock.now_s() < since_s + patience_s and any(math.isnan(s) for s, _ in acted.values()):
        due_s = _cycle(axes, clock, cell, due_s)
        if powered:
            axes.command(rest)
        else:
            axes.quick_stop()
        for event in axes.take_events():
            if event.kind is EventKind.EMERGENCY and event.code == HEARTBEAT_LOST:
                _note(acted, event.joint, event.time_s - since_s, "emergency 8130h")
    if powered:
        axes.quick_stop()
        for joint, state in zip(axes.joint_names, axes.service.power_states(), strict=True):
            still = state is PowerState.OPERATION_ENABLED
            acted[joint] = (math.nan if still else acted[joint][0], state.words)
        axes.disable()
    return acted


def _note(acted: dict[str, tuple[float, str]], joint: str, after_s: float, how: str) -> None:
    if math.isnan(acted[joint][0]):
        acted[joint] = (after_s, how)


def _cycle(axes: CanServoAxes, clock: Clock, cell: CellConfig, before_s: float) -> float:
    """Do SYNC and collect one cycle after another; return the time of SYNC [s]."""
    due_s = max(before_s + cell.cycle_time_s, clock.now_s())
    clock.sleep_until(due_s)
    return axes.exchange()
