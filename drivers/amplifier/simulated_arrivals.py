"""Arrival times of an amplifier's rows in a cell with simulated time (lock-step).

The arrival time of a row is a simulated time of the bus, which the process that reads the rows
cannot get from a clock. Before the simulated amplifier sends a row, it therefore writes the row's
arrival time into a small file next to its port. The reader of the port finds the time there by the
row's sequence number. A real port has no such file.
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
    """Return the path of the file with arrival times for the simulated port at `address`."""
    return Path(f"{address}.arrivals")


class ArrivalWriter:
    """Writer of the file with arrival times; at first all times are unknown (NaN)."""

    def __init__(self, path: Path) -> None:
        with path.open("w+b") as file:
            file.truncate(_BYTES)
            self._memory = mmap.mmap(file.fileno(), _BYTES)
        self._times = np.frombuffer(self._memory, np.float64)
        self._times[:] = np.nan

    def write(self, sequence: ArrayLike, time_s: ArrayLike) -> None:
        """Write the simulated arrival times of rows to be sent, by row number modulo 2^16."""
        self._times[np.asarray(sequence, dtype=np.int64) % SEQUENCES] = time_s


class ArrivalReader:
    """Reader of the file with the rows' arrival times.

    Raises:
        TransportError: The file does not exist, because the port is real, or simulated in real
            time.
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
        """Return the arrival times of rows, by row number [s]; NaN for a row that was not sent."""
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
