"""Preparation of a force plate's amplifier for a measurement."""

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
    """State of an amplifier before a motion.

    Attributes:
        identity: Identification of the amplifier, escaped.
        settings: Every setting as read back.
        changed: Settings that differed and were corrected.
        charge_lost: True if the correction discharged the channels: the plate must be zeroed again.
        operating: True if the channels measure.
        overloads: True for channels that had been overloaded; their flags have been cleared.
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
    """Correct settings that differ from the cell file, read all settings back, and read overloads.

    Args:
        plate: The plate and its amplifier.
        profile: Protocol of the amplifier.
        operate: True to start the operation of an amplifier that is in reset or has lost its
            charges. This is for simulated hardware, which no user zeroes.

    Raises:
        DriverError: The amplifier cannot be reached, or does not accept a setting.
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
    """Discharge the channels, configure the amplifier by the cell file, and start measuring.

    Raises:
        DriverError: The amplifier cannot be reached, or does not accept a setting or a command.
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


def read_zero_drift_n(plate: PlateConfig, profile: AmplifierProfile) -> FloatArray:
    """Return the change of the channels since the plate was zeroed [N], shape (8,).

    The offset in the cell file and the gravity forces in the zeroing pose are subtracted. Without a
    zero in the cell file, the forces are returned unchanged.

    Raises:
        DriverError: The amplifier does not answer.
    """
    with open_amplifier(plate.amplifier, profile) as amplifier:
        amplifier.connect()
        forces_n = amplifier.forces_n()
    zero = plate.zero
    return forces_n if zero is None else forces_n - np.array(zero.offset_n) - np.array(zero.rest_n)
