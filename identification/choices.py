"""Options of an estimate, with their ranges and default values.

The command line's help is generated from these, so this module does not import numerical libraries.
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
"""Highest frequency that is used [Hz]."""

STANDSTILL_RAD_S: Final = 0.02
StandstillRadS = Annotated[float, Field(ge=0.0), Plausible(1e-4, 1.0, "rad/s")]
"""Lowest speed at which friction is used [rad/s or m/s]."""

BaseMassKg = Annotated[float, Field(ge=0.0), Plausible(0.1, 1e5, "kg")]
"""Total mass on the base [kg]."""

LoadMassKg = Annotated[float, Field(ge=1e-3), Plausible(1e-3, 2.5e3, "kg")]
"""Mass of a weighed load [kg]."""

LoadMassSigmaKg = Annotated[float, Field(ge=1e-6), Plausible(1e-6, 20.0, "kg")]
"""Standard deviation of scales (1 σ) [kg]."""

TorqueConstantSigma = Annotated[float, Field(ge=0.0), Plausible(5e-4, 0.5, "")]
"""Relative standard deviation of a torque constant (1 σ)."""

UntilMassKg = Annotated[float, Field(ge=1e-4), Plausible(1e-4, 20.0, "kg")]
"""Uncertainty of the mass (2 σ) at which a run ends [kg]."""

RehearsalPercent = Annotated[float, Field(ge=0.0), Plausible(1.0, 100.0, "%")]
"""Speed of a rehearsal relative to the motion [%]."""

WarmUpPercent = Annotated[float, Field(ge=0.0), Plausible(0.02, 500.0, "%")]
"""Largest change of friction per period of a warm robot [%]."""

Share = Annotated[float, Field(ge=0.0), Plausible(0.1, 1e3, "%")]
"""Limit relative to a reference value [%]."""

Millimetres = Annotated[float, Field(ge=0.0), Plausible(0.05, 500.0, "mm")]
"""Largest length [mm]."""


@dataclass(frozen=True)
class PayloadLimits(Ranged):
    """Limits of a payload's uncertainty, each for two standard deviations.

    Attributes:
        mass_percent: Limit for the mass [%].
        centre_mm: Limit for each coordinate of the centre of gravity [mm].
        inertia_percent: Limit for each moment and product of inertia, relative to the largest
            moment about the flange [%].
        residual_percent: Limit for the RMS residual of each axis' torque, relative to the torque
            [%].
    """

    mass_percent: Share = 5.0
    centre_mm: Millimetres = 10.0
    inertia_percent: Share = 100.0
    residual_percent: Share = 20.0


class LoadFormat(StrEnum):
    """Robot controller for which load data are written."""

    KUKA = "kuka"
    ABB = "abb"
    FANUC = "fanuc"
    UR = "ur"
    FRANKA = "franka"
    STAUBLI = "staubli"
    URDF = "urdf"


REPORTED: Final = ("m", "cx", "cy", "cz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""Reported quantities of a payload; inertia about the centre of gravity."""
