"""Lines of the preflight on the drives: bring them up, read settings back, count answers."""

from __future__ import annotations

import math
from collections import Counter

from config.cell.cell import CellConfig
from config.errors import DriverError, PreflightError, RidDaqError
from config.robot.robot import RobotDescription
from drivers.cell import Cell, open_cell
from drivers.interfaces.servo_axes import DriveSetting
from drivers.settings.write_log import WriteLog
from rid_daq.preflight.bus_check import sender_lines, watchdog_lines
from rid_daq.preflight.check_line import CheckLine
from rid_daq.preflight.drive_advice import next_action


class DriveTrouble(Exception):  # noqa: N818
    """Failure of a device during the check of the drives, with the lines so far and the error."""

    def __init__(self, lines: list[CheckLine], error: RidDaqError) -> None:
        super().__init__(str(error))
        self.lines = lines
        self.error = error


def check_drives(
    cell: CellConfig,
    robot: RobotDescription,
    seconds: float,
    write_log: WriteLog | None,
    *,
    cleared: bool,
) -> tuple[list[CheckLine], list[float]]:
    """Bring every drive up, read its settings back, count its answers, test the watchdogs.

    The watchdogs are tested only if no earlier line is red. This test switches drives on if it
    needs power and the cell is confirmed clear. No other step switches drives on.

    Args:
        write_log: Log of the writes to the drives; None to keep none.

    Returns:
        The lines, and the positions of the joints [rad or m].

    Raises:
        DriveTrouble: A device failed; it contains the lines so far.
        LockedError: Another master is active on the bus.
    """
    lines: list[CheckLine] = []
    try:
        with open_cell(cell, robot, write_log) as opened:
            try:
                opened.axes.bring_up()
            finally:
                lines = [_setting_line(setting) for setting in opened.axes.settings()]
            opened.axes.start()
            lines += _answer_lines(opened, seconds)
            position = opened.axes.answers.position.tolist()
            lines += _position_lines(opened, robot)
            if not any(line.verdict == "red" for line in lines):
                lines += watchdog_lines(opened, cleared=cleared)
    except (DriverError, PreflightError) as error:
        raise DriveTrouble(lines, error) from error
    return lines, position


def _setting_line(setting: DriveSetting) -> CheckLine:
    return CheckLine(
        where=f"{setting.joint}, node {setting.node_id}",
        what=f"{setting.object_name} {setting.name}",
        required=setting.required,
        found=setting.found,
        verdict=setting.verdict,
        next_action=next_action(setting) if setting.verdict == "red" else "",
        of_drive=True,
        code=setting.code,
        headline=setting.headline,
    )


def _position_lines(opened: Cell, robot: RobotDescription) -> list[CheckLine]:
    """Return a line for each joint: its position and its limits."""
    answers = opened.axes.answers
    lines = []
    for i, (axis, joint) in enumerate(zip(opened.config.axes, robot.joints, strict=True)):
        limits, count = joint.limits, int(answers.position_counts[i])
        position = float(answers.position[i])
        linear = joint.type == "prismatic"
        unit, scale = ("mm", 1e3) if linear else ("°", 180.0 / math.pi)
        inside = limits.position_min <= position <= limits.position_max
        low, high = scale * limits.position_min, scale * limits.position_max
        lines.append(
            CheckLine(
                where=f"{axis.joint}, node {axis.node_id}",
                what="position (6064h)",
                required=f"{low:.2f} to {high:.2f} {unit}",
                found=f"{scale * position:.2f} {unit} ({count} counts, zero at"
                f" {axis.position_zero_counts})",
                verdict="ok" if inside else "red",
                next_action="move the joint manually into its limits, restore the drive's zero,"
                f" or correct position_zero_counts (now {axis.position_zero_counts}):"
                f" the right value is {count} if the joint is at its zero position"
                " now",
                of_drive=True,
                position=position,
            )
        )
    return lines


def _answer_lines(opened: Cell, seconds: float) -> list[CheckLine]:
    """Count the answers to SYNC over some seconds, and return the lines."""
    axes, clock = opened.axes, opened.clock
    cycle_time_s = opened.config.cycle_time_s
    cycles = max(1, round(seconds / cycle_time_s))
    missing = [0] * len(axes.joint_names)
    exchanges_s: list[float] = []
    due_s = clock.now_s()
    for _ in range(cycles):
        due_s = max(due_s + cycle_time_s, clock.now_s())
        clock.sleep_until(due_s)
        sync_s = axes.exchange()
        exchanges_s.append(clock.now_s() - sync_s)
        axes.send_heartbeat(clock.now_s())
        axes.quick_stop()  # the drives need a command in each cycle; this command moves nothing
        missing = [
            count + (not received)
            for count, received in zip(missing, axes.answers.received.tolist(), strict=True)
        ]
    exchanges_s.sort()
    slow_s = exchanges_s[math.ceil(0.99 * len(exchanges_s)) - 1]
    in_time = slow_s < axes.answers_within_s
    faults = Counter(event.text for event in axes.take_events() if event.kind.is_fault)
    lines = [
        CheckLine(
            where=f"{axis.joint}, node {axis.node_id}",
            what=f"answers missing of {cycles}",
            required="0",
            found=str(count),
            verdict="ok" if count == 0 else "red",
            next_action="check cable, termination and the adapter's buffers",
            of_drive=True,
        )
        for axis, count in zip(opened.config.axes, missing, strict=True)
    ]
    lines += sender_lines(opened, cycles)
    lines.append(
        CheckLine(
            where="drives",
            what="time from SYNC to the last answer (99th percentile)",
            required=f"< {1e3 * axes.answers_within_s:.1f} ms",
            found=f"{1e3 * slow_s:.2f} ms",
            verdict="ok" if in_time else "red",
            next_action="" if in_time else "check the bus load and the adapter's latency",
        )
    )
    if opened.link.lost_frames:
        lines.append(
            CheckLine(
                opened.config.can.channel,
                "frames lost by this computer",
                "0",
                str(opened.link.lost_frames),
                "red",
                "raise net.core.rmem_max, and reduce the other load of this computer",
            )
        )
    if faults:
        found = "; ".join(
            text if times == 1 else f"{text} ({times} times)" for text, times in faults.items()
        )
        lines.append(CheckLine("drives", "faults", "none", found, "red", "see the drive's manual"))
    return lines
