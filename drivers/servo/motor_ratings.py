"""Ratings of a motor: sources, and comparisons between cell file, drive and robot file.

Rated torque, rated current and torque constant scale every measured torque. A cell file that
contradicts its drive by more than `RATING_TOLERANCE` is therefore refused, unless `not_compared`
names the drive's object. A torque constant is refused only if it differs by more than the factor
`RATINGS_AGREE`. A smaller difference that rounding does not explain is shown with both numbers. If
a drive does not have a rating, the result is `NOT_AVAILABLE` and not an agreement.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from typing import Final, Literal, NamedTuple

from config.cell.cell import DriveAxis
from config.cell.fixed_pdo import object_address
from config.cell.servo_profile import RATINGS_AGREE, ServoProfile
from config.robot.robot import Joint
from drivers.canopen.sdo import SdoAbort, object_name
from drivers.interfaces.servo_axes import DriveSetting
from drivers.servo.cia402 import MotorRatings
from drivers.servo.requirements import INCREMENTS, RATED_TORQUE, REVOLUTIONS, Requirement
from drivers.servo.sdo_port import SdoPort
from drivers.servo.stop_ramp import Held

RATING_TOLERANCE = 0.05
"""Largest accepted difference between a rating in the cell file and in the drive, as a fraction."""
PLAUSIBLE_RATED_TORQUE = (0.01, 30.0)
"""Smallest and largest accepted rated torque of a motor at the joint, relative to the joint's
torque limit. The ratio of real motors is 0.1 to 3. If a rating in mN m is read as N m, the ratio is
1000 times as large and is detected.
"""
LEAST_INCREMENTS = 4
FEED, SHAFT_REVOLUTIONS = (0x6092, 1), (0x6092, 2)
NOT_AVAILABLE: Final = "not available"
CONTRADICTED: Final = "RID-DRIVE-RATING"

_MILLI = 1000.0


@dataclass(frozen=True, slots=True)
class StatedRating:
    """A rating that the cell file states and that a drive can also hold.

    Attributes:
        address: Index and subindex of the drive's object.
        name, unit: Name and unit.
        value: The value in the cell file [unit].
        counts_per_unit: Counts of the object per unit.
    """

    address: tuple[int, int]
    name: str
    unit: str
    value: float
    counts_per_unit: float


def rated_current_address(profile: ServoProfile) -> tuple[int, int]:
    """Return index and subindex of the object that holds the rated current [mA]."""
    return object_address(profile.rated_current_object)


def stated_ratings(profile: ServoProfile) -> Iterator[StatedRating]:
    """Yield the ratings in the cell file; also those that no conversion uses."""
    if profile.encoder_increments is not None and not profile.sets_increments:
        name = "encoder increments"
        yield StatedRating(INCREMENTS, name, "increments", profile.encoder_increments, 1.0)
    if profile.rated_torque_nm is not None:
        units = profile.rated_torque_units
        name = "rated motor torque"
        yield StatedRating(RATED_TORQUE, name, "N m", profile.rated_torque_nm, units)
    if profile.rated_current_a is not None:
        address, name = rated_current_address(profile), "rated motor current"
        yield StatedRating(address, name, "A", profile.rated_current_a, _MILLI)


def rating_requirements(profile: ServoProfile) -> tuple[Requirement, ...]:
    """Return the requirements to read the motor's ratings.

    A rating that the profile states has its value [counts]. A drive may lack this object.
    """
    used, limit = {profile.torque.of}, profile.torque_limit
    if limit is not None:
        used.add(limit.of)
    in_amperes = limit is not None and limit.of == "ampere" and profile.torque_limit_written
    stated = {each.address: each for each in stated_ratings(profile)}
    ratings = []
    if profile.encoder_increments is None:
        ratings += [
            Requirement(*INCREMENTS, 4, "encoder increments", write=False),
            Requirement(*REVOLUTIONS, 4, "per motor revolutions", write=False),
        ]
    elif INCREMENTS in stated:
        ratings.append(_stated_requirement(stated[INCREMENTS], "encoder increments"))
    units = profile.rated_torque_units
    current = rated_current_address(profile)
    for address, name, needed in (
        (
            RATED_TORQUE,
            f"rated motor torque [{'mN m' if units == _MILLI else f'1/{units:g} N m'}]",
            "rated_torque" in used,
        ),
        (current, "rated motor current [mA]", "rated_current" in used or in_amperes),
    ):
        if address in stated:
            ratings.append(_stated_requirement(stated[address], name))
        elif needed:
            ratings.append(Requirement(*address, 4, name, write=False))
    return tuple(ratings)


def _stated_requirement(stated: StatedRating, name: str) -> Requirement:
    counts = round(stated.value * stated.counts_per_unit)
    return Requirement(*stated.address, 4, name, counts, write=False, lack="shown")


def ratings_of(profile: ServoProfile, held: Held) -> MotorRatings:
    """Return the motor's ratings, from the profile or from the values `held` by its drive."""
    increments = profile.encoder_increments
    if increments is None:
        increments = held[INCREMENTS] / held[REVOLUTIONS]
    torque, current = profile.rated_torque_nm, profile.rated_current_a
    if torque is None and RATED_TORQUE in held:
        torque = held[RATED_TORQUE] / profile.rated_torque_units
    at = rated_current_address(profile)
    if current is None and at in held:
        current = held[at] / _MILLI
    constant = profile.torque_constant_nm_per_a
    if constant is None and torque is not None and current is not None:
        constant = torque / current
    return MotorRatings(increments, torque, current, constant)


