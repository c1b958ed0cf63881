"""`StopRamp`: stopping distance and time of an axis, computed from the values in its drive.

A distance or time that is too long makes a red setting. The computation uses the values that were
read back from the drive, because a deceleration that rounds to 0 in the drive's units does not stop
the axis. It includes the detection of a fault: with a limit that is too wide, for example for the
following error, an axis could run through its whole range before the stop begins.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from config.cell.cell import CellConfig, DriveAxis
from config.cell.fixed_pdo import object_address
from config.cell.servo_profile import ServoProfile, TorqueObject
from config.errors import ConfigError
from config.robot.robot import Joint, RobotDescription
from drivers.interfaces.servo_axes import DriveSetting
from drivers.servo.cia402 import AxisUnits, MotorRatings

LONGEST_STOP_S = 2.0
LEAST_TORQUE_FRACTION = 0.9

PROFILE_DECELERATION = (0x6084, 0)
QUICK_STOP_DECELERATION = (0x6085, 0)
FOLLOWING_ERROR_WINDOW = (0x6065, 0)
FOLLOWING_ERROR_TIME_MS = (0x6066, 0)

_FURTHER_LIMITS: Final = (
    ("current limit [0.1 %]", TorqueObject(object="6073h:00", of="rated_current")),
    ("torque limit, positive direction [0.1 %]", TorqueObject(object="60E0h:00")),
    ("torque limit, negative direction [0.1 %]", TorqueObject(object="60E1h:00")),
)

_TORQUE_FRACTION = "drive_safety.torque_limit_fraction"
_QUICK_STOPS_BY_PROFILE = (1, 5)
_FAULT_REACTION_BY_PROFILE = 1
_WINDOW_OFF = 0xFFFF_FFFF

Held = Mapping[tuple[int, int], int]


class _Delay(NamedTuple):
    """Delay between a fault (`after`) and the ramp: time at top speed, and additional travel.

    `lower` names the keys of the cell file that shorten the delay.
    """

    after: str
    time_s: float
    travel: float
    lower: str


@dataclass(frozen=True, slots=True)
class StopRamp:
    """Deceleration ramp of an axis from its largest allowed velocity to rest.

    Attributes:
        velocity: Velocity at which the ramp begins [rad/s or m/s].
        deceleration: Deceleration in the drive [rad/s² or m/s²]; 0 if it rounds to 0 in the drive's
            units.
    """

    velocity: float
    deceleration: float

    @property
    def time_s(self) -> float:
        """Duration of the ramp [s]; infinite if the deceleration is 0."""
        return self.velocity / self.deceleration if self.deceleration > 0.0 else math.inf

    @property
    def distance(self) -> float:
        """Distance that the axis moves during the ramp [rad or m]."""
        return 0.5 * self.velocity * self.time_s


def quick_stop_decelerations(cell: CellConfig, robot: RobotDescription) -> list[float]:
    """Return each axis's deceleration in a quick stop, base to flange [rad/s² or m/s²].

    For a drive whose 6085h cannot be written, the deceleration is the `deceleration_rad_s2` of its
    axis in the cell file. For all other drives it is the value that is written to them.
    """
    found = {
        axis.joint: cell.servo_of(axis).deceleration_rad_s2
        or cell.safety_of(axis).quick_stop_deceleration_rad_s2
        for axis in cell.axes
    }
    return [found[name] for name in robot.joint_names]


def longest_ramp_s(cell: CellConfig, robot: RobotDescription) -> float:
    """Return the duration of the longest quick stop [s], at most `LONGEST_STOP_S`."""
    decelerations = quick_stop_decelerations(cell, robot)
    ramps = (
        StopRamp(joint.limits.velocity, deceleration)
        for joint, deceleration in zip(robot.joints, decelerations, strict=True)
    )
    return min(max(ramp.time_s for ramp in ramps), LONGEST_STOP_S)


def uses_profile_deceleration(cell: CellConfig) -> bool:
    """Return True if a stop can use 6084h instead of 6085h (CiA 402-2, 605Ah)."""
    safety = cell.drive_safety
    return (
        safety.quick_stop_option in _QUICK_STOPS_BY_PROFILE
        or safety.fault_reaction_option == _FAULT_REACTION_BY_PROFILE
    )


def stop_settings(
    cell: CellConfig,
    axis: DriveAxis,
    joint: Joint,
    motor: MotorRatings,
    units: AxisUnits,
    held: Held,
) -> Iterator[DriveSetting]:
    """Compare the stopping distances and times of one axis with their limits.

    Args:
        cell, axis, joint, motor, units: The cell with the limits, the drive, its joint, its motor,
            and the conversion of the drive's numbers to the joint's units. In a robot with a
            coupled wrist, all motions are those of the motor, divided by its gear ratio.
        held: Values that were read back, by index and subindex. An object that could not be read is
            missing here; its setting is already red.

    Yields:
        The results for a stop that is ordered, for the slowest stop after a fault, and for the
        torque that a stop needs.
    """
    ramp = _ramp(cell, axis, joint, units, held)
    if ramp is not None:
        yield _check_ordered_stop(cell, axis, joint, ramp)
        yield _check_fault_stop(cell, axis, joint, units, held, ramp)
    profile = cell.servo_of(axis)
    limits = [limit for _, limit in further_torque_limits(profile)]
    if profile.torque_limit is not None:
        limits = [profile.torque_limit, *limits]
    for limit in limits:
        if object_address(limit.object) in held:
            yield _check_torque_limit(axis, joint, motor, limit, held, profile.not_compared)


def further_torque_limits(profile: ServoProfile) -> Iterator[tuple[str, TorqueObject]]:
    """Yield the limits of CiA 402 that act besides `torque_limit`, each with its name.

    A drive applies the smallest of all its limits.
    """
    own = profile.torque_limit
    for name, limit in _FURTHER_LIMITS:
        if own is None or own.object != limit.object:
            yield name, limit


def _check_torque_limit(
    axis: DriveAxis,
    joint: Joint,
    motor: MotorRatings,
    limit: TorqueObject,
    held: Held,
    not_compared: Sequence[str],
) -> DriveSetting:
    """Check that a limit in the drive allows the torque that a stop needs."""
    value = held[object_address(limit.object)]
    try:
        allowed_nm = abs(joint.gear_ratio) * motor.nm_per_unit(limit) * value
    except ConfigError as error:
        if motor.rated_nm is None or limit.of == "ampere":
            return DriveSetting(
                joint.name, axis.node_id, limit.object, "torque for a stop", "",
                f"{value}: {error}", "shown",
            )  # fmt: skip
        allowed_nm = abs(joint.gear_ratio) * motor.rated_nm * value / limit.units
    checked = _check_torque(axis, joint, limit.object, allowed_nm)
    if limit.object[:5] in not_compared:
        return replace(checked, required="", verdict="shown", next_action="")
    return checked


def _ramp(
    cell: CellConfig, axis: DriveAxis, joint: Joint, units: AxisUnits, held: Held
) -> StopRamp | None:
    """Return the longest possible ramp of a stop; None if a deceleration could not be read."""
    velocity = joint.limits.velocity * (1.0 + cell.supervision.limit_margin_fraction)
    stated = cell.servo_of(axis).deceleration_rad_s2
    if stated is not None:
        return StopRamp(velocity, stated)
    used: tuple[tuple[int, int], ...] = (QUICK_STOP_DECELERATION,)
    if uses_profile_deceleration(cell):
        used = (*used, PROFILE_DECELERATION)
    if not all(key in held for key in used):
        return None
    least = min(held[key] for key in used)
    return StopRamp(velocity, least / abs(units.acceleration_units_per_rad_s2))


def _check_ordered_stop(
    cell: CellConfig, axis: DriveAxis, joint: Joint, ramp: StopRamp
) -> DriveSetting:
    """Check a stop that is ordered at top speed; it begins at the second SYNC after the order."""
    before_s = 2.0 * cell.cycle_time_s
    time_s = before_s + ramp.time_s
    distance = ramp.velocity * before_s + ramp.distance
    good = time_s <= LONGEST_STOP_S and distance <= _range(joint)
    return DriveSetting(
        joint.name,
        axis.node_id,
        "6085h:00",
        "stop from top speed",
        _required_text(joint),
        _found_text(time_s, distance, joint) + f" from {ramp.velocity:.3g} {joint.unit}/s",
        "ok" if good else "red",
        ""
        if good
        else "raise drive_safety.quick_stop_deceleration_rad_s2: the axis would not stop"
        " in time, or not within its range",
    )


def _check_fault_stop(
    cell: CellConfig, axis: DriveAxis, joint: Joint, units: AxisUnits, held: Held, ramp: StopRamp
) -> DriveSetting:
    """Check the slowest stop after a fault, including the time until the fault is detected."""
    delays = list(_delays(cell, units, held, ramp.velocity))
    far = [ramp.velocity * each.time_s + each.travel + ramp.distance for each in delays]
    late = [each.time_s + ramp.time_s for each in delays]
    beyond = [i for i in range(len(delays)) if far[i] > _range(joint) or late[i] > LONGEST_STOP_S]
    worst = max(beyond or range(len(delays)), key=lambda i: (far[i], late[i]))
    lower = " and ".join(delays[i].lower for i in beyond)
    return DriveSetting(
        joint.name,
        axis.node_id,
        "6085h:00",
        "rest after a fault",
        _required_text(joint),
        f"{_found_text(late[worst], far[worst], joint)} ({delays[worst].after})",
        "red" if beyond else "ok",
        f"lower {lower}, or raise drive_safety.quick_stop_deceleration_rad_s2" if beyond else "",
    )


def _delays(cell: CellConfig, units: AxisUnits, held: Held, velocity: float) -> Iterator[_Delay]:
    safety, rules, cycle_s = cell.drive_safety, cell.supervision, cell.cycle_time_s
    yield _Delay(
        "this computer fails", 1e-3 * safety.master_heartbeat_timeout_ms, 0.0,
        "drive_safety.master_heartbeat_timeout_ms",
    )  # fmt: skip
    yield _Delay(
        "another drive fails", 1e-3 * safety.drive_heartbeat_timeout_ms + 2.0 * cycle_s, 0.0,
        "drive_safety.drive_heartbeat_timeout_ms",
    )  # fmt: skip
    yield _Delay(
        "answers are lost", (rules.missed_frames_limit + 2) * cycle_s, 0.0,
        "supervision.missed_frames_limit",
    )  # fmt: skip
    yield _Delay(
        "this computer is late", (rules.late_by_cycles_limit + 2.0) * cycle_s, 0.0,
        "supervision.late_by_cycles_limit",
    )  # fmt: skip
    yield _Delay(
        "an encoder is stuck", (rules.stuck_encoder_cycles + 2) * cycle_s, 0.0,
        "supervision.stuck_encoder_cycles",
    )  # fmt: skip
    allowed = rules.following_error_min_rad + rules.following_error_per_velocity_s * velocity
    yield _Delay(
        "following error, detected by this computer", 2.0 * cycle_s, allowed,
        "supervision.following_error_min_rad and supervision.following_error_per_velocity_s",
    )  # fmt: skip
    if FOLLOWING_ERROR_WINDOW in held and FOLLOWING_ERROR_TIME_MS in held:
        counts = held[FOLLOWING_ERROR_WINDOW]
        window = math.inf if counts == _WINDOW_OFF else counts / abs(units.counts_per_rad)
        yield _Delay(
            "following error, detected by the drive", 1e-3 * held[FOLLOWING_ERROR_TIME_MS], window,
            "drive_safety.following_error_rad and drive_safety.following_error_timeout_ms",
        )  # fmt: skip


def _check_torque(axis: DriveAxis, joint: Joint, limit: str, allowed: float) -> DriveSetting:
    """Check that the drive's torque limit `allowed` is enough for a stop [N m or N]."""
    wanted = LEAST_TORQUE_FRACTION * joint.limits.torque
    good = allowed >= wanted
    by_tool = any(limit == each.object for _, each in _FURTHER_LIMITS)
    raising = "the limit with the manufacturer's tool" if by_tool else _TORQUE_FRACTION
    return DriveSetting(
        joint.name,
        axis.node_id,
        limit,
        "torque for a stop",
        f"≥ {wanted:.4g} {joint.torque_unit}",
        f"{allowed:.4g} {joint.torque_unit}",
        "ok" if good else "red",
        ""
        if good
        else f"raise {raising}, or lower the joint's limits.torque in the robot file to the drive's"
        " torque",
    )


def _range(joint: Joint) -> float:
    return joint.limits.position_max - joint.limits.position_min


def _required_text(joint: Joint) -> str:
    return f"≤ {LONGEST_STOP_S:g} s, ≤ {_range(joint):.3g} {joint.unit}"


def _found_text(time_s: float, distance: float, joint: Joint) -> str:
    if math.isinf(time_s):
        return "never stops: the deceleration is 0 in the drive's units"
    if math.isinf(distance):
        return "the drive itself does not stop: it does not monitor its following error"
    return f"{time_s:.3g} s, {distance:.3g} {joint.unit}"
