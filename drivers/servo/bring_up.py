"""Checks during the bring-up of a cell's drives: other masters, boot-up messages, settings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from config.cell.cell import CellConfig, DriveAxis
from config.cell.servo_profile import ServoProfile
from config.errors import (
    ConfigError,
    DeviceFaultError,
    DeviceTimeoutError,
    PreflightError,
    ProtocolError,
)
from config.robot.robot import RobotDescription
from drivers.canopen.bus_load import LOAD_LIMIT, cyclic_load, typical_bits
from drivers.canopen.nmt import NmtCommand, nmt_frame
from drivers.interfaces.servo_axes import DriveSetting
from drivers.ports.can_link import CanLink
from drivers.servo.axis_frames import AxisFrames
from drivers.servo.drive_watch import DriveWatch
from drivers.servo.requirements import STATUS_EVENT_MS

FULL_BYTES = (6, 8)
TRIMMED_BYTES = (4, 6)
BOOT_TIMEOUT_S = 5.0
SETTLE_S = 0.02


def axes_in_joint_order(cell: CellConfig, robot: RobotDescription) -> tuple[DriveAxis, ...]:
    """Return the cell's axes in the order of the robot's joints.

    Raises:
        ConfigError: A joint has no drive, or a drive moves a joint that the robot does not have.
    """
    by_joint = {axis.joint: axis for axis in cell.axes}
    missing = [name for name in robot.joint_names if name not in by_joint]
    surplus = [name for name in by_joint if name not in robot.joint_names]
    if missing or surplus:
        raise ConfigError(
            f"cell {cell.name!r} and robot {robot.name!r} do not fit: joints without a drive:"
            f" {', '.join(missing) or 'none'}; drives of unknown joints:"
            f" {', '.join(surplus) or 'none'}",
            code="RID-CELL-JOINTS",
        )
    return tuple(by_joint[name] for name in robot.joint_names)


def bus_load(cell: CellConfig) -> float:
    """Return the typical load of a cell's bus, by cyclic exchange and heartbeats (1.0 is full)."""
    safety = cell.drive_safety
    trimmed = cell.exchange == "trimmed"
    more_bits = sum(_more_bits(axis.node_id, cell.servo_of(axis)) for axis in cell.axes)
    return more_bits / cell.cycle_time_s / cell.can.bitrate + cyclic_load(
        len(cell.axes),
        cell.cycle_time_s,
        cell.can.bitrate,
        heartbeats_s=(safety.master_heartbeat_ms / 1000.0, safety.drive_heartbeat_ms / 1000.0),
        frame_bytes=TRIMMED_BYTES if trimmed else FULL_BYTES,
        status_s=STATUS_EVENT_MS / 1000.0 if trimmed else math.inf,
        guarded=sum(cell.servo_of(axis).watch == "life_guarding" for axis in cell.axes),
    )


def _more_bits(node_id: int, profile: ServoProfile) -> int:
    """Return the bits per cycle that a drive needs beyond one frame in each direction [bit]."""
    if not profile.spread:
        return 0
    frames = AxisFrames.of_profile(node_id, profile)
    sizes = (*frames.sent_bytes, *frames.answer_bytes)
    return sum(map(typical_bits, sizes)) - sum(map(typical_bits, FULL_BYTES))


def check_bus_load(cell: CellConfig) -> float:
    """Return `bus_load`.

    Raises:
        ConfigError: The bus load is above 80 %.
    """
    load = bus_load(cell)
    if load > LOAD_LIMIT:
        spread = any(cell.servo_of(axis).spread for axis in cell.axes)
        trim = ", set exchange: trimmed" if cell.exchange == "full" and not spread else ""
        raise ConfigError(
            f"cell {cell.name!r}: {len(cell.axes)} axes every {cell.cycle_time_ms} ms would fill"
            f" {100 * load:.0f} % of the CAN bus at {cell.can.bitrate} bit/s, more than"
            f" {100 * LOAD_LIMIT:.0f} %; raise cycle_time_ms or the bit rate{trim}",
            code="RID-CAN-LOAD",
        )
    return load


