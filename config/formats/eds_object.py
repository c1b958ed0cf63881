"""`EdsObject`: one object of a device as its data sheet describes it (CiA 306-1, 4.6; CiA 301)."""

from __future__ import annotations

import math
import re
import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, Literal, get_args

from config.errors import ConfigError
from config.formats.number import parse_number

Access = Literal["ro", "wo", "rw", "rwr", "rww", "const"]
ACCESSES: Final[tuple[Access, ...]] = get_args(Access)

MAX_DIGITS = 24

_HEXADECIMAL = re.compile(r"[+-]?0[xX][0-9a-fA-F]+")
_OCTAL = re.compile(r"[+-]?0[0-7]+")
_DECIMAL = re.compile(r"[+-]?(?:0|[1-9][0-9]*)")


class DataType(IntEnum):
    """Data types of objects (CiA 301, table 44)."""

    BOOLEAN = 0x01
    INTEGER8 = 0x02
    INTEGER16 = 0x03
    INTEGER32 = 0x04
    UNSIGNED8 = 0x05
    UNSIGNED16 = 0x06
    UNSIGNED32 = 0x07
    REAL32 = 0x08
    VISIBLE_STRING = 0x09
    OCTET_STRING = 0x0A
    UNICODE_STRING = 0x0B
    TIME_OF_DAY = 0x0C
    TIME_DIFFERENCE = 0x0D
    DOMAIN = 0x0F
    INTEGER24 = 0x10
    REAL64 = 0x11
    INTEGER40 = 0x12
    INTEGER48 = 0x13
    INTEGER56 = 0x14
    INTEGER64 = 0x15
    UNSIGNED24 = 0x16
    UNSIGNED40 = 0x18
    UNSIGNED48 = 0x19
    UNSIGNED56 = 0x1A
    UNSIGNED64 = 0x1B


INTEGER_BITS: Final[dict[int, int]] = {
    DataType.BOOLEAN: 1,
    **{
        kind: int(re.sub(r"\D", "", kind.name))
        for kind in DataType
        if kind.name.startswith(("INTEGER", "UNSIGNED"))
    },
}
REAL_BITS: Final[dict[int, int]] = {DataType.REAL32: 32, DataType.REAL64: 64}
_BITS: Final = {
    **INTEGER_BITS,
    **REAL_BITS,
    DataType.TIME_OF_DAY: 48,
    DataType.TIME_DIFFERENCE: 48,
}


@dataclass(frozen=True, slots=True)
class EdsValue:
    """A value in a data sheet; if `adds_node_id` is true, the node id is added to it."""

    content: int | float | str
    adds_node_id: bool = False

    def __post_init__(self) -> None:
        if self.adds_node_id and not isinstance(self.content, int):
            raise ConfigError(
                f"$NODEID and {self.content!r}: $NODEID can only be added to a whole number",
                code="RID-EDS-INVALID",
            )
        if isinstance(self.content, float) and not math.isfinite(self.content):
            raise ConfigError(f"{self.content} is not a finite number", code="RID-EDS-INVALID")

    def of_node(self, node_id: int) -> int | float | str:
        """Return the value for a device with this node id."""
        if self.adds_node_id and isinstance(self.content, int):
            return self.content + node_id
        return self.content


@dataclass(frozen=True, slots=True)
class EdsFault:
    """A key of an object whose value cannot be read, with the line of the key."""

    line: int
    text: str


@dataclass(frozen=True, slots=True)
class EdsObject:
    """One object; None means that the EDS does not state a value, or states an unreadable one.

    Attributes:
        index, subindex: The address.
        name: Unescaped name in the file: escape it before showing it.
        line: First line of its section.
        data_type: A `DataType`, or a vendor-specific number.
        access: Access by SDO; `rwr` and `rww` also state which PDOs may carry the object.
        mappable: Whether a PDO may carry it.
        default: Its value after a reset.
        value: Its configured value, in a DCF.
        low, high: LowLimit and HighLimit as written.
        faults: Its keys that cannot be read; they matter only if the object is used.
    """

    index: int
    subindex: int
    name: str
    line: int
    data_type: int | None = None
    access: Access | None = None
    mappable: bool = False
    default: EdsValue | None = None
    value: EdsValue | None = None
    low: int | float | None = None
    high: int | float | None = None
    faults: tuple[EdsFault, ...] = ()

    def __post_init__(self) -> None:
        if not (0 <= self.index <= 0xFFFF and 0 <= self.subindex <= 0xFF):
            raise ConfigError(
                f"{self.index:X}h:{self.subindex:X} is not a valid object address; correct it",
                code="RID-EDS-INVALID",
            )
        if self.access is not None and self.access not in ACCESSES:
            raise ConfigError(
                f"access {self.access!r} is unknown; use one of {', '.join(ACCESSES)}",
                code="RID-EDS-INVALID",
            )

    @property
    def bits(self) -> int | None:
        """Length of the object [bit]; None for texts, domains and unknown types."""
        return None if self.data_type is None else _BITS.get(self.data_type)

    @property
    def limits(self) -> tuple[int | float, int | float]:
        """The lowest and the highest value; limits that are both 0, or reversed, are ignored."""
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        return (low, high) if low < high or low == high != 0 else (-math.inf, math.inf)

    @property
    def writable(self) -> bool:
        """True if the object can be written by SDO."""
        return self.access in ("wo", "rw", "rwr", "rww")

    @property
    def receivable(self) -> bool:
        """True if an RPDO may carry the object."""
        return self.mappable and self.access in ("wo", "rw", "rww")

    @property
    def sendable(self) -> bool:
        """True if a TPDO may carry the object."""
        return self.mappable and self.access in ("ro", "rw", "rwr", "const")


