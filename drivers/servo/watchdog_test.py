"""`WatchTrial`: both heartbeat watches let run out once, with the axes at rest, to see them act.

A setting that reads back right is a promise; this sees it kept. First each drive's heartbeat is
switched off, and none is asked for its state: this computer must notice. Then this computer's own
is withheld, and its questions, while everything else goes on: each drive must leave its state by
itself, a quick stop where it was powered.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from config.cell.cell import CellConfig
from config.errors import PreflightError
from drivers.interfaces.servo_axes import EventKind
from drivers.ports.clock import Clock
from drivers.servo.axes import CanServoAxes
from drivers.servo.cia402 import ControlWord, PowerState

HEARTBEAT_LOST = 0x8130


@dataclass(frozen=True, slots=True)
class WatchTrial:
    """What one drive did.

    Attributes:
        joint, node_id: Which drive.
        noticed_s: How long this computer took to notice that the drive fell silent [s]; NaN: it did
            not.
        acted_s: How long the drive took to act after this computer's last heartbeat [s]; NaN: it
            did not.
        how: What it did, in words.
        powered: Whether it was switched on, so that what was seen was its quick stop.
    """

    joint: str
    node_id: int
    noticed_s: float
    acted_s: float
    how: str
    powered: bool


def try_watches(axes: CanServoAxes, clock: Clock, cell: CellConfig) -> tuple[WatchTrial, ...]:
    """Let both watches run out once; the drives are configured before, between and after.

    With `drive_safety.trip_watchdog_with_power`, or where a drive's reactions are left to this
    trial, the drives are switched on for the second part, at velocity 0, so that their quick stop
    is seen: nobody may be in the cell. Otherwise it is their emergency message. A fault that a
    drive is in by this trial is reset.

    Raises:
        LockedError, PreflightError, DeviceTimeoutError, DeviceFaultError, TransportError: As of
            `bring_up`, `start` and `enable`.
    """
    noticed = _silent_drives(axes, clock, cell)
    axes.bring_up()
    powered = takes_power(axes, cell)
    acted = _silent_computer(axes, clock, cell, powered=powered)
    axes.bring_up()
    return tuple(
        WatchTrial(axis.joint, axis.node_id, noticed[axis.joint], *acted[axis.joint], powered)
        for axis in cell.axes
    )


def takes_power(axes: CanServoAxes, cell: CellConfig) -> bool:
    """Return whether `try_watches` switches the drives on."""
    return cell.drive_safety.trip_watchdog_with_power or bool(axes.left_to_trial)


def prove_watches(axes: CanServoAxes, clock: Clock, cell: CellConfig) -> None:
    """Before motion, see every drive stop without this computer, where that is known by trial only.

    The drives are configured before and after; nothing is done where all have told how they react.

    Raises:
        PreflightError: A drive went on, or was too late.
        LockedError, DeviceTimeoutError, DeviceFaultError, TransportError: As of `bring_up`, `start`
            and `enable`.
    """
    if not axes.left_to_trial:
        return
    acted = _silent_computer(axes, clock, cell, powered=True)
    allowed = cell.drive_safety.allow_drive_without_watchdog
    bad = [
        f"{axis.joint} (node {axis.node_id}): {acted[axis.joint][1]}"
        for axis in cell.axes
        if axis.node_id not in allowed and not acted[axis.joint][0] <= acts_within_s(cell)
    ]
    if bad:
        raise PreflightError(
            f"without this computer a drive does not stop in time: {'; '.join(bad)}. It must not be"
            " moved; `rid-daq check` shows the trial",
            code="RID-DRIVE-WATCHDOG",
        )
    axes.bring_up()


def acts_within_s(cell: CellConfig) -> float:
    """Return how long a drive may take to act after this computer's last heartbeat [s]."""
    return 1e-3 * cell.drive_safety.master_heartbeat_timeout_ms + 2.0 * cell.cycle_time_s


def _silent_drives(axes: CanServoAxes, clock: Clock, cell: CellConfig) -> dict[str, float]:
    """Switch the drives' heartbeats off; return how long it took to notice each [s]."""
    noticed = dict.fromkeys(axes.joint_names, math.nan)
    reported: dict[str, set[int]] = {joint: set() for joint in axes.joint_names}
    axes.bring_up()
    axes.start()
    since_s = clock.now_s()
    axes.service.silence_drives()
    patience_s = 3e-3 * cell.drive_safety.drive_heartbeat_timeout_ms
    due_s = clock.now_s()
    while clock.now_s() < since_s + patience_s and any(map(math.isnan, noticed.values())):
        due_s = _cycle(axes, clock, cell, due_s)
        axes.send_heartbeat(clock.now_s(), asking=False)
        axes.quick_stop()  # the drives watch for set-points; this one moves nothing
        for event in axes.take_events():
            if event.kind is EventKind.HEARTBEAT_LOST and math.isnan(noticed[event.joint]):
                noticed[event.joint] = event.time_s - since_s
            elif event.kind is EventKind.EMERGENCY:
                reported[event.joint].add(event.code)
    _reset_unasked(axes, reported)
    return noticed


