"""`PlateSettings`: settings of a simulated force plate with its amplifier."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from config.cell.amplifier_profile import AmplifierProfile
from config.cell.plate import PlateConfig
from config.simulation.faults import NO_SCRIPT, FaultScript
from config.simulation.plant import SimulatedPlate


@dataclass(frozen=True)
class PlateSettings:
    """Settings of a simulated plate: description, profile, true properties and faults.

    Attributes:
        plate: The plate as described in the cell file.
        profile: Commands and formats of the plate's amplifier.
        truth: True properties of the plate.
        path: Path of the port.
        seed: Random seed of noise and jitter.
        baud_rate: Baud rate of the amplifier, if it differs from the cell file.
        faults: Fault script; its `amplifier` part is used.
    """

    plate: PlateConfig
    profile: AmplifierProfile
    truth: SimulatedPlate
    path: Path
    seed: int = 0
    baud_rate: int | None = None
    faults: FaultScript = NO_SCRIPT
