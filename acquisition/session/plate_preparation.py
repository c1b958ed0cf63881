"""Making a force plate's amplifier ready to measure, and saying what was found."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from config.arrays import FloatArray
from config.cell.amplifier_profile import AmplifierProfile
from config.cell.plate import PlateConfig
from drivers.amplifier.amplifier import open_amplifier
from drivers.interfaces.force_plate import PlateSetting

ZERO_LIMIT_N = 5.0


@dataclass(frozen=True)
class PlateReadiness:
    """How an amplifier was found, or left, before a motion.

    Attributes:
        identity: Who answered, escaped.
        settings: Every setting as read back.
        changed: Settings that were otherwise and were set.
        charge_lost: Setting them lost the charges on the channels, and with them the plate's zero.
        operating: The channels measure.
        overloads: Channels that had been overloaded; it is forgotten now.
    """

    identity: str
    settings: tuple[PlateSetting, ...]
    changed: tuple[str, ...]
    charge_lost: bool
    operating: bool
    overloads: tuple[bool, ...]


def prepare_plate(
    plate: PlateConfig, profile: AmplifierProfile, *, operate: bool = False
) -> PlateReadiness:
    """Set what differs from the cell file, read everything back, look at the overloads.

    Args:
        plate: The plate and its amplifier.
        profile: What the amplifier speaks.
        operate: Put an amplifier that is in reset, or that has lost its charges, into operation:
            for mock hardware, which nobody else has zeroed.

    Raises:
        DriverError: It cannot be reached, or does not take a setting.
    """
    with open_amplifier(plate.amplifier, profile) as amplifier:
        identity = amplifier.connect()
        changed = tuple(s.name for s in amplifier.settings() if s.verdict == "red")
        charge_lost = amplifier.configure() if changed else False
        operating = amplifier.is_operating()
        if operate and (charge_lost or not operating):
            amplifier.reset()
            amplifier.operate()
            operating, charge_lost = True, False
        return PlateReadiness(
            identity=identity,
            settings=amplifier.settings(),
            changed=changed,
            charge_lost=charge_lost,
            operating=operating,
            overloads=amplifier.take_overloads(),
        )


def discharge_plate(plate: PlateConfig, profile: AmplifierProfile) -> PlateReadiness:
    """Set the amplifier as the cell file says, reset it, and let it operate: the channels begin.

    Raises:
        DriverError: It cannot be reached, does not take a setting, or does not go along.
    """
    with open_amplifier(plate.amplifier, profile) as amplifier:
        amplifier.connect()
        amplifier.reset()
    ready = prepare_plate(plate, profile)
    with open_amplifier(plate.amplifier, profile) as amplifier:
        amplifier.connect()
        amplifier.operate()
        overloads = amplifier.take_overloads()
    return replace(ready, charge_lost=False, operating=True, overloads=overloads)


def plate_zero_n(plate: PlateConfig, profile: AmplifierProfile) -> FloatArray:
    """Return what the channels show beyond what they showed when zeroed [N], shape (8,).

    That is beyond the cell file's offset and, where it tells, gravity's share in that pose.

    Raises:
        DriverError: The amplifier does not answer.
    """
    with open_amplifier(plate.amplifier, profile) as amplifier:
        amplifier.connect()
        forces_n = amplifier.forces_n()
    zero = plate.zero
    return forces_n if zero is None else forces_n - np.array(zero.offset_n) - np.array(zero.rest_n)