def _reset_unasked(axes: CanServoAxes, reported: Mapping[str, set[int]]) -> None:
    """Reset drives that are in fault since nobody asked for their state, and nothing else is wrong.

    What else a drive has reported meanwhile stays, for the next `bring_up` to name.
    """
    states = zip(axes.joint_names, axes.service.power_states(), strict=True)
    faulty = [reported[joint] for joint, state in states if state.faulty]
    if faulty and all(codes == {HEARTBEAT_LOST} for codes in faulty):
        axes.service.reset_faults()


def _silent_computer(
    axes: CanServoAxes, clock: Clock, cell: CellConfig, *, powered: bool
) -> dict[str, tuple[float, str]]:
    """Withhold this computer's heartbeat; return when each drive acted [s], and how.

    With power that is when it stopped, without when it sent its emergency message.
    """
    axes.start()
    due_s = axes.enable() if powered else clock.now_s()
    since_s = axes.last_heartbeat_s
    until_s = since_s + 3e-3 * cell.drive_safety.master_heartbeat_timeout_ms
    if not powered:
        told_s = _hear_emergencies(axes, clock, cell, due_s, until_s)
        return {
            joint: (time_s - since_s, "nothing" if math.isnan(time_s) else "emergency 8130h")
            for joint, time_s in told_s.items()
        }
    left_s = _see_stops(axes, clock, cell, due_s, until_s)
    states = dict(zip(axes.joint_names, axes.service.power_states(), strict=True))
    axes.disable()
    if any(state.faulty for state in states.values()):
        axes.service.reset_faults()
    return {
        joint: (
            math.nan if state is PowerState.OPERATION_ENABLED else left_s[joint] - since_s,
            state.words,
        )
        for joint, state in states.items()
    }


def _hear_emergencies(
    axes: CanServoAxes, clock: Clock, cell: CellConfig, due_s: float, until_s: float
) -> dict[str, float]:
    """Run cycles until every drive has sent 8130h, `until_s` at most; return when [s], or NaN."""
    told_s = dict.fromkeys(axes.joint_names, math.nan)
    while clock.now_s() < until_s and any(map(math.isnan, told_s.values())):
        due_s = _cycle(axes, clock, cell, due_s)
        for event in axes.take_events():
            lost = event.kind is EventKind.EMERGENCY and event.code == HEARTBEAT_LOST
            if lost and math.isnan(told_s[event.joint]):
                told_s[event.joint] = event.time_s
        axes.quick_stop()
    return told_s


def _see_stops(
    axes: CanServoAxes, clock: Clock, cell: CellConfig, due_s: float, until_s: float
) -> dict[str, float]:
    """Run cycles until no drive follows any more, `until_s` at most; return when [s], or NaN.

    A report is no stop: its time counts only where the next answer shows that the drive has left
    Operation Enabled, or where none comes any more. Only a drive whose answer shows it is told to
    stay without power, and none to stop: what this computer or another drive did would be taken
    for its own act.
    """
    left_s = dict.fromkeys(axes.joint_names, math.nan)
    words = dict.fromkeys(axes.joint_names, ControlWord.ENABLE_OPERATION)
    follow = True
    while follow and clock.now_s() < until_s:
        due_s = _cycle(axes, clock, cell, due_s)
        for event in axes.take_events():
            if event.joint and math.isnan(left_s[event.joint]):
                left_s[event.joint] = event.time_s
        follow = False
        answers = zip(axes.joint_names, axes.answers.received, axes.answers.enabled, strict=True)
        for joint, received, enabled in answers:
            reported = left_s[joint] < due_s
            if received and enabled:
                follow = True
                if reported:
                    left_s[joint] = math.nan
                continue
            if math.isnan(left_s[joint]):
                left_s[joint] = due_s
            if received:
                words[joint] = ControlWord.DISABLE_VOLTAGE
            else:
                follow |= not reported
        axes.cyclic.send_words(list(words.values()))
    return left_s


def _cycle(axes: CanServoAxes, clock: Clock, cell: CellConfig, before_s: float) -> float:
    """Do SYNC and collect one cycle after another; return the time of SYNC [s]."""
    due_s = max(before_s + cell.cycle_time_s, clock.now_s())
    clock.sleep_until(due_s)
    return axes.exchange()
