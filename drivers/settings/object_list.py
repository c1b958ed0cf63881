"""The objects of a drive that are settings, chosen by a person or a program.

Sources: CiA 301, 7.5.2; CiA 402-2. A drive's data sheet (EDS) defines this for all its objects;
without one, these lists define it for the objects of the profiles.
"""

from __future__ import annotations

from typing import Final

from config.formats.eds import ElectronicDataSheet
from config.formats.eds_object import DataType
from drivers.canopen.pdo import (
    PREDEFINED_NUMBERS,
    RPDO_COMMUNICATION,
    RPDO_MAPPING,
    TPDO_COMMUNICATION,
    TPDO_MAPPING,
)
from drivers.settings.saved_drive import Address

STORE: Final[Address] = (0x1010, 1)
STORE_WORD: Final = b"save"

COMMUNICATION_SETTINGS: Final[tuple[int, ...]] = (
    *(0x1005, 0x1006, 0x1007, 0x100C, 0x100D, 0x1012, 0x1014, 0x1015, 0x1016, 0x1017),
    *(0x1019, 0x1029),
    *(
        family + number - 1
        for family in (RPDO_COMMUNICATION, RPDO_MAPPING, TPDO_COMMUNICATION, TPDO_MAPPING)
        for number in PREDEFINED_NUMBERS
    ),
)
"""Objects that a reset of the communication restores to the values stored in the drive."""

PROFILE_SETTINGS: Final[tuple[int, ...]] = (
    *(0x6007, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6060, 0x6065, 0x6066, 0x6067, 0x6068),
    *(0x606D, 0x606E, 0x606F, 0x6070, 0x6072, 0x6073, 0x6075, 0x6076, 0x607B, 0x607C, 0x607D),
    *(0x607E, 0x607F, 0x6080, 0x6081, 0x6082, 0x6083, 0x6084, 0x6085, 0x6086, 0x6087, 0x608F),
    *(0x6090, 0x6091, 0x6092, 0x6093, 0x6094, 0x6095, 0x6096, 0x6097, 0x6098, 0x6099, 0x609A),
    *(0x60C2, 0x60C5, 0x60C6, 0x60E0, 0x60E1, 0x6402, 0x6410),
)

RECORDS: Final = frozenset(
    (0x1016, 0x1029, 0x607B, 0x607D, *range(0x608F, 0x6098), 0x6099, 0x60C2, 0x6410)
)
"""Arrays and records of these lists, besides those of the PDOs; sub-index 0 is their length."""

_NO_SETTINGS = frozenset(
    (
        *(0x1003, 0x1010, 0x1011, *range(0x1020, 0x1027), *range(0x1F00, 0x2000)),
        *(0x6040, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60C1, 0x60FE, 0x60FF),
    )
)
"""Commands, set-points, texts and programs: writing them has an effect of its own."""


def is_setting(index: int) -> bool:
    """Return whether an object can be a setting, because writing it is not a command."""
    return index not in _NO_SETTINGS


def is_record(index: int) -> bool:
    """Return whether an object has sub-indices, with their number in sub-index 0."""
    return 0x1400 <= index < 0x1C00 or index in RECORDS


def settings_of(eds: ElectronicDataSheet) -> tuple[Address, ...]:
    """Return the objects of a drive that are writable settings, by its data sheet."""
    return tuple(
        (item.index, item.subindex)
        for item in eds.objects
        if item.access in ("rw", "rww", "rwr")
        and item.data_type != DataType.DOMAIN
        and is_setting(item.index)
    )
