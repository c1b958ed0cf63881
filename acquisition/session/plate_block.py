"""`PlateBlock`: what the plate's reader process and the others tell one another.

Anonymous shared memory, one writer a field, as `ControlBlock`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from multiprocessing import get_context
from typing import Any

import numpy as np
from numpy.typing import NDArray

from config import errors
from config.cell.plate import CHANNELS
from config.errors import DriverError, RidDaqError


class PlateState(IntEnum):
    """How far the reader has come."""

    STARTING = 0
    RECORDING = 1
    LINE_LOST = 2
    FINISHED = 3
    FAILED = 4


class _Fields(ctypes.Structure):
    _fields_ = (
        # written by the program
        ("stop", ctypes.c_int64),
        # written by the reader
        ("state", ctypes.c_int64),
        ("beat", ctypes.c_int64),
        ("rows", ctypes.c_int64),
        ("rows_lost", ctypes.c_int64),
        ("bad_frames", ctypes.c_int64),
        ("garbage_bytes", ctypes.c_int64),
        ("overloaded_rows", ctypes.c_int64),
        ("overloads", ctypes.c_int64),
        ("losses", ctypes.c_int64),
        ("read_s", ctypes.c_double),
        ("force_n", ctypes.c_double * CHANNELS),
        ("force_max_n", ctypes.c_double * CHANNELS),
        ("error_class", ctypes.c_char * 64),
        ("error_text", ctypes.c_char * 4096),
    )


@dataclass(frozen=True)
class PlateStatus:
    """How the plate fares.

    Attributes
    ----------
    state : PlateState
        How far its reader has come.
    rows, rows_lost : int
        Rows received, and rows that the sequence numbers say are missing.
    bad_frames, garbage_bytes : int
        What came over the line and is no row.
    overloaded_rows : int
        Rows with an overload of any channel.
    overloads : tuple of bool
        Which channels have been overloaded since the start.
    losses : int
        How often the line was lost.
    age_s : float
        Time since the last row [s]; infinite before the first.
    force_n, force_max_n : ndarray, shape (8,)
        The last row, and the largest absolute value of each channel since the start [N].
    """

    state: PlateState
    rows: int
    rows_lost: int
    bad_frames: int
    garbage_bytes: int
    overloaded_rows: int
    overloads: tuple[bool, ...]
    losses: int
    age_s: float
    force_n: NDArray[np.float64]
    force_max_n: NDArray[np.float64]


class PlateBlock:
    """The shared words; made by `create`, handed to the processes as an argument."""

    def __init__(self, fields: Any) -> None:
        self._fields = fields

    @classmethod
    def create(cls) -> PlateBlock:
        """Return a cleared block in fresh shared memory."""
        return cls(get_context("spawn").RawValue(_Fields))

    def __reduce__(self) -> tuple[Callable[..., PlateBlock], tuple[Any]]:
        return PlateBlock, (self._fields,)

    # the program's side

    def request_stop(self) -> None:
        """Ask the reader to end the stream and close its file. Safe in a signal handler."""
        self._fields.stop = 1

    def status(self, now_s: float) -> PlateStatus:
        """Return how the plate fares at `now_s` [s, monotonic clock]."""
        fields = self._fields
        word = int(fields.overloads)
        return PlateStatus(
            state=PlateState(fields.state),
            rows=int(fields.rows),
            rows_lost=int(fields.rows_lost),
            bad_frames=int(fields.bad_frames),
            garbage_bytes=int(fields.garbage_bytes),
            overloaded_rows=int(fields.overloaded_rows),
            overloads=tuple(bool(word >> channel & 1) for channel in range(CHANNELS)),
            losses=int(fields.losses),
            age_s=now_s - fields.read_s if fields.rows else float("inf"),
            force_n=np.array(fields.force_n),
            force_max_n=np.array(fields.force_max_n),
        )

    @property
    def beat(self) -> int:
        """A counter that grows while the reader lives."""
        return int(self._fields.beat)

    @property
    def error(self) -> RidDaqError | None:
        """The error that ended the reader; None where none did."""
        if self.state is not PlateState.FAILED:
            return None
        kind = getattr(errors, self._fields.error_class.decode(), DriverError)
        if not (isinstance(kind, type) and issubclass(kind, RidDaqError)):
            kind = DriverError
        return kind(self._fields.error_text.decode(errors="replace"))

    # the reader's side

    @property
    def stop(self) -> bool:
        """Whether the program has asked for the end."""
        return bool(self._fields.stop)

    @property
    def state(self) -> PlateState:
        """How far the reader has come."""
        return PlateState(self._fields.state)

    @state.setter
    def state(self, state: PlateState) -> None:
        self._fields.state = int(state)

    def give_sign_of_life(self) -> None:
        """Count the beat on."""
        self._fields.beat += 1

    def count_loss(self) -> None:
        """Say that the line was lost."""
        self._fields.losses += 1
        self.state = PlateState.LINE_LOST

    def count_damage(self, rows_lost: int, bad_frames: int, garbage_bytes: int) -> None:
        """Say what has gone wrong on the line so far."""
        fields = self._fields
        fields.rows_lost = rows_lost
        fields.bad_frames = bad_frames
        fields.garbage_bytes = garbage_bytes

    def add_rows(
        self, force_n: NDArray[np.float32], overload: NDArray[np.uint8], read_s: float
    ) -> None:
        """Say what came: forces (rows, 8) [N] and overload words (rows,)."""
        fields = self._fields
        fields.force_n[:] = force_n[-1].tolist()
        largest = np.maximum(np.array(fields.force_max_n), np.abs(force_n).max(axis=0))
        fields.force_max_n[:] = largest.tolist()
        fields.overloads |= int(np.bitwise_or.reduce(overload))
        fields.overloaded_rows += int(np.count_nonzero(overload))
        fields.read_s = read_s
        fields.rows += len(force_n)

    def fail(self, error: RidDaqError) -> None:
        """Hand an error that ends the reader to the program."""
        fields = self._fields
        fields.error_class = type(error).__name__.encode()[:63]
        fields.error_text = str(error).encode().replace(b"\0", b"?")[:4095]
        self.state = PlateState.FAILED
