"""`ImportUnits`: units of the columns in another program's recording."""

from __future__ import annotations

from typing import Final, Literal

from config.model import ConfigModel

PositionUnit = Literal["rad", "deg", "rev", "m", "mm", "increments"]
VelocityUnit = Literal["rad/s", "deg/s", "rpm", "m/s", "mm/s", "increments/s"]
RatedUnit = Literal["permille", "percent"]
RATED: Final[dict[str, float]] = {"permille": 1e-3, "percent": 1e-2}
"""Units relative to a rated value, each with its fraction of the rated value."""


class ImportUnits(ConfigModel):
    """Units of the columns; all values are converted to SI units during the import.

    Attributes:
        position: Unit of position; `increments` of the encoder need `increments_per_rev`.
        velocity: Unit of velocity; `increments/s` need `increments_per_rev`.
        current: Unit of current; `permille` and `percent` need `rated_current_a`.
        torque: Unit of torque, or of force for a prismatic joint; `permille` and `percent` need
            `rated_torque_nm`.
        temperature: Unit of temperature.
    """

    position: PositionUnit = "rad"
    velocity: VelocityUnit = "rad/s"
    current: Literal["A", "mA"] | RatedUnit = "A"
    torque: Literal["Nm", "mNm", "N"] | RatedUnit = "Nm"
    temperature: Literal["C", "K"] = "C"
