"""Options of an estimate, with their ranges and default values.

The command line's help is generated from these options. To keep the help fast, this module does not
import numerical libraries.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Final, Self

from pydantic import Field

from config.plausible import Plausible
from config.ranges import Ranged

BAND_HZ: Final = 10.0
BandHz = Annotated[float, Field(ge=0.01), Plausible(0.1, 1e3, "Hz")]
"""Highest frequency that an estimate uses [Hz]."""

STANDSTILL_RAD_S: Final = 0.02
StandstillRadS = Annotated[float, Field(ge=0.0), Plausible(1e-4, 1.0, "rad/s")]
"""Speed below which an estimate treats friction as unknown [rad/s or m/s]."""

BaseMassKg = Annotated[float, Field(ge=0.0), Plausible(0.1, 1e5, "kg")]
"""Total mass on the base [kg]."""

LoadMassKg = Annotated[float, Field(ge=1e-3), Plausible(1e-3, 2.5e3, "kg")]
"""Mass of a weighed load [kg]."""

LoadMassSigmaKg = Annotated[float, Field(ge=1e-6), Plausible(1e-6, 20.0, "kg")]
"""Standard deviation of the scales that weighed a load (1 σ) [kg]."""

TorqueConstantSigma = Annotated[float, Field(ge=0.0), Plausible(5e-4, 0.5, "")]
"""Relative standard deviation of a torque constant (1 σ)."""

UntilMassKg = Annotated[float, Field(ge=1e-4), Plausible(1e-4, 20.0, "kg")]
"""Uncertainty of the mass (2 σ) at which a run ends [kg]."""

RehearsalPercent = Annotated[float, Field(ge=0.0), Plausible(1.0, 100.0, "%")]
"""Speed of a rehearsal relative to the motion [%]."""

WarmUpPercent = Annotated[float, Field(ge=0.0), Plausible(0.02, 500.0, "%")]
"""Change of friction from period to period below which a robot counts as warm [%]."""

Share = Annotated[float, Field(ge=0.0), Plausible(0.1, 1e3, "%")]
"""Upper limit of a quantity, relative to a reference value [%]."""

Millimetres = Annotated[float, Field(ge=0.0), Plausible(0.05, 500.0, "mm")]
"""Upper limit of a length's uncertainty [mm]."""

MassLimitKg = Annotated[float, Field(ge=0.0), Plausible(1e-3, 100.0, "kg")]
"""Upper limit of a mass's uncertainty [kg]."""

InertiaLimitKgM2 = Annotated[float, Field(ge=0.0), Plausible(1e-5, 100.0, "kg m²")]
"""Upper limit of a moment of inertia's uncertainty [kg m²]."""

ResidualLimitNm = Annotated[float, Field(ge=0.0), Plausible(1e-3, 1e3, "N m")]
"""Upper limit of a residual torque or force [N m or N]."""


@dataclass(frozen=True)
class PayloadLimits(Ranged):
    """Upper limits of two standard deviations of a payload's values, and of the residuals.

    A quantity with a relative and an absolute limit satisfies them if it satisfies either. Absolute
    limits have no default, because they depend on the robot's rated payload. With a relative limit
    of 0, only the absolute limit counts.

    Attributes:
        mass_percent: Limit for the mass [%].
        mass_kg: Alternative limit for the mass [kg].
        centre_mm: Limit for each coordinate of the centre of gravity [mm].
        inertia_percent: Limit for each moment and product of inertia, relative to the largest
            moment about the flange [%].
        inertia_kg_m2: Alternative limit for each moment and product of inertia [kg m²].
        residual_percent: Limit for the RMS residual of each axis' torque, relative to the torque
            [%].
        residual_nm: Alternative limit for the RMS residual of each axis' torque [N m or N].
    """

    mass_percent: Share = 5.0
    mass_kg: MassLimitKg | None = None
    centre_mm: Millimetres = 10.0
    inertia_percent: Share = 100.0
    inertia_kg_m2: InertiaLimitKgM2 | None = None
    residual_percent: Share = 20.0
    residual_nm: ResidualLimitNm | None = None


class LoadFormat(StrEnum):
    """Robot controller or program for which load data are written."""

    label: str
    """Name that people read."""
    ending: str
    """Usual ending of a file in this format."""

    KUKA = "kuka", "KUKA", ".src"
    ABB = "abb", "ABB", ".mod"
    FANUC = "fanuc", "FANUC", ".txt"
    UR = "ur", "Universal Robots", ".script"
    UR_ROS2 = "ur-ros2", "Universal Robots, ROS 2 driver", ".yaml"
    FRANKA = "franka", "Franka", ".json"
    STAUBLI = "staubli", "Stäubli", ".txt"
    URDF = "urdf", "URDF", ".urdf"

    def __new__(cls, value: str, label: str = "", ending: str = "") -> Self:
        """Return a new member; `LoadFormat(value)` looks an existing member up."""
        member = str.__new__(cls, value)
        member._value_, member.label, member.ending = value, label, ending
        return member


REPORTED: Final = ("m", "cx", "cy", "cz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""Reported quantities of a payload; inertia about the centre of gravity."""
