"""What a person may choose about an estimate, and what holds where nothing is chosen.

The command line's help is made from these, so nothing here imports numerics.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Final

from pydantic import Field

from config.plausible import Plausible
from config.ranges import Ranged

BAND_HZ: Final = 10.0
BandHz = Annotated[float, Field(ge=0.01), Plausible(0.1, 1e3, "Hz")]
"""A highest frequency [Hz]."""

STANDSTILL_RAD_S: Final = 0.02
StandstillRadS = Annotated[float, Field(ge=0.0), Plausible(1e-4, 1.0, "rad/s")]
"""A lowest speed of friction that is used [rad/s or m/s]."""

BaseMassKg = Annotated[float, Field(ge=0.0), Plausible(0.1, 1e5, "kg")]
"""Mass of all that a base carries [kg]."""

LoadMassKg = Annotated[float, Field(ge=1e-3), Plausible(1e-3, 2.5e3, "kg")]
"""A weighed mass [kg]."""

LoadMassSigmaKg = Annotated[float, Field(ge=1e-6), Plausible(1e-6, 20.0, "kg")]
"""What scales leave open (1 σ) [kg]."""

TorqueConstantSigma = Annotated[float, Field(ge=0.0), Plausible(5e-4, 0.5, "")]
"""What is not known of a torque constant (1 σ), as a share."""

UntilMassKg = Annotated[float, Field(ge=1e-4), Plausible(1e-4, 20.0, "kg")]
"""2 σ of a mass that end a run [kg]."""

RehearsalPercent = Annotated[float, Field(ge=0.0), Plausible(1.0, 100.0, "%")]
"""Speed of a rehearsal [%]."""

WarmUpPercent = Annotated[float, Field(ge=0.0), Plausible(0.02, 500.0, "%")]
"""Change of friction in a period that is warm [%]."""

Share = Annotated[float, Field(ge=0.0), Plausible(0.1, 1e3, "%")]
"""A largest share [%]."""

Millimetres = Annotated[float, Field(ge=0.0), Plausible(0.05, 500.0, "mm")]
"""A largest length [mm]."""


@dataclass(frozen=True)
class PayloadLimits(Ranged):
    """How sure a payload must be: 2 sigma at most.

    Attributes:
        mass_percent: Of the mass.
        centre_mm: Of each coordinate of the centre of gravity.
        inertia_percent: Of each moment and product of inertia, of the largest moment about the
            flange.
        residual_percent: What the fit may leave of each axis' torque (RMS).
    """

    mass_percent: Share = 5.0
    centre_mm: Millimetres = 10.0
    inertia_percent: Share = 100.0
    residual_percent: Share = 20.0


class LoadFormat(StrEnum):
    """Whose controller the payload is for."""

    KUKA = "kuka"
    ABB = "abb"
    FANUC = "fanuc"
    UR = "ur"
    FRANKA = "franka"
    STAUBLI = "staubli"
    URDF = "urdf"


REPORTED: Final = ("m", "cx", "cy", "cz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""What people and controllers want: inertia about the centre of gravity."""
