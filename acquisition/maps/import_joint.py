"""`ImportJoint`: columns of a joint in another program's recording, and their conversion."""

from __future__ import annotations

from typing import Annotated

from pydantic import model_validator

from acquisition.maps.time_column import Column
from config.model import ConfigModel
from config.plausible import Plausible
from config.quantities import Direction, Positive

COLUMN_QUANTITIES = (
    *("position", "velocity", "current", "torque", "temperature"),
    "velocity_command",
)
"""Keys of an `ImportJoint` that are columns."""


class JointReading(ConfigModel):
    """Conversion of the numbers of one joint, in any kind of file.

    Attributes:
        joint: Name of the joint in the robot file.
        torque_constant_nm_per_a: Torque per ampere [N m/A]: that of the motor if `gear_ratio` is
            given or `side` of the map is `motor`, else that of the link side. Default: the constant
            of the robot file.
        gear_ratio: Motor turns per joint turn, to convert values of the motor to the link side;
            negative if motor and joint turn in opposite directions.
        zero_offset: Recorded position at position 0 of the robot file's joint, in the unit of the
            recorded position.
        position_sign: -1 if recorded positions and velocities have the opposite direction to the
            robot file's joint.
        torque_sign: -1 if recorded torques have the opposite direction to the robot file's joint.
        increments_per_rev: Encoder increments per turn, at the side of the gear on which positions
            were measured (`side` of the map); for the units `increments` and `increments/s`.
        rated_torque_nm: Rated torque, which the file contains as 1000 per mille or 100 percent; at
            the side of the gear that `side` names [N m].
        rated_current_a: Rated motor current, which the file contains as 1000 per mille or 100
            percent [A].
    """

    joint: str
    torque_constant_nm_per_a: Annotated[Positive, Plausible(1e-3, 5e3, "N m/A")] | None = None
    gear_ratio: Annotated[float, Plausible(0.05, 1e5, "")] | None = None
    zero_offset: float = 0.0
    position_sign: Direction = 1
    torque_sign: Direction = 1
    increments_per_rev: Annotated[Positive, Plausible(16.0, 2.0**32, "")] | None = None
    rated_torque_nm: Annotated[Positive, Plausible(1e-3, 1e5, "N m")] | None = None
    rated_current_a: Annotated[Positive, Plausible(1e-3, 2e3, "A")] | None = None

    @model_validator(mode="after")
    def _check_gear_sign(self) -> JointReading:
        if self.gear_ratio == 0.0:
            raise ValueError("gear_ratio must not be 0")
        if self.gear_ratio is not None and self.gear_ratio < 0.0 and self.position_sign < 0:
            raise ValueError(
                "gear_ratio is negative and position_sign is -1: the two signs cancel. Use only "
                "one of them"
            )
        return self


class ImportJoint(JointReading):
    """Columns of one joint: numbers, counted from 0, or names in the header.

    Attributes:
        position: Column of the position.
        velocity: Column of the velocity. It does not replace the derivative of the position: both
            are compared to detect a wrong column, unit or clock.
        current: Column of the motor current; give this or `torque`.
        torque: Column of the torque; give this or `current`.
        temperature: Column of the drive's temperature, for temperature-dependent friction: all
            joints have it, or none.
        velocity_command: Column of the velocity command, in the unit of the velocity, for the
            identification of velocity loops: all joints have it, or none.
    """

    position: Column
    velocity: Column | None = None
    current: Column | None = None
    torque: Column | None = None
    temperature: Column | None = None
    velocity_command: Column | None = None

    @model_validator(mode="after")
    def _check_torque_columns(self) -> ImportJoint:
        if (self.current is None) == (self.torque is None):
            raise ValueError("give either a torque column or a current column, not both")
        if self.current is None and self.torque_constant_nm_per_a is not None:
            raise ValueError(
                "torque_constant_nm_per_a applies to a current column only: give a"
                " current column, or remove it"
            )
        return self
