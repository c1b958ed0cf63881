"""Watchdog test: the heartbeat timeouts of computer and drives expire once, with the axes at rest.

A correct setting alone does not prove that a drive reacts, so this test observes it. First, each
drive's heartbeat is switched off, and no request of life guarding is sent: this computer must
detect the silence. Then this computer stops its own heartbeat and requests, while the cyclic
exchange continues: each drive must react by itself, by a quick stop if it has power.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from config.cell.cell import CellConfig
from config.errors import DeviceFaultError, PreflightError
from drivers.canopen.emcy import code_text
from drivers.interfaces.servo_axes import DriveEvent, EventKind
from drivers.ports.clock import Clock
from drivers.servo.axes import CanServoAxes
from drivers.servo.cia402 import ControlWord, PowerState

EARLIEST_REACTION = 0.8
"""Earliest unexplained loss of power that counts as a reaction, as a fraction of the timeout."""

_REACTIONS = (EventKind.EMERGENCY, EventKind.NOT_OPERATIONAL)


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


class _Reports:
    """Reports of the drives during a part of the test, by cause.

    Attributes:
        codes: For each joint, the error codes of its emergency messages.
        lost_s: For each joint, the time of its first report that this computer is silent [s]; NaN
            without one.
        left_s: For each joint, the time of its first report of any kind [s]; NaN without one.
    """

    def __init__(self, axes: CanServoAxes, cell: CellConfig) -> None:
        self._axes = axes
        by_joint = {axis.joint: axis for axis in cell.axes}
        self._profiles = {joint: cell.servo_of(by_joint[joint]) for joint in axes.joint_names}
        self.codes: dict[str, set[int]] = {joint: set() for joint in axes.joint_names}
        self.lost_s = dict.fromkeys(axes.joint_names, math.nan)
        self.left_s = dict.fromkeys(axes.joint_names, math.nan)
        self._other: list[str] = []

    def lost_connection_codes(self, joint: str) -> tuple[int, ...]:
        """Return the error codes by which a joint's drive reports that this computer is silent."""
        return self._profiles[joint].lost_connection_codes

    def is_guarded(self, joint: str) -> bool:
        """Return True if a joint's drive uses life guarding."""
        return self._profiles[joint].watch == "life_guarding"

    def add(self, event: DriveEvent, *, expected: Collection[EventKind]) -> None:
        """Add a report; one of a kind that is not `expected` ends the test (`refuse_others`)."""
        if event.joint and math.isnan(self.left_s[event.joint]):
            self.left_s[event.joint] = event.time_s
        if event.kind is EventKind.EMERGENCY:
            self.codes[event.joint].add(event.code)
            lost = event.code in self.lost_connection_codes(event.joint)
            if lost and math.isnan(self.lost_s[event.joint]):
                self.lost_s[event.joint] = event.time_s
        guarded = bool(event.joint) and self.is_guarded(event.joint)
        silent = guarded and event.kind is EventKind.HEARTBEAT_LOST
        if event.kind.is_fault and not silent and event.kind not in expected:
            self._other.append(event.text)

    def end_part(self) -> tuple[PowerState, ...]:
        """Switch the power off, and reset the faults that the test has caused.

        Returns:
            The power states before.

        Raises:
            DeviceFaultError: A drive has another fault, which is not reset, or its power is still
                on.
        """
        axes = self._axes
        states = axes.service.power_states()
        if axes.disable() and (powered := axes.service.switch_off()):
            raise DeviceFaultError(
                f"the drives did not switch their power off: {', '.join(powered)}; use the"
                " emergency stop",
                code="RID-DRIVE-NOT-STOPPED",
            )
        axes.service.claim_bus()
        for event in axes.take_events():  # the code of a later fault would hide that of this one
            if event.kind is EventKind.EMERGENCY:
                self.add(event, expected=(EventKind.EMERGENCY,))
        codes = axes.service.error_codes()
        accepted = [self.lost_connection_codes(joint) for joint in axes.joint_names]
        others = list(self._other)
        each = zip(axes.joint_names, states, codes, accepted, strict=True)
        for joint, state, code, own in each:
            found = self.codes[joint] | ({code} if state.faulty else set())
            others += [
                f"{joint}: {code_text(other)} ({other:04X}h)" for other in sorted(found - set(own))
            ]
        if others:
            raise DeviceFaultError(
                f"a fault that the watchdog test did not cause: {'; '.join(others)}. It was not"
                " reset; find its cause, then begin again. If the drive reports a lost connection"
                " by this code, add the code to lost_connection_codes in the axis's servo",
                code="RID-DRIVE-FAULT",
            )
        if any(state.faulty for state in states):
            axes.service.reset_faults(accepted)
        return states