def torque_setting(
    axis: DriveAxis, joint: Joint, rated_nm: float, at_joint_nm: float
) -> DriveSetting:
    """Return the check result that compares a motor's rated torque with the joint's torque limit.

    Args:
        axis, joint: The drive, and the joint that it moves.
        rated_nm, at_joint_nm: The motor's rated torque without and with its gear [N m].
    """
    limit = joint.limits.torque
    least, most = (share * limit for share in PLAUSIBLE_RATED_TORQUE)
    good = least <= at_joint_nm <= most
    return DriveSetting(
        axis.joint,
        axis.node_id,
        object_name(*RATED_TORQUE),
        "rated torque at the joint",
        f"{least:.3g} to {most:.3g} N m",
        f"{at_joint_nm:.4g} N m",
        "ok" if good else "red",
        f"the motor's rated torque is read as {rated_nm:.4g} N m; correct rated_torque_nm"
        " (N m, not mN m), rated_torque_units or torque_constant_nm_per_a in the axis's servo, or"
        f" the joint's torque limit, {limit:g} N m, in the robot file",
    )


def compare_stated_ratings(
    port: SdoPort, axis: DriveAxis, profile: ServoProfile
) -> Iterator[DriveSetting]:
    """Compare the ratings in the cell file with those that the drive holds.

    Yields:
        A result for each rating that the cell file states.

    Raises:
        DeviceTimeoutError, TransportError: The drive does not answer, or the bus is lost.
    """
    for stated in stated_ratings(profile):
        of_cell = _Source("cell file", stated.value, stated.name, stated.unit, stated.address)
        held = _held_rating(port, stated.address)
        if held is None:
            yield _unavailable(axis, of_cell)
            continue
        value = held / stated.counts_per_unit
        found = f"{value:.6g} {stated.unit} ({held:.10g})"
        if not _is_compared(profile, stated.address):
            yield _setting(axis, of_cell, "", found, "shown")
            continue
        difference = abs(stated.value - value)
        yield _comparison(
            axis,
            of_cell,
            found,
            value,
            agrees=difference <= _rounding(stated.value) + 0.5 / stated.counts_per_unit,
            accepted=difference <= RATING_TOLERANCE * value,
        )


def compare_torque_constants(
    port: SdoPort, axis: DriveAxis, joint: Joint, profile: ServoProfile, gear_ratio: float
) -> Iterator[DriveSetting]:
    """Compare the torque constants in cell file and robot file with that of the drive.

    The drive's torque constant is its rated torque divided by its rated current. Losses, and the
    choice of RMS or peak values, can change it by a factor of up to `RATINGS_AGREE`: a larger
    factor is red, a difference above `RATING_TOLERANCE` is shown with both numbers.

    Args:
        port, axis, joint, profile: The drive, its axis, its joint and its profile.
        gear_ratio: Motor radians per joint radian (or metre).

    Yields:
        A result for each of the two files that states a torque constant.

    Raises:
        DeviceTimeoutError, TransportError: The drive does not answer, or the bus is lost.
    """
    of_cell, of_robot = profile.torque_constant_nm_per_a, joint.torque_constant_nm_per_a
    if of_cell is None and of_robot is None:
        return
    motor_nm_per_a = _held_constant(port, profile)
    source = "rated torque / rated current of the drive"
    if of_cell is not None:
        stated = _Source("cell file", of_cell, "torque constant", "N m/A", RATED_TORQUE)
        yield _constant_setting(axis, stated, motor_nm_per_a, source)
        motor_nm_per_a, source = of_cell, "torque constant of the cell file"
    if of_robot is not None:
        at_joint = None if motor_nm_per_a is None else abs(gear_ratio) * motor_nm_per_a
        name = "torque constant, gear included"
        stated = _Source("robot file", of_robot, name, "N m/A", RATED_TORQUE)
        yield _constant_setting(axis, stated, at_joint, f"{source}, times the gear ratio")


