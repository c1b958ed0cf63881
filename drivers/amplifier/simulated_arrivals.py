"""When an amplifier's rows arrive in a simulated cell whose time is simulated too (lock-step).

There a row's arrival belongs to the simulated time of the bus, which no process can read off a
clock. The simulated amplifier writes it into a small file beside its port before it sends the row;
who reads the port looks it up by the row's sequence number. A real port has no such file.
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
    """Return where the arrivals of the port at `address` stand, if it is a simulated one."""
    return Path(f"{address}.arrivals")


class ArrivalWriter:
    """Makes the file, every arrival unknown, and writes arrivals into it."""

    def __init__(self, path: Path) -> None:
        with path.open("w+b") as file:
            file.truncate(_BYTES)
            self._memory = mmap.mmap(file.fileno(), _BYTES)
        self._times = np.frombuffer(self._memory, np.float64)
        self._times[:] = np.nan

    def write(self, sequence: ArrayLike, time_s: ArrayLike) -> None:
        """Write when rows arrive, before they are sent: numbers modulo 2^16, simulated times."""
        self._times[np.asarray(sequence, dtype=np.int64) % SEQUENCES] = time_s


class ArrivalReader:
    """Looks up when rows have arrived.

    Raises:
        TransportError: There is no such file: this is a real port, or a simulated one in real time.
    """

    def __init__(self, path: Path) -> None:
        try:
            with path.open("rb") as file:
                self._memory = mmap.mmap(file.fileno(), _BYTES, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise TransportError(
                f"{path}: no simulated arrivals there ({error})", code="RID-MOCK-NOT-SERVED"
            ) from error

    def time_s(self, sequence: ArrayLike) -> NDArray[np.float64]:
        """Return when rows just received have arrived [s]; NaN for numbers that were never sent."""
        times = np.frombuffer(self._memory, np.float64)
        found: NDArray[np.float64] = times[np.asarray(sequence, dtype=np.int64) % SEQUENCES]
        return found

    def close(self) -> None:
        """Let go of the file."""
        self._memory.close()

    def __enter__(self) -> ArrivalReader:
        """Return the reader itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Let go of the file."""
        self.close()
