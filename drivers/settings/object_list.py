"""The objects of a drive that are settings: their values are chosen by a user or a program.

Sources: CiA 301, 7.5.2; CiA 402-2. If a drive has a data sheet (EDS), it lists all objects and
their access. Without an EDS, the lists here are used: the settings of CiA 301 and CiA 402.
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
"""Communication settings: a reset of the communication restores their values that are stored in the
drive."""

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
"""Arrays and records among the settings, except those of PDOs; sub-index 0 is the number of their
elements."""

_NO_SETTINGS = frozenset(
    (
        *(0x1003, 0x1010, 0x1011, *range(0x1020, 0x1027), *range(0x1F00, 0x2000)),
        *(0x6040, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60C1, 0x60FE, 0x60FF),
    )
)
"""Commands, set-points, error history and programs: a write to them has an immediate effect, so
they are not settings."""


def is_setting(index: int) -> bool:
    """Return True if an object can be a setting; a write to it is then not a command."""
    return index not in _NO_SETTINGS


def is_record(index: int) -> bool:
    """Return True if an object has sub-indices, whose number is in sub-index 0."""
    return 0x1400 <= index < 0x1C00 or index in RECORDS


def settings_of(eds: ElectronicDataSheet) -> tuple[Address, ...]:
    """Return the addresses of the writable settings in a drive's data sheet."""
    return tuple(
        (item.index, item.subindex)
        for item in eds.objects
        if item.access in ("rw", "rww", "rwr")
        and item.data_type != DataType.DOMAIN
        and is_setting(item.index)
    )