def position_scale_setting(
    port: SdoPort, axis: DriveAxis, profile: ServoProfile, increments: float, gear_ratio: float
) -> DriveSetting | None:
    """Return the check result for the feed constant (6092h), which can change the unit of 6064h.

    Without scaling, 6092h is 1 (never set) or repeats the encoder's increments, per revolution of
    the motor or of the gear's output. With any other value, positions and velocities are in units
    that 608Fh does not describe; then the cell file must state `encoder_increments`.

    Args:
        port, axis, profile: The drive, its axis and its profile.
        increments: Units of 6064h per motor revolution that would be used.
        gear_ratio: Motor radians per joint radian.

    Returns:
        The result; None if the drive does not have 6092h.

    Raises:
        DeviceTimeoutError, TransportError: The drive does not answer, or the bus is lost.
    """
    try:
        feed = port.read_int(*FEED) / max(1, port.read_int(*SHAFT_REVOLUTIONS))
    except SdoAbort:
        return None
    unscaled = (1.0, increments, increments * abs(gear_ratio))
    stated = profile.encoder_increments is not None
    good = stated or any(math.isclose(feed, each, rel_tol=1e-6) for each in unscaled)
    return DriveSetting(
        axis.joint,
        axis.node_id,
        object_name(*FEED),
        "position units per revolution",
        "" if stated else f"1, {increments:.10g} or {unscaled[2]:.10g}: no scaling of positions",
        f"{feed:.10g}",
        "shown" if stated else "ok" if good else "red",
        "state encoder_increments (units of 6064h per motor revolution) and not_compared: [608Fh]"
        " in the axis's servo, or reset 6092h with the manufacturer's tool",
        "" if good else "RID-DRIVE-POSITION-UNIT",
    )


def _held_rating(port: SdoPort, address: tuple[int, int]) -> float | None:
    """Return a rating of the drive [counts]; None if it has none, or reports 0."""
    least = LEAST_INCREMENTS if address == INCREMENTS else 1
    try:
        held = float(port.read_int(*address))
        if address == INCREMENTS:
            held /= max(1, port.read_int(*REVOLUTIONS))
    except SdoAbort:
        return None
    return held if held >= least else None


def _is_compared(profile: ServoProfile, address: tuple[int, int]) -> bool:
    return object_name(*address)[:5] not in profile.not_compared


def _held_constant(port: SdoPort, profile: ServoProfile) -> float | None:
    """Return the torque constant by the drive's ratings [N m/A]; None if it lacks one."""
    current = rated_current_address(profile)
    if not (_is_compared(profile, RATED_TORQUE) and _is_compared(profile, current)):
        return None
    torque, milliamperes = _held_rating(port, RATED_TORQUE), _held_rating(port, current)
    if torque is None or milliamperes is None:
        return None
    return torque / profile.rated_torque_units / (milliamperes / _MILLI)


class _Source(NamedTuple):
    """A value in a file, with the object by which the drive can hold it."""

    file: str
    value: float
    name: str
    unit: str
    address: tuple[int, int]


def _constant_setting(
    axis: DriveAxis, stated: _Source, found: float | None, source: str
) -> DriveSetting:
    if found is None:
        return _unavailable(axis, stated)
    factor = stated.value / found
    return _comparison(
        axis,
        stated,
        f"{found:.4g} {stated.unit} ({source})",
        found,
        agrees=abs(factor - 1.0) <= RATING_TOLERANCE,
        accepted=1.0 / RATINGS_AGREE <= factor <= RATINGS_AGREE,
    )


def _unavailable(axis: DriveAxis, stated: _Source) -> DriveSetting:
    """Return the result for a drive that does not have the value."""
    found = (
        f"{NOT_AVAILABLE} in this drive: {stated.value:g} {stated.unit} of the {stated.file} is not"
        " verified"
    )
    return _setting(axis, stated, "", found, "shown", headline=stated.name)


def _comparison(
    axis: DriveAxis, stated: _Source, found: str, value: float, *, agrees: bool, accepted: bool
) -> DriveSetting:
    """Return the result for two values: equal, different but accepted, or refused."""
    required = f"{stated.value:g} {stated.unit}, as in the {stated.file}"
    if accepted and agrees:
        return _setting(axis, stated, required, found, "ok")
    percent = 100.0 * (stated.value / value - 1.0)
    found += f"; the {stated.file} states {stated.value:g} {stated.unit} ({percent:+.1f} %)"
    if accepted:
        return _setting(axis, stated, required, found, "shown", headline=stated.name)
    return _setting(axis, stated, required, found, "red")


def _setting(
    axis: DriveAxis,
    stated: _Source,
    required: str,
    found: str,
    verdict: Literal["ok", "red", "shown"],
    *,
    headline: str = "",
) -> DriveSetting:
    index = f"{stated.address[0]:04X}h"
    return DriveSetting(
        axis.joint,
        axis.node_id,
        object_name(*stated.address),
        f"{stated.name} [{stated.unit}]",
        required,
        found,
        verdict,
        f"the drive and the {stated.file} state different motors: correct the {stated.file} by the"
        f" motor's data sheet; if the drive's value is known to be wrong, add {index} to"
        " not_compared in the axis's servo",
        CONTRADICTED if verdict == "red" else "",
        headline,
    )


def _rounding(value: float) -> float:
    """Return half a unit of the last decimal digit with which a number is written."""
    exponent = Decimal(repr(value)).as_tuple().exponent
    assert isinstance(exponent, int)
    return 0.5 * 10.0**exponent
