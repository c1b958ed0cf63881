"""`FaultInjector`: faults on a simulated serial line, triggered by the numbers of rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from config.simulation.faults import AmplifierFault


class Unit(NamedTuple):
    """Bytes that are sent together: a row, an event, or an answer.

    Attributes:
        data: The bytes.
        ready_s: Earliest time at which the bytes can be sent [s].
        sequence: Number of the row; -1 for an event or an answer.
    """

    data: bytes
    ready_s: float
    sequence: int = -1


class FaultInjector:
    """Applies faults to the rows on the line.

    Args:
        faults: The faults, with the numbers of the rows at which they begin.
        seed: Random seed for the choice of the damaged bytes.

    Attributes:
        rows: Number of rows that have passed.
    """

    def __init__(self, faults: Sequence[AmplifierFault], seed: int) -> None:
        self._random = np.random.default_rng(seed)
        self._coming = sorted(faults, key=lambda fault: fault.row)
        self._spoiling: dict[str, int] = {}
        self.rows = 0

    def affects(self, rows: int) -> bool:
        """Return True if a fault affects one of the next `rows` rows."""
        due = bool(self._coming) and self._coming[0].row < self.rows + rows
        return due or bool(self._spoiling)

    def skip_rows(self, rows: int) -> None:
        """Count rows that no fault affects."""
        self.rows += rows

    def apply_faults(self, row: Unit) -> tuple[list[Unit], list[AmplifierFault]]:
        """Return the units that replace a row, and the faults that begin at it but change no row.

        The latter are the faults with a duration, and `reset`.
        """
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
            elif fault.kind == "reset" or fault.duration_s > 0.0:
                lasting.append(fault)
            else:
                self._spoiling[fault.kind] = fault.count
        for kind in tuple(self._spoiling):
            data = self._apply_row_fault(kind, data)
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

    def _apply_row_fault(self, kind: str, data: bytes) -> bytes:
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
