"""What a drive must hold before motion: `Requirement`, the safety settings and the two PDOs.

The heartbeat consumer (1016h) with abort connection (6007h) is what stops a drive when this
computer dies; the RPDO's event timer (1400h:05) does it once more where a drive has it.
"""

from __future__ import annotations

from dataclasses import dataclass

from config.cell.cell import CellConfig
from config.errors import ConfigError
from drivers.canopen.frames import rpdo_cob_id, tpdo_cob_id
from drivers.canopen.heartbeat import consumer_entry
from drivers.canopen.pdo import ON_EVENT, RPDO_COMMUNICATION, MappedObject, PdoMapping
from drivers.servo.cia402 import CYCLIC_SYNCHRONOUS_VELOCITY, AxisUnits
from drivers.servo.stop_ramp import uses_profile_deceleration

STATUS_EVENT_MS = 100


@dataclass(frozen=True, slots=True)
class Requirement:
    """One object that must hold a value; `value` None: it is only read and shown.

    `optional` objects may be missing in a drive; `watchdog` ones may be wrong where the cell file
    allows it; `write` False leaves it to the drive to be right.
    """

    index: int
    subindex: int
    size: int
    name: str
    value: int | None = None
    signed: bool = False
    optional: bool = False
    watchdog: bool = False
    write: bool = True
    mask: int = -1
    hexadecimal: bool = False

    def words(self, value: int) -> str:
        """Return a value as it is shown."""
        return f"{value & (1 << 8 * self.size) - 1:X}h" if self.hexadecimal else str(value)

    def encoded(self, value: int) -> bytes:
        """Return a value as it is written.

        Raises
        ------
        ConfigError
            It does not fit.
        """
        try:
            return value.to_bytes(self.size, "little", signed=self.signed)
        except OverflowError:
            raise ConfigError(
                f"{self.name}: the cell asks for {value}, which does not fit the"
                f" {8 * self.size} bits of {self.index:04X}h; correct the cell file"
            ) from None


def identity_requirement(
    subindex: int, name: str, value: int | None, mask: int = -1
) -> Requirement:
    """Return what a part of 1018h must be; nothing, if `value` is None, and then it may miss."""
    return Requirement(
        0x1018,
        subindex,
        4,
        name,
        value,
        optional=value is None,
        write=False,
        mask=mask,
        hexadecimal=True,
    )


def cyclic_pdos(node_id: int, exchange: str) -> tuple[PdoMapping, ...]:
    """Return the PDOs of a drive in a cell's `exchange`, full or trimmed.

    Those with a SYNC are taken up and sent at every SYNC. In the trimmed exchange the statusword
    comes when it changes, and every `STATUS_EVENT_MS`.
    """
    word, status = MappedObject(0x6040, 0, 16), MappedObject(0x6041, 0, 16)
    velocity, offset = MappedObject(0x60FF, 0, 32), MappedObject(0x60B2, 0, 16)
    position, torque = MappedObject(0x6064, 0, 32), MappedObject(0x6077, 0, 16)
    if exchange == "full":
        return (
            PdoMapping("rpdo", 1, rpdo_cob_id(node_id), (word, velocity, offset)),
            PdoMapping("tpdo", 1, tpdo_cob_id(node_id), (status, position, torque)),
        )
    return (
        PdoMapping("rpdo", 1, rpdo_cob_id(node_id), (velocity,)),
        PdoMapping("rpdo", 2, rpdo_cob_id(node_id, 2), (word,)),
        PdoMapping("tpdo", 1, tpdo_cob_id(node_id), (position, torque)),
        PdoMapping(
            "tpdo", 2, tpdo_cob_id(node_id, 2), (status,), ON_EVENT, event_timer_ms=STATUS_EVENT_MS
        ),
    )


def safety_requirements(cell: CellConfig, units: AxisUnits) -> tuple[Requirement, ...]:
    """Return what every drive of a cell must be told: monitoring, reactions, limits, mode.

    A drive knows its motor alone: with a coupled wrist its following error and its deceleration are
    the motor's, over its gear ratio.
    """
    safety = cell.drive_safety
    window = abs(round(safety.following_error_rad * units.counts_per_rad))
    deceleration = abs(
        round(safety.quick_stop_deceleration_rad_s2 * units.velocity_units_per_rad_s)
    )
    by_profile: tuple[Requirement, ...] = ()
    if uses_profile_deceleration(cell):
        by_profile = (Requirement(0x6084, 0, 4, "profile deceleration", deceleration),)
    master = consumer_entry(safety.master_node_id, safety.master_heartbeat_timeout_ms)
    return (
        Requirement(0x1005, 0, 4, "SYNC identifier", 0x80, mask=0x4000_07FF, write=False),
        Requirement(0x1006, 0, 4, "SYNC period [us]", optional=True),
        Requirement(0x1017, 0, 2, "heartbeat period [ms]", safety.drive_heartbeat_ms),
        Requirement(
            0x1016, 1, 4, "watch on this computer's heartbeat", master,
            watchdog=True, hexadecimal=True,
        ),
        Requirement(0x1029, 1, 1, "reaction to a communication error", 0, optional=True),
        Requirement(
            0x6007, 0, 2, "abort connection", safety.abort_connection,
            signed=True, watchdog=True,
        ),
        Requirement(0x605A, 0, 2, "quick-stop reaction", safety.quick_stop_option, signed=True),
        Requirement(0x605B, 0, 2, "shutdown reaction", signed=True, optional=True),
        Requirement(0x605C, 0, 2, "disable-operation reaction", signed=True, optional=True),
        Requirement(0x605D, 0, 2, "halt reaction", signed=True, optional=True),
        Requirement(0x605E, 0, 2, "fault reaction", safety.fault_reaction_option, signed=True),
        Requirement(0x6085, 0, 4, "quick-stop deceleration", deceleration),
        *by_profile,
        Requirement(0x6065, 0, 4, "following-error window", window),
        Requirement(0x6066, 0, 2, "following-error time [ms]", safety.following_error_timeout_ms),
        Requirement(
            0x6072, 0, 2, "torque limit [0.1 %]", round(1000 * safety.torque_limit_fraction)
        ),
        Requirement(0x607D, 1, 4, "software position limit, low", signed=True, optional=True),
        Requirement(0x607D, 2, 4, "software position limit, high", signed=True, optional=True),
        Requirement(
            0x6060, 0, 1, "mode: cyclic synchronous velocity", CYCLIC_SYNCHRONOUS_VELOCITY,
            signed=True,
        ),
        Requirement(0x60C2, 1, 1, "cycle time [ms]", cell.cycle_time_ms),
        Requirement(0x60C2, 2, 1, "cycle time, power of ten", -3, signed=True),
        Requirement(
            RPDO_COMMUNICATION, 5, 2, "command timeout [ms]",
            safety.master_heartbeat_timeout_ms, optional=True,
        ),
    )  # fmt: skip
