"""`FixedPdo`: a PDO with fixed content; the drive does not allow another mapping."""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from config.model import ConfigModel

ObjectName = Annotated[str, Field(pattern=r"^[0-9A-F]{4}h:[0-9A-F]{2}$")]
Signal = Literal["controlword", "target", "statusword", "position", "torque", "inputs"]

COMMANDS: Final[tuple[Signal, ...]] = ("controlword", "target")
ANSWERS: Final[tuple[Signal, ...]] = ("statusword", "position", "torque", "inputs")
ON_ARRIVAL: Final = (254, 255)

_BITS: Final[dict[Signal, tuple[int, ...]]] = {
    "controlword": (16,), "statusword": (16,), "target": (32,), "position": (32,),
    "torque": (16, 32), "inputs": (32,),
}  # fmt: skip


def object_address(name: str) -> tuple[int, int]:
    """Return index and sub-index from the address of an object, such as ``6077h:00``."""
    index, subindex = name.split("h:")
    return int(index, 16), int(subindex, 16)


class FixedEntry(ConfigModel):
    """One object in a PDO that cannot be mapped.

    Attributes:
        object: Index and subindex.
        bits: Size of the object.
        signal: The cyclic signal that the object carries.
        holds: Constant value of an object without a signal, in an RPDO that carries signals. In any
            other PDO, an object without a signal is ignored.
    """

    object: ObjectName
    bits: Literal[8, 16, 32]
    signal: Signal | None = None
    holds: Annotated[int, Field(ge=0, lt=2**32)] | None = None


class FixedPdo(ConfigModel):
    """A PDO with its objects in order, and its transmission type.

    Attributes:
        pdo: Number and direction, as the drive sees it: `rpdo1` to `rpdo4`, `tpdo1` to `tpdo4`.
        transmission: Transmission type: 1 means with every SYNC. An RPDO of type 254 or 255 acts on
            arrival. A TPDO of a type other than 1 may come at any time and cannot carry signals.
        objects: The objects in their order.
    """

    pdo: Annotated[str, Field(pattern=r"^[rt]pdo[1-4]$")]
    transmission: Annotated[int, Field(ge=0, le=255)]
    objects: Annotated[tuple[FixedEntry, ...], Field(min_length=1, max_length=8)]

    @model_validator(mode="after")
    def _check_objects(self) -> Self:
        signals = self.signals
        if sum(entry.bits for entry in self.objects) > 64:
            raise ValueError(f"{self.pdo}: its objects have more than 64 bits; remove some")
        if any(signal not in (COMMANDS if self.receives else ANSWERS) for signal in signals):
            raise ValueError(f"{self.pdo} cannot carry {', '.join(signals)}; use another PDO")
        for entry in self.objects:
            free = entry.signal is None
            if entry.signal is not None and entry.bits not in _BITS[entry.signal]:
                raise ValueError(
                    f"{self.pdo}: {entry.signal} cannot have {entry.bits} bits; correct bits"
                )
            if (entry.holds is not None) != (free and self.receives and bool(signals)):
                raise ValueError(f"{self.pdo}: {entry.object} needs either signal or holds")
            if entry.holds is not None and entry.holds >= 1 << entry.bits:
                raise ValueError(f"{self.pdo}: holds {entry.holds} does not fit {entry.bits} bits")
        in_time = (1, *ON_ARRIVAL) if self.receives else (1,)
        if signals and self.transmission not in in_time:
            raise ValueError(
                f"{self.pdo}: transmission {self.transmission} is not cyclic; give one of"
                f" {', '.join(map(str, in_time))}"
            )
        return self

    @property
    def receives(self) -> bool:
        """True if the drive receives this PDO."""
        return self.pdo.startswith("r")

    @property
    def number(self) -> int:
        """Number of the PDO, from 1."""
        return int(self.pdo[-1])

    @property
    def signals(self) -> tuple[Signal, ...]:
        """The cyclic signals that the PDO carries."""
        return tuple(entry.signal for entry in self.objects if entry.signal is not None)


def object_of(pdos: tuple[FixedPdo, ...], signal: Signal) -> tuple[int, int] | None:
    """Return the address of the object that carries a signal; None if no object carries it."""
    for pdo in pdos:
        for entry in pdo.objects:
            if entry.signal == signal:
                return object_address(entry.object)
    return None
