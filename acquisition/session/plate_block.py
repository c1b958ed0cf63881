"""`PlateBlock`: what the plate's reader process and the program tell one another."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from acquisition.task.shared_block import SharedBlock, SharedError
from config.cell.plate import CHANNELS
from config.errors import RidDaqError


class PlateState(IntEnum):
    """How far the reader has come."""

    STARTING = 0
    RECORDING = 1
    LINE_LOST = 2
    FINISHED = 3
    FAILED = 4


class _Words(ctypes.Structure):
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
        ("error", SharedError),
    )


@dataclass(frozen=True)
class PlateStatus:
    """How the plate fares.

    Attributes:
        state: How far its reader has come.
        rows, rows_lost: Rows received, and rows that the sequence numbers say are missing.
        bad_frames, garbage_bytes: What came over the line and is no row.
        overloaded_rows: Rows with an overload of any channel.
        overloads: Which channels have been overloaded since the start.
        losses: How often the line was lost.
        age_s: Time since the last row [s]; infinite before the first.
        force_n, force_max_n: Shape (8,). The last row, and the largest absolute value of each
            channel since the start [N].
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


class PlateBlock(SharedBlock):
    """The words of a plate's recording, those of the program and those of the reader."""

    LABEL = "rid-daq-plate-1"
    WORDS = _Words

    # the program's side

    def request_stop(self) -> None:
        """Ask the reader to end the stream and close its file. Safe in a signal handler."""
        self._words.stop = 1

    def status(self, now_s: float) -> PlateStatus:
        """Return how the plate fares at `now_s` [s, monotonic clock]."""
        words = self._words
        overloads = int(words.overloads)
        return PlateStatus(
            state=PlateState(words.state),
            rows=int(words.rows),
            rows_lost=int(words.rows_lost),
            bad_frames=int(words.bad_frames),
            garbage_bytes=int(words.garbage_bytes),
            overloaded_rows=int(words.overloaded_rows),
            overloads=tuple(bool(overloads >> channel & 1) for channel in range(CHANNELS)),
            losses=int(words.losses),
            age_s=now_s - words.read_s if words.rows else float("inf"),
            force_n=np.array(words.force_n),
            force_max_n=np.array(words.force_max_n),
        )

    @property
    def beat(self) -> int:
        """A counter that grows while the reader lives."""
        return int(self._words.beat)

    @property
    def error(self) -> RidDaqError | None:
        """The error that ended the reader; None where none did."""
        error: RidDaqError | None = self._words.error.get()
        return error

    # the reader's side

    @property
    def stop(self) -> bool:
        """Whether the program has asked for the end."""
        return bool(self._words.stop)

    @property
    def state(self) -> PlateState:
        """How far the reader has come."""
        return PlateState(self._words.state)

    @state.setter
    def state(self, state: PlateState) -> None:
        self._words.state = int(state)

    def give_sign_of_life(self) -> None:
        """Count the beat on."""
        self._words.beat += 1

    def count_loss(self) -> None:
        """Say that the line was lost."""
        self._words.losses += 1
        self.state = PlateState.LINE_LOST

    def count_damage(self, rows_lost: int, bad_frames: int, garbage_bytes: int) -> None:
        """Say what has gone wrong on the line so far."""
        words = self._words
        words.rows_lost = rows_lost
        words.bad_frames = bad_frames
        words.garbage_bytes = garbage_bytes

    def add_rows(
        self, force_n: NDArray[np.float32], overload: NDArray[np.uint8], read_s: float
    ) -> None:
        """Say what came: forces (rows, 8) [N] and overload words (rows,)."""
        words = self._words
        words.force_n[:] = force_n[-1].tolist()
        largest = np.maximum(np.array(words.force_max_n), np.abs(force_n).max(axis=0))
        words.force_max_n[:] = largest.tolist()
        words.overloads |= int(np.bitwise_or.reduce(overload))
        words.overloaded_rows += int(np.count_nonzero(overload))
        words.read_s = read_s
        words.rows += len(force_n)

    def fail(self, error: RidDaqError) -> None:
        """Hand an error that ends the reader to the program."""
        self._words.error.put(error)
        self.state = PlateState.FAILED
