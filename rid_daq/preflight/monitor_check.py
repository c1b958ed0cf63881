"""Lines of the preflight on the drive monitor: devices, temperatures, nominal data."""

from __future__ import annotations

import math
from collections.abc import Sequence

from config.cell.cell import CellConfig
from config.cell.drive_profile import DriveProfile
from config.cell.monitor import MonitorConfig
from config.errors import DriverError
from config.plausible import ZERO_CELSIUS_K
from config.robot.robot import RobotDescription
from drivers.interfaces.drive_monitor import MonitorReading, MotorData
from drivers.modbus.drive_monitor import open_drive_monitor
from rid_daq.preflight.check_line import CheckLine

CONSTANT_TOLERANCE = 0.01


def monitor_lines(
    cell: CellConfig, robot: RobotDescription, profile: DriveProfile | None
) -> list[CheckLine]:
    """Return lines on the drive monitor, from one reading of every drive.

    The list is empty if the cell has no monitor.
    """
    monitor = cell.monitor
    if monitor is None or profile is None:
        return []
    link = monitor.link
    where = f"{link.host}:{link.port}" if link.kind == "tcp" else link.address
    plain = link.kind == "tcp" and link.tls is None and link.host not in ("127.0.0.1", "localhost")
    lines = [
        CheckLine(
            where,
            "drive monitor, encryption",
            "",
            "not used: keep this network separate from other networks"
            if plain
            else "not needed or in use",
            "shown",
        )
    ]
    try:
        with open_drive_monitor(monitor, profile) as drives:
            reading = drives.read()
            lines += _temperature_lines(cell, monitor, reading)
            motors = drives.motors() if not reading.problems else ()
    except DriverError as error:
        return [
            *lines,
            CheckLine(where, "drive monitor", "answers", str(error), "red", _REACH),
        ]
    return lines + _torque_constant_lines(cell, robot, motors)


_REACH = "check monitor.link, monitor.units and the drives' own Modbus settings"


def _temperature_lines(
    cell: CellConfig, monitor: MonitorConfig, reading: MonitorReading
) -> list[CheckLine]:
    problems = iter(reading.problems)
    lines = []
    for axis, unit, value in zip(
        cell.axes, monitor.units, reading.temperature_k.tolist(), strict=True
    ):
        answered = math.isfinite(value)
        cool = answered and value <= monitor.warmest_k
        temperature_c = value - ZERO_CELSIUS_K
        lines.append(
            CheckLine(
                where=f"{axis.joint}, node {axis.node_id}",
                what="motor temperature [°C]",
                required=f"≤ {monitor.warmest_k - ZERO_CELSIUS_K:.0f}",
                found=f"{temperature_c:.1f}" if answered else f"no answer of unit {unit}",
                verdict="ok" if cool else "red",
                next_action=""
                if cool
                else ("let the motor cool down" if answered else f"{next(problems, '')}; {_REACH}"),
                of_drive=True,
                temperature_c=temperature_c if answered else None,
            )
        )
    return lines


def _torque_constant_lines(
    cell: CellConfig, robot: RobotDescription, motors: Sequence[MotorData]
) -> list[CheckLine]:
    """Compare the torque constants of the drives with those of the robot file.

    Identification uses the constants of the robot file.
    """
    lines = []
    for axis, joint, motor in zip(cell.axes, robot.joints, motors, strict=bool(motors)):
        of_motor = motor.torque_constant_nm_per_a
        wanted = joint.torque_constant_nm_per_a
        if math.isnan(of_motor):
            continue
        found = of_motor * abs(joint.gear_ratio)
        good = wanted is None or abs(found / wanted - 1.0) <= CONSTANT_TOLERANCE
        lines.append(
            CheckLine(
                where=f"{axis.joint}, node {axis.node_id}",
                what="torque constant, gear included [N m/A]",
                required="" if wanted is None else f"{wanted:.4g}",
                found=f"{found:.4g}",
                verdict="shown" if wanted is None else ("ok" if good else "red"),
                next_action=""
                if good
                else "correct torque_constant_nm_per_a in the robot file, or the drives' profile",
                of_drive=True,
            )
        )
    return lines
