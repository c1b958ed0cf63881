"""`WatchTrial`: both heartbeat timeouts are tested once, with the axes at rest.

A correct setting alone does not prove that a drive reacts, so this test observes it. First each
drive's heartbeat is switched off and no guarding request is sent: this computer must detect it.
Then this computer's heartbeat and requests are withheld while everything else continues: each drive
must leave its state by itself, by a quick stop if it was powered.
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
    """Result of one drive.

    Attributes:
        joint, node_id: The drive.
        noticed_s: Time until this computer detected the drive's silence [s]; NaN if it did not.
        acted_s: Time from this computer's last heartbeat until the drive's reaction [s]; NaN if it
            did not react.
        how: The reaction, in words.
        powered: Whether the drive was switched on, so that its quick stop was observed.
    """

    joint: str
    node_id: int
    noticed_s: float
    acted_s: float
    how: str
    powered: bool


def try_watches(axes: CanServoAxes, clock: Clock, cell: CellConfig) -> tuple[WatchTrial, ...]:
    """Let both timeouts expire once; the drives are configured before, between and after.

    With `drive_safety.trip_watchdog_with_power`, or if a drive's reactions are known only by this
    test, the drives are switched on for the second part, at velocity 0, so that their quick stop
    can be observed: no person may be in the cell. Otherwise their emergency message is observed. A
    fault that this test causes is reset.

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
        WatchTrial(axis.joint, axis.node_id, noticed[axis.joint], *acted[axis.joint], powered)
        for axis in cell.axes
    )


def switches_power(axes: CanServoAxes, cell: CellConfig) -> bool:
    """Return whether `try_watches` switches the drives on."""
    return cell.drive_safety.trip_watchdog_with_power or bool(axes.left_to_trial)


def prove_watches(axes: CanServoAxes, clock: Clock, cell: CellConfig) -> None:
    """Test before motion that every drive stops without this computer, if only a test can show it.

    The drives are configured before and after. Nothing is done if all drives have objects that
    define their reactions.

    Raises:
        PreflightError: A drive did not stop, or was too late.
        LockedError, DeviceTimeoutError, DeviceFaultError, TransportError: As `bring_up`, `start`
            and `enable`.
    """
    if not axes.left_to_trial:
        return
    acted = _withhold_heartbeat(axes, clock, cell, powered=True)
    allowed = cell.drive_safety.allow_drive_without_watchdog
    bad = [
        f"{axis.joint} (node {axis.node_id}): {acted[axis.joint][1]}"
        for axis in cell.axes
        if axis.node_id not in allowed and not acted[axis.joint][0] <= acts_within_s(cell)
    ]
    if bad:
        raise PreflightError(
            f"without this computer a drive does not stop in time: {'; '.join(bad)}; do not move"
            " it. `rid-daq check` shows the test",
            code="RID-DRIVE-WATCHDOG",
        )
    axes.bring_up()


def acts_within_s(cell: CellConfig) -> float:
    """Return the time limit for a drive's reaction to this computer's last heartbeat [s]."""
    return 1e-3 * cell.drive_safety.master_heartbeat_timeout_ms + 2.0 * cell.cycle_time_s


def _silence_drives(axes: CanServoAxes, clock: Clock, cell: CellConfig) -> dict[str, float]:
    """Switch the drives' heartbeats off; return the time until each was detected [s]."""
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
        axes.quick_stop()  # prevents the drives' command timeout; it moves nothing
        for event in axes.take_events():
            if event.kind is EventKind.HEARTBEAT_LOST and math.isnan(noticed[event.joint]):
                noticed[event.joint] = event.time_s - since_s
            elif event.kind is EventKind.EMERGENCY:
                reported[event.joint].add(event.code)
    _reset_unasked(axes, reported)
    return noticed


def _reset_unasked(axes: CanServoAxes, reported: Mapping[str, set[int]]) -> None:
    """Reset drives that are in fault only because no guarding request was sent.

    A drive with another fault is not reset, so that the next `bring_up` reports it.
    """
    states = zip(axes.joint_names, axes.service.power_states(), strict=True)
    faulty = [reported[joint] for joint, state in states if state.faulty]
    if faulty and all(codes == {HEARTBEAT_LOST} for codes in faulty):
        axes.service.reset_faults()


def _withhold_heartbeat(
    axes: CanServoAxes, clock: Clock, cell: CellConfig, *, powered: bool
) -> dict[str, tuple[float, str]]:
    """Withhold this computer's heartbeat; return each drive's reaction time [s] and reaction.

    With power the reaction is the stop, without power the emergency message.
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
    """Run cycles until every drive has sent 8130h or `until_s`; return the times [s], or NaN."""
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
    """Run cycles until no drive follows or `until_s`; return the times [s], or NaN.

    A report of a drive is not a stop yet. Its time counts only if the next answer shows that the
    drive has left Operation Enabled, or if no answer comes. Only a drive whose answer shows this
    gets Disable Voltage. No drive gets a quick stop: the effect of a command of this computer, or
    of another drive's reaction, could otherwise be taken for the drive's own reaction.
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
    """Run the next cycle in time; return the time of SYNC [s]."""
    due_s = max(before_s + cell.cycle_time_s, clock.now_s())
    clock.sleep_until(due_s)
    return axes.exchange()
