"""`FaultInjector`: what goes wrong on a simulated serial line, by row and seed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from config.simulation.faults import AmplifierFault


class Unit(NamedTuple):
    """Bytes that are sent in one go: a row, an event, an answer; when they are ready [s]."""

    data: bytes
    ready_s: float
    sequence: int = -1


class FaultInjector:
    """Applies faults to rows as they pass.

    Args:
        faults: What happens when.
        seed: Of the bytes that they invent.

    Attributes:
        rows: How many rows have passed.
    """

    def __init__(self, faults: Sequence[AmplifierFault], seed: int) -> None:
        self._random = np.random.default_rng(seed)
        self._coming = sorted(faults, key=lambda fault: fault.row)
        self._spoiling: dict[str, int] = {}
        self.rows = 0

    def touches(self, rows: int) -> bool:
        """Return whether the next `rows` rows do not all pass as they are."""
        due = bool(self._coming) and self._coming[0].row < self.rows + rows
        return due or bool(self._spoiling)

    def passes(self, rows: int) -> None:
        """Count rows that are not touched."""
        self.rows += rows

    def spoil(self, row: Unit) -> tuple[list[Unit], list[AmplifierFault]]:
        """Return what becomes of a row, and the faults that begin with it and last a while."""
        before: list[Unit] = []
        lasting: list[AmplifierFault] = []
        data = row.data
        while self._coming and self._coming[0].row <= self.rows:
            fault = self._coming.pop(0)
            if fault.kind == "garbage":
                before.append(Unit(self.noise(fault.count), row.ready_s))
            elif fault.kind == "nuls":
                before.append(Unit(bytes(fault.count), row.ready_s))
            elif fault.kind == "lost_bytes":
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

    def _spoiled(self, kind: str, data: bytes) -> bytes:
        if kind == "gap":
            return b""
        if kind == "torn_row":
            return data[: int(self._random.integers(1, max(2, len(data))))]
        if kind == "bad_checksum" and data:
            bit = int(self._random.integers(8 * len(data)))
            flipped = bytearray(data)
            flipped[bit // 8] ^= 1 << bit % 8
            return bytes(flipped)
        return data
