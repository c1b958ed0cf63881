"""`ExtraSetting`: an object that a servo profile sets in addition to the program's own settings.

The program writes some objects itself, from keys of the cell file. A second value for such an
object could switch off the drive's reaction to a failure of this computer. It is refused.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from config.cell.fixed_pdo import ObjectName
from config.model import ConfigModel

_SAFETY: Final = "drive_safety"
KEYS_OF_OBJECTS: Final[dict[str, str]] = {
    "100Ch": _SAFETY,
    "100Dh": _SAFETY,
    "1016h": _SAFETY,
    "1017h": _SAFETY,
    "1029h": _SAFETY,
    "6007h": f"{_SAFETY}.abort_connection",
    "605Ah": f"{_SAFETY}.quick_stop_option",
    "605Eh": f"{_SAFETY}.fault_reaction_option",
    "6065h": f"{_SAFETY}.following_error_rad",
    "6066h": f"{_SAFETY}.following_error_timeout_ms",
    "6083h": f"{_SAFETY}.quick_stop_deceleration_rad_s2",
    "6084h": f"{_SAFETY}.quick_stop_deceleration_rad_s2",
    "6085h": f"{_SAFETY}.quick_stop_deceleration_rad_s2",
    "6060h": "servo.mode",
    "60C2h": "cycle_time_ms",
    **dict.fromkeys(("6040h", "6071h", "607Ah", "60C1h", "60FFh"), "the motion"),
    **{
        f"{first + number:04X}h": "servo.pdos"
        for first in (0x1400, 0x1600, 0x1800, 0x1A00)
        for number in range(4)
    },
}
"""By object: the key of the cell file, or the part of the program, that defines its value."""


class ExtraSetting(ConfigModel):
    """An object of the manufacturer, or of an older profile, that must hold a value.

    Attributes:
        object: Index and subindex, such as `2100h:01`. An object that the program sets itself, from
            another key of the cell file, can only be compared.
        bits: Size of the object.
        value: The value that the object must hold.
        written: True if the value is written; false if it is only compared.
    """

    object: ObjectName
    bits: Literal[8, 16, 32]
    value: Annotated[int, Field(ge=-(2**31), lt=2**32)]
    written: bool = True

    @model_validator(mode="after")
    def _check_value(self) -> Self:
        if not -(1 << self.bits - 1) <= self.value < 1 << self.bits:
            raise ValueError(
                f"value {self.value} does not fit the {self.bits} bits of {self.object}; correct"
                " value or bits"
            )
        key = KEYS_OF_OBJECTS.get(self.object[:5])
        if key is not None and self.written:
            raise ValueError(
                f"{self.object} is set by {key}; remove it from settings, or add written: false to"
                " compare its value only"
            )
        return self


def check_settings(settings: Iterable[ExtraSetting]) -> None:
    """Refuse two values for one object.

    Raises:
        ValueError: An object is listed twice.
    """
    seen: set[str] = set()
    for setting in settings:
        if setting.object in seen:
            raise ValueError(f"settings lists {setting.object} twice; remove one")
        seen.add(setting.object)