def _silence_drives(axes: CanServoAxes, clock: Clock, cell: CellConfig) -> dict[str, float]:
    """Switch off the drives' heartbeats; return the time until each silence was detected [s]."""
    noticed = dict.fromkeys(axes.joint_names, math.nan)
    reports = _Reports(axes, cell)
    axes.disable()
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
            reports.add(event, expected=(EventKind.EMERGENCY, EventKind.HEARTBEAT_LOST))
            if event.kind is EventKind.HEARTBEAT_LOST and math.isnan(noticed[event.joint]):
                noticed[event.joint] = event.time_s - since_s[event.joint]
    reports.end_part()
    return noticed


def _withhold_heartbeat(
    axes: CanServoAxes, clock: Clock, cell: CellConfig, *, powered: bool
) -> dict[str, tuple[float, str]]:
    """Stop this computer's heartbeat; return each drive's reaction time [s] and reaction.

    The reaction is a drive's stop if the drives have power, and its emergency message if not. A
    drive that lost its power without a report, long before its timeout, did not react to the
    silence: an emergency stop, for example, also switches the power off.

    Raises:
        DeviceFaultError: A drive has a fault that the silence did not cause.
    """
    reports = _Reports(axes, cell)
    axes.start()
    due_s = axes.enable() if powered else clock.now_s()
    since_s = axes.last_heartbeat_s
    timeout_s = 1e-3 * cell.drive_safety.master_heartbeat_timeout_ms
    until_s = since_s + 3.0 * timeout_s
    if not powered:
        _await_emergencies(axes, clock, cell, due_s, until_s, reports)
        reports.end_part()
        return {
            joint: (time_s - since_s, "nothing")
            if math.isnan(time_s)
            else (time_s - since_s, f"emergency {min(reports.codes[joint]):04X}h")
            for joint, time_s in reports.lost_s.items()
        }
    left_s = _observe_stops(axes, clock, cell, due_s, until_s, reports)
    states = dict(zip(axes.joint_names, reports.end_part(), strict=True))
    found: dict[str, tuple[float, str]] = {}
    for joint, state in states.items():
        reacted_s = left_s[joint] - since_s
        reported = reports.lost_s[joint] <= left_s[joint] + cell.cycle_time_s
        early = reacted_s < EARLIEST_REACTION * timeout_s and not reported
        if state is PowerState.OPERATION_ENABLED or early:
            reacted_s = math.nan
        found[joint] = reacted_s, state.words + ", before the timeout" * early
    return found


def _await_emergencies(
    axes: CanServoAxes,
    clock: Clock,
    cell: CellConfig,
    due_s: float,
    until_s: float,
    reports: _Reports,
) -> None:
    """Run cycles until each drive has reported the silence, or until `until_s` [s]."""
    while clock.now_s() < until_s and any(map(math.isnan, reports.lost_s.values())):
        due_s = _cycle(axes, clock, cell, due_s)
        for event in axes.take_events():
            reports.add(event, expected=_REACTIONS)
        axes.quick_stop()


def _observe_stops(
    axes: CanServoAxes,
    clock: Clock,
    cell: CellConfig,
    due_s: float,
    until_s: float,
    reports: _Reports,
) -> dict[str, float]:
    """Run cycles until all drives have stopped, or until `until_s`; return the times [s] or NaN.

    A message about a failure does not yet prove that the drive stops. The time of the message
    counts only if the drive's next answer shows that it has left Operation Enabled, or if it does
    not answer. Only drives whose answer shows this get Disable Voltage. No drive gets a quick stop
    from this computer, because its effect could be mistaken for the drive's own reaction.
    """
    left_s = reports.left_s
    words = dict.fromkeys(axes.joint_names, ControlWord.ENABLE_OPERATION)
    follow = True
    while follow and clock.now_s() < until_s:
        due_s = _cycle(axes, clock, cell, due_s)
        for event in axes.take_events():
            reports.add(event, expected=_REACTIONS)
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
