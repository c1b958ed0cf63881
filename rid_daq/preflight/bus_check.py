"""Lines of the preflight on the bus: load, queue, senders, watchdogs."""

from __future__ import annotations

import math

from config.cell.cell import CellConfig
from drivers.canopen.bus_load import LOAD_LIMIT
from drivers.canopen.frames import tpdo_cob_id
from drivers.cell import Cell
from drivers.ports.can_interface import CanInterface, read_interface, transmit_queue_frames
from drivers.servo.bring_up import bus_load
from drivers.servo.watchdog_test import (
    WatchdogResult,
    reaction_limit_s,
    run_watchdog_test,
    switches_power,
)
from rid_daq.preflight.check_line import CheckLine

LONGEST_QUEUE = 128
SPARE_FRAMES = 2
_DRIVE = (
    "this drive did not stop when this computer sent no heartbeat: do not move it. See its manual"
    " on 1016h (or 100Ch and 100Dh) and 6007h, or list its node id in"
    " drive_safety.allow_drive_without_watchdog"
)
NOT_TESTED = "reaction if this computer fails"
_COMPUTER = (
    "this computer did not detect that the drive's heartbeat was missing: check 1017h in"
    " the drive, or 100Ch"
)


def bus_lines(cell: CellConfig) -> list[CheckLine]:
    """Return the lines of a SocketCAN interface; an empty list for other buses.

    Frames in the transmit queue cannot be withdrawn: after a pulled cable is plugged in again, they
    would be sent at an unexpected time. The queue must therefore be short; but a queue that cannot
    hold the frames of one cycle drops some. A controller that leaves bus-off by itself would also
    send old frames.
    """
    if cell.can.interface != "socketcan":
        return []
    least = len(cell.axes) + SPARE_FRAMES
    found = transmit_queue_frames(cell.can.channel)
    good = found is not None and least <= found <= LONGEST_QUEUE
    return [
        *interface_lines(cell, read_interface(cell.can.channel)),
        CheckLine(
            where=f"socketcan:{cell.can.channel}",
            what="transmit queue (txqueuelen)",
            required=f"{least} to {LONGEST_QUEUE}",
            found="unknown" if found is None else str(found),
            verdict="ok" if good else "red",
            next_action=f"ip link set {cell.can.channel} txqueuelen {max(10, least)}",
        ),
    ]


def interface_lines(cell: CellConfig, interface: CanInterface | None) -> list[CheckLine]:
    """Return the lines on state, bit rate and restart of a SocketCAN interface."""
    channel, bitrate = cell.can.channel, cell.can.bitrate
    where = f"socketcan:{channel}"
    set_up = f"ip link set {channel} down; ip link set {channel} type can bitrate {bitrate}"
    if interface is None:
        advice = (
            f"ip -details link show {channel}: check that the interface exists and that"
            " iproute2 is installed"
        )
        return [CheckLine(where, "interface", "known to `ip`", "unknown", "red", advice)]
    state = (interface.controller or "up") if interface.up else "down"
    rate, restart = interface.bitrate, interface.restart_ms
    return [
        CheckLine(
            where,
            "state",
            "up, ERROR-ACTIVE",
            state,
            "ok" if state in ("up", "ERROR-ACTIVE") else "red",
            f"ip link set {channel} up"
            if state in ("down", "STOPPED")
            else "check cable, termination and bit rate of every node; then run ip link set"
            f" {channel} down, and up again",
        ),
        CheckLine(
            where,
            "bit rate",
            f"{bitrate} bit/s",
            "not reported by the driver" if rate is None else f"{rate} bit/s",
            "shown" if rate is None else "ok" if rate == bitrate else "red",
            f"{set_up} restart-ms 0, or correct can.bitrate in the cell file",
        ),
        CheckLine(
            where,
            "restart after bus-off (restart-ms)",
            "0",
            "not reported by the driver" if restart is None else str(restart),
            "shown" if restart is None else "ok" if restart == 0 else "red",
            f"{set_up} restart-ms 0",
        ),
    ]


