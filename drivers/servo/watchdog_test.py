"""Watchdog test: the heartbeat timeouts of computer and drives expire once, with the axes at rest.

A correct setting alone does not prove that a drive reacts, so this test observes it. First, each
drive's heartbeat is switched off, and no request of life guarding is sent: this computer must
detect the silence. Then this computer stops its own heartbeat and requests, while the cyclic
exchange continues: each drive must react by itself, by a quick stop if it has power.
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
class WatchdogResult:
    """Result of the watchdog test for one drive.

    Attributes:
        joint, node_id: The drive.
        detected_s: Time from the end of the drive's heartbeats until this computer detected it [s];
            NaN if it did not.
        reacted_s: Time from this computer's last heartbeat until the drive's reaction [s]; NaN if
            the drive did not react.
        how: The drive's reaction, in words.
        powered: True if the drive was switched on, so that its quick stop was observed.
    """

    joint: str
    node_id: int
    detected_s: float
    reacted_s: float
    how: str
    powered: bool


def run_watchdog_test(
    axes: CanServoAxes, clock: Clock, cell: CellConfig
) -> tuple[WatchdogResult, ...]:
    """Run the watchdog test: let the timeouts of computer and drives expire once.

    The drives are configured before, between and after the two parts. If
    `drive_safety.trip_watchdog_with_power` is set, or if only this test can show a drive's
    reactions, the drives are switched on for the second part, at velocity 0, to observe their quick
    stop: no person must be in the cell. Otherwise the drives stay without power, and their
    emergency messages are observed. Faults that this test causes are reset.

    Raises:
        LockedError, PreflightError, DeviceTimeoutError, DeviceFaultError, TransportError: As
            `bring_up`, `start` and `enable`.
    """
    noticed = _silence_drives(axes, clock, cell)
    axes.bring_up()
    powered = switches_power(axes, cell)
    acted = _withhold_heartbeat(axes, clock, cell, powered=powered)
    axes.bring_up()
    return tuple(
        WatchdogResult(axis.joint, axis.node_id, noticed[axis.joint], *acted[axis.joint], powered)
        for axis in cell.axes
    )


def switches_power(axes: CanServoAxes, cell: CellConfig) -> bool:
    """Return True if `run_watchdog_test` switches the drives on."""
    return cell.drive_safety.trip_watchdog_with_power or bool(axes.undefined_reactions)


def require_watchdogs(axes: CanServoAxes, clock: Clock, cell: CellConfig) -> None:
    """Make sure before a motion that every drive stops if this computer fails.

    If all drives have objects that define their reactions, nothing is done. Otherwise the second
    part of the watchdog test is run with power. The drives are configured before and after it.

    Raises:
        PreflightError: A drive did not stop, or stopped too late.
        LockedError, DeviceTimeoutError, DeviceFaultError, TransportError: As `bring_up`, `start`
            and `enable`.
    """
    if not axes.undefined_reactions:
        return
    acted = _withhold_heartbeat(axes, clock, cell, powered=True)
    allowed = cell.drive_safety.allow_drive_without_watchdog
    bad = [
        f"{axis.joint} (node {axis.node_id}): {acted[axis.joint][1]}"
        for axis in cell.axes
        if axis.node_id not in allowed and not acted[axis.joint][0] <= reaction_limit_s(cell)
    ]
    if bad:
        raise PreflightError(
            f"a drive does not stop in time if this computer fails: {'; '.join(bad)}; do not move"
            " the robot. `rid-daq check` shows the watchdog test",
            code="RID-DRIVE-WATCHDOG",
        )
    axes.bring_up()


def reaction_limit_s(cell: CellConfig) -> float:
    """Return the time limit from this computer's last heartbeat to a drive's reaction [s]."""
    return 1e-3 * cell.drive_safety.master_heartbeat_timeout_ms + 2.0 * cell.cycle_time_s


def _silence_drives(axes: CanServoAxes, clock: Clock, cell: CellConfig) -> dict[str, float]:
    """Switch off the drives' heartbeats; return the time until each silence was detected [s]."""
    noticed = dict.fromkeys(axes.joint_names, math.nan)
    reported: dict[str, set[int]] = {joint: set() for joint in axes.joint_names}
    axes.bring_up()
    axes.start()
    since_s = dict(zip(axes.joint_names, axes.service.silence_drives(clock), strict=True))
    patience_s = 3e-3 * cell.drive_safety.drive_heartbeat_timeout_ms
    due_s = clock.now_s()
    until_s = max(since_s.values()) + patience_s
    while clock.now_s() < until_s and any(map(math.isnan, noticed.values())):
        due_s = _cycle(axes, clock, cell, due_s)
        axes.send_heartbeat(clock.now_s(), asking=False)
        axes.quick_stop()  # prevents the drives' command timeout, without motion
        for event in axes.take_events():
            if event.kind is EventKind.HEARTBEAT_LOST and math.isnan(noticed[event.joint]):
                noticed[event.joint] = event.time_s - since_s[event.joint]
            elif event.kind is EventKind.EMERGENCY:
                reported[event.joint].add(event.code)
    _reset_unguarded(axes, reported)
    return noticed


