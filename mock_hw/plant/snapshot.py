"""`AxisSnapshot`: true state of the simulated axes, readable from any process.

The drives' process writes the state into a small file whenever it has advanced the simulation;
tests and checks read it. These data are not on the bus, and a real robot has no such file. Readers
also write two numbers into the file: that of the payload to mount on the flange, and that of a
motion's row.
"""

from __future__ import annotations

import mmap
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from config.errors import TransportError

# Header of 8-byte words, each written atomically. The simulation writes the sequence number (odd
# during a write), the number of axes and the time. Readers request a payload by its number (0: no
# payload), and announce the row of a motion that begins with the next SYNC (row + 1; 0: none).
_SEQUENCE, _AXES, _TIME, _PAYLOAD, _ROW = 0, 1, 2, 3, 4
_HEADER_WORDS = 5
_ROWS = 5
_PATIENCE_S = 2.0
"""Longest wait for the end of a write [s]; after it, the writing process counts as ended."""


@dataclass(frozen=True)
class AxisSnapshot:
    """True state of a simulated robot at a time.

    Attributes:
        time_s: Time on the bus [s]: simulated time in lock-step, else CLOCK_MONOTONIC.
        position: Joint positions, (n,) [rad or m].
        velocity: Joint velocities, (n,) [rad/s or m/s].
        torque: Motor torques at the link side, (n,) [N m or N].
        enabled: True if the axis's drive is powered, (n,); otherwise its brake is closed.
        temperature_k: Motor temperatures, (n,) [K].
    """

    time_s: float
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    torque: NDArray[np.float64]
    enabled: NDArray[np.bool_]
    temperature_k: NDArray[np.float64]


class SnapshotWriter:
    """Writes snapshots into a file; the constructor creates the file, filled with zeros."""

    def __init__(self, path: Path, axes: int) -> None:
        size = 8 * (_HEADER_WORDS + _ROWS * axes)
        with path.open("w+b") as file:
            file.truncate(size)
            self._memory = mmap.mmap(file.fileno(), size)
        self._words = np.frombuffer(self._memory, np.uint64, _HEADER_WORDS)
        numbers = np.frombuffer(self._memory, np.float64)
        self._time = numbers[_TIME : _TIME + 1]
        self._rows = numbers[_HEADER_WORDS:].reshape(_ROWS, axes)
        self._sequence = 0
        self._words[_AXES] = axes

    @property
    def payload(self) -> int:
        """Number of the payload that was requested by `SnapshotReader.request_payload`."""
        return int(self._words[_PAYLOAD])

    @payload.setter
    def payload(self, number: int) -> None:
        self._words[_PAYLOAD] = number

    def take_row(self) -> int | None:
        """Return the row that was announced since the last call; None without one."""
        announced = int(self._words[_ROW])
        if not announced:
            return None
        self._words[_ROW] = 0
        return announced - 1

    def write(
        self,
        time_s: float,
        position: ArrayLike,
        velocity: ArrayLike,
        torque: ArrayLike,
        enabled: ArrayLike,
        temperature_k: ArrayLike,
    ) -> None:
        """Write a snapshot; readers never get an incomplete one."""
        self._words[_SEQUENCE] = self._sequence + 1
        self._time[0] = time_s
        self._rows[0] = position
        self._rows[1] = velocity
        self._rows[2] = torque
        self._rows[3] = enabled
        self._rows[4] = temperature_k
        self._sequence += 2
        self._words[_SEQUENCE] = self._sequence


class SnapshotReader:
    """Reads snapshots that another process writes.

    Raises:
        TransportError: The file does not exist or cannot be read.
    """

    def __init__(self, path: Path) -> None:
        try:
            with path.open("r+b") as file:
                self._memory = mmap.mmap(file.fileno(), 0)
        except (OSError, ValueError) as error:
            raise TransportError(
                f"{path}: cannot read the state of the simulated axes ({error})",
                code="RID-MOCK-NOT-SERVED",
            ) from error

    def read(self) -> AxisSnapshot:
        """Return the latest snapshot.

        Raises:
            TransportError: The writing process ended during a write.
        """
        give_up_s = time.monotonic() + _PATIENCE_S
        while time.monotonic() < give_up_s:
            before = self._sequence()
            content = self._memory[:]
            if before == self._sequence() and before % 2 == 0:
                axes = int(np.frombuffer(content, np.uint64, _HEADER_WORDS)[_AXES])
                numbers = np.frombuffer(content, np.float64)
                rows = numbers[_HEADER_WORDS:].reshape(_ROWS, axes)
                return AxisSnapshot(
                    float(numbers[_TIME]), rows[0], rows[1], rows[2], rows[3] != 0.0, rows[4]
                )
            os.sched_yield()
        raise TransportError(
            "the snapshot of the simulated axes is incomplete: the simulation ended while it"
            " wrote the snapshot; start the simulated cell again",
            code="RID-MOCK-ENDED",
        )

    def request_payload(self, number: int) -> None:
        """Request that the simulation mounts a payload by its number; 0 for an empty flange."""
        self._write_word(_PAYLOAD, number)

    def announce_row(self, row: int) -> None:
        """Announce that the next SYNC belongs to a row of a motion."""
        self._write_word(_ROW, row + 1)

    def _write_word(self, word: int, number: int) -> None:
        self._memory[8 * word : 8 * word + 8] = number.to_bytes(8, sys.byteorder)

    def _sequence(self) -> int:
        return int.from_bytes(self._memory[:8], sys.byteorder)

    def __enter__(self) -> SnapshotReader:
        """Return the reader itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._memory.close()
