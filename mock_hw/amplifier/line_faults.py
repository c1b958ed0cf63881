"""`LineFaults`: what goes wrong on a simulated serial line, said beforehand, by row and seed."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from config.simulation.faults import FaultScript


class FaultKind(Enum):
    """What can go wrong, and what `LineFault.count` means there."""

    GARBAGE = "garbage"
    """`count` random bytes before the row."""
    NULS = "nuls"
    """`count` zero bytes before the row: a flood, as an open line gives it."""
    LOST_BYTES = "lost bytes"
    """`count` bytes of the row, in one piece, never arrive."""
    TORN_ROW = "torn row"
    """The row ends in the middle; `count` rows in a row."""
    GAP = "gap"
    """`count` rows never arrive."""
    BAD_CHECKSUM = "bad checksum"
    """One bit of the row is flipped; `count` rows in a row."""
    STALL = "stall"
    """Nothing arrives for `duration_s`, then everything at once."""
    UNPLUG = "unplug"
    """The port is gone for `duration_s`, with all that was sent meanwhile; then there is a new."""
    OVERLOAD = "overload"
    """Channel `channel` feels twice its range for `duration_s`, from about this row on."""
    DRIFT = "drift"
    """Channel `channel` drifts by `count` newtons a second more for `duration_s`, and keeps it."""


@dataclass(frozen=True)
class LineFault:
    """One fault, at a row: rows are counted from 0 since the amplifier was switched on.

    Attributes
    ----------
    kind
        What goes wrong.
    row
        At which row.
    count
        How much of it, see `FaultKind`.
    duration_s
        Of STALL, UNPLUG, OVERLOAD and DRIFT, on the cell's clock [s].
    channel
        Of OVERLOAD and DRIFT, from 0.
    """

    kind: FaultKind
    row: int
    count: int = 1
    duration_s: float = 0.0
    channel: int = 0

    def __post_init__(self) -> None:
        if self.row < 0 or self.count < 1 or self.duration_s < 0.0 or not 0 <= self.channel < 8:
            raise ValueError(
                "row and duration_s must not be negative, count be at least 1, channel 0 to 7"
            )


@dataclass(frozen=True)
class LineFaults:
    """All faults of one run; the seed is of the bytes that they invent."""

    faults: tuple[LineFault, ...] = ()
    seed: int = 0


NO_FAULTS = LineFaults()


def line_faults(script: FaultScript) -> LineFaults:
    """Return what a fault script says of the amplifier and its line."""
    faults = tuple(
        LineFault(
            FaultKind(fault.kind.replace("_", " ")),
            fault.row,
            fault.count,
            fault.duration_s,
            fault.channel,
        )
        for fault in script.amplifier
    )
    return LineFaults(faults, script.seed)


class Unit(NamedTuple):
    """Bytes that are sent in one go: a row, an event, an answer; when they are ready [s]."""

    data: bytes
    ready_s: float
    sequence: int = -1


class FaultInjector:
    """Applies faults to rows as they pass.

    Parameters
    ----------
    faults
        What happens when.

    Attributes
    ----------
    rows
        How many rows have passed.
    """

    def __init__(self, faults: LineFaults) -> None:
        self._random = np.random.default_rng(faults.seed)
        self._coming = sorted(faults.faults, key=lambda fault: fault.row)
        self._spoiling: dict[FaultKind, int] = {}
        self.rows = 0

    def touches(self, rows: int) -> bool:
        """Return whether the next `rows` rows do not all pass as they are."""
        due = bool(self._coming) and self._coming[0].row < self.rows + rows
        return due or bool(self._spoiling)

    def passes(self, rows: int) -> None:
        """Count rows that are not touched."""
        self.rows += rows

    def spoil(self, row: Unit) -> tuple[list[Unit], list[LineFault]]:
        """Return what becomes of a row, and the faults that begin with it and last a while."""
        before: list[Unit] = []
        lasting: list[LineFault] = []
        data = row.data
        while self._coming and self._coming[0].row <= self.rows:
            fault = self._coming.pop(0)
            if fault.kind is FaultKind.GARBAGE:
                before.append(Unit(self.noise(fault.count), row.ready_s))
            elif fault.kind is FaultKind.NULS:
                before.append(Unit(bytes(fault.count), row.ready_s))
            elif fault.kind is FaultKind.LOST_BYTES:
                first = int(self._random.integers(max(1, len(data) - fault.count + 1)))
                data = data[:first] + data[first + fault.count :]
            elif fault.duration_s > 0.0:
                lasting.append(fault)
            else:
                self._spoiling[fault.kind] = fault.count
        for kind in tuple(self._spoiling):
            data = self._spoiled(kind, data)
            self._spoiling[kind] -= 1
            if not self._spoiling[kind]:
                del self._spoiling[kind]
        self.rows += 1
        if data:
            before.append(Unit(data, row.ready_s, row.sequence))
        return before, lasting

    def noise(self, count: int) -> bytes:
        """Return random bytes."""
        return self._random.bytes(count)

    def _spoiled(self, kind: FaultKind, data: bytes) -> bytes:
        if kind is FaultKind.GAP:
            return b""
        if kind is FaultKind.TORN_ROW:
            return data[: int(self._random.integers(1, max(2, len(data))))]
        if kind is FaultKind.BAD_CHECKSUM and data:
            bit = int(self._random.integers(8 * len(data)))
            flipped = bytearray(data)
            flipped[bit // 8] ^= 1 << bit % 8
            return bytes(flipped)
        return data