def _reset_unguarded(axes: CanServoAxes, reported: Mapping[str, set[int]]) -> None:
    """Reset the drives in fault, if the only cause is that they got no request of life guarding.

    If a drive has any other fault, no drive is reset, so that the next `bring_up` reports the
    fault.
    """
    states = zip(axes.joint_names, axes.service.power_states(), strict=True)
    faulty = [reported[joint] for joint, state in states if state.faulty]
    if faulty and all(codes == {HEARTBEAT_LOST} for codes in faulty):
        axes.service.reset_faults()


def _withhold_heartbeat(
    axes: CanServoAxes, clock: Clock, cell: CellConfig, *, powered: bool
) -> dict[str, tuple[float, str]]:
    """Stop this computer's heartbeat; return each drive's reaction time [s] and reaction.

    The reaction is a drive's stop if the drives have power, and its emergency message if not.
    """
    axes.start()
    due_s = axes.enable() if powered else clock.now_s()
    since_s = axes.last_heartbeat_s
    until_s = since_s + 3e-3 * cell.drive_safety.master_heartbeat_timeout_ms
    if not powered:
        emergency_s = _await_emergencies(axes, clock, cell, due_s, until_s)
        return {
            joint: (time_s - since_s, "nothing" if math.isnan(time_s) else "emergency 8130h")
            for joint, time_s in emergency_s.items()
        }
    left_s = _observe_stops(axes, clock, cell, due_s, until_s)
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


def _await_emergencies(
    axes: CanServoAxes, clock: Clock, cell: CellConfig, due_s: float, until_s: float
) -> dict[str, float]:
    """Run cycles until each drive has sent 8130h, or until `until_s`; return times [s] or NaN."""
    emergency_s = dict.fromkeys(axes.joint_names, math.nan)
    while clock.now_s() < until_s and any(map(math.isnan, emergency_s.values())):
        due_s = _cycle(axes, clock, cell, due_s)
        for event in axes.take_events():
            lost = event.kind is EventKind.EMERGENCY and event.code == HEARTBEAT_LOST
            if lost and math.isnan(emergency_s[event.joint]):
                emergency_s[event.joint] = event.time_s
        axes.quick_stop()
    return emergency_s


def _observe_stops(
    axes: CanServoAxes, clock: Clock, cell: CellConfig, due_s: float, until_s: float
) -> dict[str, float]:
    """Run cycles until all drives have stopped, or until `until_s`; return the times [s] or NaN.

    A message about a failure does not yet prove that the drive stops. The time of the message
    counts only if the drive's next answer shows that it has left Operation Enabled, or if it does
    not answer. Only drives whose answer shows this get Disable Voltage. No drive gets a quick stop
    from this computer, because its effect could be mistaken for the drive's own reaction.
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
    """Wait for the next cycle and run it; return the time of SYNC [s]."""
    due_s = max(before_s + cell.cycle_time_s, clock.now_s())
    clock.sleep_until(due_s)
    return axes.exchange()