def sender_lines(opened: Cell, cycles: int) -> list[CheckLine]:
    """Return lines on frames of other senders, with a drive's identifier or an unknown one.

    Unknown identifiers are red only if they occur in more than one frame per cycle on average,
    because these frames load the bus.
    """
    axes, limit = opened.axes, opened.config.supervision.second_answers_limit
    counts = zip(
        axes.answers.second_answers.tolist(), axes.cyclic.contradictions.tolist(), strict=True
    )
    lines = [
        CheckLine(
            where=f"{axis.joint}, node {axis.node_id}",
            what="cycles with a second answer",
            required=f"< {limit}, none that differs",
            found=f"{second}, {different} with another" if second else "0",
            verdict="red" if different or second >= limit else "ok",
            next_action=f"two devices send with the identifier of node {axis.node_id}: look for"
            " another drive with this node id, and for a program or gateway that"
            f" sends {tpdo_cob_id(axis.node_id):03X}h",
            of_drive=True,
        )
        for axis, (second, different) in zip(opened.config.axes, counts, strict=True)
    ]
    if axes.watch.unexpected_frames:
        many = axes.watch.unexpected_frames > cycles
        lines.append(
            CheckLine(
                where=opened.config.can.channel,
                what="frames from devices that are not part of the cell",
                required="0",
                found=axes.bus_notes()[-1],
                verdict="red" if many else "shown",
                next_action="remove the device or program that sends them from the bus" * many,
            )
        )
    return lines


def load_line(cell: CellConfig) -> CheckLine:
    """Return the line on the load of a cell's bus."""
    load = bus_load(cell)
    bus = cell.can
    return CheckLine(
        where="simulated bus" if bus.is_simulated else f"{bus.interface}:{bus.channel}",
        what="bus load",
        required=f"≤ {100.0 * LOAD_LIMIT:.0f} %",
        found=f"{100.0 * load:.1f} %",
        verdict="ok" if load <= LOAD_LIMIT else "red",
        next_action="choose a longer cycle_time_ms or a higher bit rate",
    )


def watchdog_lines(opened: Cell, *, cleared: bool) -> list[CheckLine]:
    """Let the watchdogs of both sides expire once, with the drives at rest.

    If the test must switch drives on and no person has confirmed that the cell is clear, nothing is
    tested; the line `NOT_TESTED` reports this.

    Raises:
        DriverError, PreflightError, LockedError: The errors of
            `drivers.servo.watchdog_test.run_watchdog_test`.
    """
    if switches_power(opened.axes, opened.config) and not cleared:
        return [
            CheckLine(
                where=", ".join(opened.axes.undefined_reactions or opened.axes.joint_names),
                what=NOT_TESTED,
                required="tested with power, at rest",
                found="not tested: no person has confirmed that the cell is clear",
                verdict="red",
                next_action="clear the cell, then give --i-have-cleared-the-cell: the drives are"
                " switched on, at rest",
                of_drive=True,
            )
        ]
    trials = run_watchdog_test(opened.axes, opened.clock, opened.config)
    safety = opened.config.drive_safety
    cycle_s = opened.config.cycle_time_s
    allowed = safety.allow_drive_without_watchdog
    lines = []
    for trial in trials:
        excused = trial.node_id in allowed
        lines.append(_drive_watchdog_line(trial, reaction_limit_s(opened.config), excused=excused))
        limit_s = 1e-3 * safety.drive_heartbeat_timeout_ms + cycle_s
        good = trial.detected_s <= limit_s
        lines.append(
            CheckLine(
                where=f"{trial.joint}, node {trial.node_id}",
                what="drive heartbeat loss detected after",
                required=f"≤ {1e3 * limit_s:.0f} ms",
                found=_time_text(trial.detected_s),
                verdict="ok" if good else "red",
                next_action="" if good else _COMPUTER,
                of_drive=True,
            )
        )
    return lines


def _drive_watchdog_line(trial: WatchdogResult, limit_s: float, *, excused: bool) -> CheckLine:
    good = trial.reacted_s <= limit_s
    how = f", {trial.how}" if good else ""
    return CheckLine(
        where=f"{trial.joint}, node {trial.node_id}",
        what="reaction time if this computer fails" + (", powered" if trial.powered else ""),
        required=f"≤ {1e3 * limit_s:.0f} ms",
        found=_time_text(trial.reacted_s) + how,
        verdict="ok" if good else ("allowed" if excused else "red"),
        next_action="" if good or excused else _DRIVE,
        of_drive=True,
    )


def _time_text(time_s: float) -> str:
    return "never" if math.isnan(time_s) else f"{1e3 * time_s:.0f} ms"
