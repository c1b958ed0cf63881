"""`AxisSnapshot`: where the simulated axes really are, readable from any process.

The drives' process writes it into a small file after every step; tests and the program's own checks
read it. Nothing of it ever comes over the bus: a real robot has no such file.
"""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from config.errors import TransportError

_HEADER = struct.Struct("<qqd")  # sequence number (odd while writing), axes, time
_ROWS = 4
_ATTEMPTS = 10_000

FILE_NAME = "axes.bin"


@dataclass(frozen=True)
class AxisSnapshot:
    """The true state of a simulated robot at one moment.

    Attributes
    ----------
    time_s
        The simulated bus's time: simulated, or CLOCK_MONOTONIC [s].
    position, velocity, torque
        Of the joints, (n,): rad or m, per second, and motor torque at the link side, N m or N.
    enabled
        Whether the axis's drive is powered, (n,); its brake is closed otherwise.
    """

    time_s: float
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    torque: NDArray[np.float64]
    enabled: NDArray[np.bool_]


class SnapshotWriter:
    """Writes snapshots into a file; the file is there, all zeros, once this has been made."""

    def __init__(self, path: Path, axes: int) -> None:
        size = _HEADER.size + 8 * _ROWS * axes
        with path.open("w+b") as file:
            file.truncate(size)
            self._memory = mmap.mmap(file.fileno(), size)
        self._axes = axes
        self._sequence = 0
        self._rows = np.frombuffer(self._memory, np.float64, offset=_HEADER.size).reshape(
            _ROWS, axes
        )

    def write(
        self,
        time_s: float,
        position: ArrayLike,
        velocity: ArrayLike,
        torque: ArrayLike,
        enabled: ArrayLike,
    ) -> None:
        """Write one snapshot; readers see it whole or not at all."""
        _HEADER.pack_into(self._memory, 0, self._sequence + 1, self._axes, time_s)
        self._rows[0] = position
        self._rows[1] = velocity
        self._rows[2] = torque
        self._rows[3] = enabled
        self._sequence += 2
        _HEADER.pack_into(self._memory, 0, self._sequence, self._axes, time_s)


class SnapshotReader:
    """Reads the snapshots of another process.

    Raises
    ------
    TransportError
        There is no such file.
    """

    def __init__(self, path: Path) -> None:
        try:
            with path.open("rb") as file:
                self._memory = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise TransportError(f"{path}: no simulated axes to look at ({error})") from error

    def read(self) -> AxisSnapshot:
        """Return the latest snapshot.

        Raises
        ------
        TransportError
            The writer has died while writing.
        """
        for _ in range(_ATTEMPTS):
            content = self._memory[:]
            before, axes, time_s = _HEADER.unpack_from(content)
            after, _, _ = _HEADER.unpack_from(self._memory)
            if before == after and before % 2 == 0:
                rows = np.frombuffer(content, np.float64, offset=_HEADER.size).reshape(_ROWS, axes)
                return AxisSnapshot(time_s, rows[0], rows[1], rows[2], rows[3] != 0.0)
        raise TransportError("the simulated axes' snapshot is torn: its writer died")

    def __enter__(self) -> SnapshotReader:
        """Return the reader itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Let go of the file."""
        self._memory.close()