def parse_integer(text: str) -> int:
    """Return an integer in the notation of CiA 306: decimal, hexadecimal (0x), octal (leading 0).

    Raises:
        ConfigError: The text is not an integer, or has more digits than any object can hold.
    """
    if len(text) > MAX_DIGITS:
        raise ConfigError(
            f"{text[:MAX_DIGITS]!r}… has too many digits for a number", code="RID-EDS-INVALID"
        )
    if _HEXADECIMAL.fullmatch(text):
        return int(text, 16)
    if _DECIMAL.fullmatch(text):
        return int(text)
    if _OCTAL.fullmatch(text):
        return int(text, 8)
    raise ConfigError(
        f"{text!r} is not a whole number; write it decimal, or hexadecimal with 0x",
        code="RID-EDS-INVALID",
    )


def parse_value(text: str, data_type: int | None) -> EdsValue:
    """Return a DefaultValue or ParameterValue of an object of this type.

    For a type that is not a number, the text is returned. A signed number may be written as its
    bits (0xFFFF).

    Raises:
        ConfigError: The text is not a value of the type.
    """
    if data_type in REAL_BITS:
        return EdsValue(_real(text, REAL_BITS[data_type]))
    if data_type not in INTEGER_BITS:
        return EdsValue(text)
    number, relative = _without_node_id(text)
    value = 0 if relative and not number else parse_integer(number)
    bits = INTEGER_BITS[data_type]
    signed = is_signed(data_type)
    if not (-(1 << bits - 1) if signed else 0) <= value < 1 << bits:
        raise ConfigError(
            f"{text[:MAX_DIGITS]!r} does not fit {DataType(data_type).name}", code="RID-EDS-INVALID"
        )
    return EdsValue(_by_bits(value, bits) if signed else value, relative)


def parse_limit(text: str, data_type: int | None) -> int | float | None:
    """Return a LowLimit or HighLimit; None for types without an order. Raises as `parse_value`.

    A limit beyond the range of the type is valid; it has no effect.
    """
    if data_type in REAL_BITS:
        return _real(text, REAL_BITS[data_type])
    if data_type not in INTEGER_BITS:
        return None
    value = parse_integer(text)
    signed = is_signed(data_type)
    return _by_bits(value, INTEGER_BITS[data_type]) if signed else value


def is_signed(data_type: int) -> bool:
    """Return whether a type is a signed integer."""
    return data_type in INTEGER_BITS and DataType(data_type).name.startswith("INTEGER")


def _by_bits(value: int, bits: int) -> int:
    """Return the signed value of a number that was written as its bits (two's complement)."""
    return value - (1 << bits) if 1 << bits - 1 <= value < 1 << bits else value


def _without_node_id(text: str) -> tuple[str, bool]:
    """Return the number in `$NODEID+0x200` or `0x200+$NODEID` and True; else the text and False."""
    plain = "".join(text.split())
    upper = plain.upper()
    if "$NODEID" not in upper:
        return text, False
    if upper == "$NODEID":
        return "", True
    if upper.startswith("$NODEID+") and len(upper) > len("$NODEID+"):
        return plain[len("$NODEID+") :], True
    if upper.endswith("+$NODEID") and len(upper) > len("+$NODEID"):
        return plain[: -len("+$NODEID")], True
    raise ConfigError(f"{text[:MAX_DIGITS]!r}: write $NODEID+0x200", code="RID-EDS-INVALID")


def _real(text: str, bits: int) -> float:
    """Return a real number, written in decimals or as its bits in hexadecimal."""
    if len(text) > 64:
        raise ConfigError(
            f"{text[:MAX_DIGITS]!r}… has too many digits for a number", code="RID-EDS-INVALID"
        )
    if _HEXADECIMAL.fullmatch(text):
        pattern = parse_integer(text)
        if not 0 <= pattern < 1 << bits:
            raise ConfigError(f"{text!r} does not fit REAL{bits}", code="RID-EDS-INVALID")
        value = float(struct.unpack(">f" if bits == 32 else ">d", pattern.to_bytes(bits // 8))[0])
    else:
        value = parse_number(text)
    if not math.isfinite(value):
        raise ConfigError(f"{text!r} is not a finite number", code="RID-EDS-INVALID")
    return value
