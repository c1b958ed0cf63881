"""Arrival of an amplifier's rows in a cell with simulated time (lock-step).

The arrival of a row is then in the simulated time of the bus, which the reading process cannot get
from a clock. Before it sends a row, the simulated amplifier writes its arrival into a small file
next to its port; the reader of the port finds it there by the row's sequence number. A real port
has no such file.
"""

from __future__ import annotations

import mmap
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from config.errors import TransportError

SEQUENCES = 1 << 16
_BYTES = 8 * SEQUENCES


def arrivals_path(address: str) -> Path:
    """Return the path of the arrivals for the port at `address`, if it is simulated."""
    return Path(f"{address}.arrivals")


class ArrivalWriter:
    """Writer of the file; all arrivals are unknown at first."""

    def __init__(self, path: Path) -> None:
        with path.open("w+b") as file:
            file.truncate(_BYTES)
            self._memory = mmap.mmap(file.fileno(), _BYTES)
        self._times = np.frombuffer(self._memory, np.float64)
        self._times[:] = np.nan

    def write(self, sequence: ArrayLike, time_s: ArrayLike) -> None:
        """Write the arrivals of rows before they are sent: numbers modulo 2^16, simulated times."""
        self._times[np.asarray(sequence, dtype=np.int64) % SEQUENCES] = time_s


class ArrivalReader:
    """Reader of the rows' arrivals.

    Raises:
        TransportError: The file does not exist: the port is real, or simulated in real time.
    """

    def __init__(self, path: Path) -> None:
        try:
            with path.open("rb") as file:
                self._memory = mmap.mmap(file.fileno(), _BYTES, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise TransportError(
                f"{path}: no simulated arrivals ({error}); start the simulated cell",
                code="RID-MOCK-NOT-SERVED",
            ) from error

    def time_s(self, sequence: ArrayLike) -> NDArray[np.float64]:
        """Return the arrivals of rows just received [s]; NaN for numbers that were never sent."""
        times = np.frombuffer(self._memory, np.float64)
        found: NDArray[np.float64] = times[np.asarray(sequence, dtype=np.int64) % SEQUENCES]
        return found

    def close(self) -> None:
        """Close the file."""
        self._memory.close()

    def __enter__(self) -> ArrivalReader:
        """Return the reader itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self.close()