def wait_for_boot_up(link: CanLink, axes: Sequence[DriveAxis], watch: DriveWatch) -> None:
    """Reset every drive's communication, and wait until each has booted.

    Raises:
        LockedError: Another master was detected.
        DeviceTimeoutError: A drive does not boot.
        ProtocolError: Two devices boot with the same node id.
    """
    for axis in axes:
        link.send(nmt_frame(NmtCommand.RESET_COMMUNICATION, axis.node_id))
    _listen(link, watch, BOOT_TIMEOUT_S, until_booted=True)
    silent = _joint_names(axes, (not count for count in watch.boot_ups))
    if silent:
        raise DeviceTimeoutError(
            f"no boot-up message within {BOOT_TIMEOUT_S:g} s from {silent}; check power, node id,"
            " bit rate and termination",
            code="RID-DRIVE-SILENT",
        )
    _listen(link, watch, SETTLE_S, until_booted=False)
    twice = _joint_names(axes, (count > 1 for count in watch.boot_ups))
    if twice:
        raise ProtocolError(
            f"more than one boot-up message came from {twice}; two devices may share the node id,"
            " or the drive resets itself",
            code="RID-DRIVE-NODE-TWICE",
        )


def refuse_restarted(axes: Sequence[DriveAxis], watch: DriveWatch) -> None:
    """Raise `DeviceFaultError` if a drive has restarted since its setup began."""
    restarted = _joint_names(axes, map(bool, watch.boot_ups))
    if restarted:
        raise DeviceFaultError(
            "a drive has booted again since its setup began, and lost its configuration:"
            f" {restarted}; check its supply, then run the command again",
            code="RID-DRIVE-RESTARTED",
        )


def refuse_red(settings: Iterable[DriveSetting]) -> None:
    """Raise `PreflightError` if a setting is red; the error names all red settings."""
    red = [setting for setting in settings if setting.verdict == "red"]
    problems = [
        f"{s.joint} (node {s.node_id}): {s.name} {s.object_name} is {s.found},"
        f" required: {s.required}" + (f" ({s.next_action})" if s.next_action else "")
        for s in red
    ]
    if red:
        raise PreflightError(
            "; ".join(problems) + ". Nothing is moved; correct the drive or the cell file",
            code=common_code(setting.code for setting in red),
        )


def common_code(codes: Iterable[str]) -> str:
    """Return the common error code of red settings; RID-PREFLIGHT-RED without one."""
    distinct = set(codes)
    return (distinct.pop() if len(distinct) == 1 else "") or "RID-PREFLIGHT-RED"


def listen_for_masters(link: CanLink, cell: CellConfig, watch: DriveWatch) -> None:
    """Listen for another master before the first frame: for a heartbeat timeout, or 2.5 cycles.

    The longer of the two times counts.

    Raises:
        LockedError: Another master was detected.
    """
    timeout_s = cell.drive_safety.master_heartbeat_timeout_ms / 1000.0
    until_s = link.clock.now_s() + max(2.5 * cell.cycle_time_s, timeout_s)
    while link.clock.now_s() < until_s:
        frame = link.receive(until_s)
        if frame is not None:
            watch.refuse_foreign_master(frame.cob_id)
            watch.handle_emergency(frame, link.last_time_s)


def _listen(link: CanLink, watch: DriveWatch, duration_s: float, *, until_booted: bool) -> None:
    until_s = link.clock.now_s() + duration_s
    while link.clock.now_s() < until_s and not (until_booted and all(watch.boot_ups)):
        frame = link.receive(until_s)
        if frame is not None:
            watch.handle(frame, link.last_time_s)


def _joint_names(axes: Sequence[DriveAxis], chosen: Iterable[bool]) -> str:
    return ", ".join(
        f"{axis.joint} (node {axis.node_id})" for axis, yes in zip(axes, chosen, strict=True) if yes
    )
