"""Conversion of Modbus registers to quantities, and division of the registers into requests.

Registers are 16 bits, most significant byte first (Modbus application protocol 1.1b3, 4.2); the
order of the two registers of a 32-bit number depends on the maker.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from config.cell.drive_profile import DriveProfile, Quantity, Register
from config.errors import ProtocolError

_CODES: Final = {"uint16": "H", "int16": "h", "uint32": "I", "int32": "i", "float32": "f"}


@dataclass(frozen=True)
class RegisterRead:
    """One read request: a block of registers, and the quantities in it."""

    table: Literal["holding", "input"]
    address: int
    count: int
    quantities: tuple[Quantity, ...]


def plan_reads(profile: DriveProfile, quantities: Iterable[Quantity]) -> tuple[RegisterRead, ...]:
    """Return the requests that read the given quantities, without those that the drive lacks."""
    wanted: list[Quantity] = [name for name in quantities if name in profile.registers]
    wanted.sort(key=lambda name: (profile.registers[name].table, profile.registers[name].address))
    reads: list[RegisterRead] = []
    for name in wanted:
        register = profile.registers[name]
        last = reads[-1] if reads else None
        if last is not None and last.table == register.table:
            gap = register.address - (last.address + last.count)
            count = register.address + register.count - last.address
            if gap <= profile.largest_gap and count <= profile.most_registers:
                names = (*last.quantities, name)
                reads[-1] = RegisterRead(last.table, last.address, count, names)
                continue
        reads.append(RegisterRead(register.table, register.address, register.count, (name,)))
    return tuple(reads)


def decode(
    profile: DriveProfile, read: RegisterRead, words: Sequence[int]
) -> dict[Quantity, float]:
    """Return the quantities of a block of registers, in SI units.

    Raises:
        ProtocolError: The number of words differs from the request, or a number is not finite.
    """
    if len(words) != read.count:
        raise ProtocolError(
            f"the drive answered with {len(words)} registers, but {read.count} were requested",
            code="RID-MODBUS-GARBAGE",
        )
    values: dict[Quantity, float] = {}
    for name in read.quantities:
        register = profile.registers[name]
        start = register.address - read.address
        raw = _number(register, words[start : start + register.count], profile.word_order)
        if not math.isfinite(raw):
            raise ProtocolError(
                f"{name} is {raw} in register {register.address}; check the profile's type and"
                " word_order",
                code="RID-MODBUS-PROFILE",
            )
        values[name] = register.scale * raw + register.offset
    return values


def encode(profile: DriveProfile, values: Mapping[Quantity, float]) -> dict[int, int]:
    """Return the registers' contents by address, for a simulated drive with `values` in SI units.

    A value beyond the range of its register's type is limited to this range.
    """
    words: dict[int, int] = {}
    for name, value in values.items():
        register = profile.registers.get(name)
        if register is None:
            continue
        packed = struct.pack(f">{_CODES[register.type]}", _raw(register, value))
        parts = [int.from_bytes(packed[i : i + 2], "big") for i in range(0, len(packed), 2)]
        if profile.word_order == "little":
            parts.reverse()
        words |= {register.address + i: part for i, part in enumerate(parts)}
    return words


def _number(register: Register, words: Sequence[int], order: Literal["big", "little"]) -> float:
    parts = words if order == "big" else tuple(reversed(words))
    data = b"".join(word.to_bytes(2, "big") for word in parts)
    (number,) = struct.unpack(f">{_CODES[register.type]}", data)
    return float(number)


def _raw(register: Register, value: float) -> float | int:
    raw = (value - register.offset) / register.scale
    if register.type == "float32":
        return raw
    bits = 16 * register.count
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1)
    if register.type.startswith("u"):
        low, high = 0, (1 << bits) - 1
    return max(low, min(high, round(raw)))
