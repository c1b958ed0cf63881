"""`DriveSafety`: safety settings that are written to the drives of a cell."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from config.model import ConfigModel
from config.plausible import Plausible
from config.quantities import NoTruthValue, Positive

Milliseconds = Annotated[int, Field(gt=0, le=65535)]
FollowingError = Annotated[Positive, Plausible(1e-5, 0.6, "rad or m")]
Deceleration = Annotated[Positive, Plausible(0.1, 2e3, "rad/s² or m/s²")]


class DriveSafety(ConfigModel):
    """Safety settings that are written to the drives, and read back, before motion.

    The preflight computes stopping time and distance of each axis from the values that its drive
    reads back. It refuses settings with which an axis would not stop in time, or not within its
    range; its lines on a stop and on rest after a fault show the values.

    Attributes:
        master_node_id: Node id of this computer's heartbeat.
        master_heartbeat_ms: Period of this computer's heartbeat.
        master_heartbeat_timeout_ms: Time without this heartbeat after which the drives stop
            (1016h). On a cell that is not simulated at most 100 ms: the robot continues to move for
            this time after this computer failed.
        drive_heartbeat_ms: Period of the drives' heartbeats (1017h).
        drive_heartbeat_timeout_ms: Time without a drive's heartbeat after which all drives are
            stopped; on a cell that is not simulated at most 100 ms.
        abort_connection: 6007h, the drives' reaction to a lost heartbeat: 1 fault, 2 disable
            voltage, 3 quick stop.
        quick_stop_option: Reaction to a quick stop, 605Ah.
        fault_reaction_option: Reaction to a fault, 605Eh.
        quick_stop_deceleration_rad_s2: Deceleration of a quick stop, 6085h, at the link side, of
            the axes that do not state their own.
        following_error_rad: Largest following error, 6065h, at the link side.
        following_error_timeout_ms: Time for which the following error may exceed its limit, 6066h.
        torque_limit_fraction: Limit of the drive's torque, relative to the rated torque.
        allow_drive_without_watchdog: Node ids of the drives that are accepted although they do not
            stop by themselves if this computer fails.
        trip_watchdog_with_power: The preflight switches the drives on, at rest, and withholds this
            computer's heartbeat until each drive has stopped. Without this key it does the same
            without power and checks the drives' emergency messages. A drive is always switched on
            for this test if it lacks one of the objects that define its reactions, or if it uses
            life guarding. No person may then be in the cell.
    """

    master_node_id: Annotated[int, Field(ge=1, le=127)] = 127
    master_heartbeat_ms: Milliseconds = 25
    master_heartbeat_timeout_ms: Milliseconds = 80
    drive_heartbeat_ms: Milliseconds = 50
    drive_heartbeat_timeout_ms: Milliseconds = 100
    abort_connection: Annotated[Literal[1, 2, 3], NoTruthValue] = 3
    quick_stop_option: Annotated[Literal[1, 2, 5, 6], NoTruthValue] = 2
    fault_reaction_option: Annotated[Literal[0, 1, 2], NoTruthValue] = 2
    quick_stop_deceleration_rad_s2: Deceleration
    following_error_rad: FollowingError
    following_error_timeout_ms: Annotated[int, Field(ge=0, le=65535), Plausible(0.0, 1e3, "ms")] = (
        20
    )
    torque_limit_fraction: Annotated[float, Field(gt=0.0, le=6.5), Plausible(0.05, 5.0, "")] = 3.0
    allow_drive_without_watchdog: tuple[int, ...] = ()
    trip_watchdog_with_power: bool = False

    @model_validator(mode="after")
    def _check_watchdog(self) -> DriveSafety:
        if self.master_heartbeat_ms * 2 > self.master_heartbeat_timeout_ms:
            raise ValueError(
                "master_heartbeat_ms must be at most half of master_heartbeat_timeout_ms"
            )
        if self.drive_heartbeat_ms * 2 > self.drive_heartbeat_timeout_ms:
            raise ValueError(
                "drive_heartbeat_ms must be at most half of drive_heartbeat_timeout_ms"
            )
        if self.trip_watchdog_with_power and self.abort_connection == 1:
            raise ValueError(
                "trip_watchdog_with_power and abort_connection 1 would leave the drives in fault;"
                " change one of the two"
            )
        return self
