"""`PlateBlock`: shared memory between the plate recorder and the program."""

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
    """State of the plate recorder."""

    STARTING = 0
    RECORDING = 1
    LINE_LOST = 2
    FINISHED = 3
    FAILED = 4


class _Words(ctypes.Structure):
    _fields_ = (
        # written by the program
        ("stop", ctypes.c_int64),
        # written by the recorder
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
    """Status of the force plate's recording.

    Attributes:
        state: State of the plate recorder.
        rows, rows_lost: Rows received, and rows missing according to the sequence numbers.
        bad_frames, garbage_bytes: Received frames and bytes that are not rows.
        overloaded_rows: Rows with an overload of any channel.
        overloads: True for channels that were overloaded since the start.
        losses: Number of times that the connection was lost.
        age_s: Time since the last row [s]; infinite before the first.
        force_n, force_max_n: Shape (8,). Forces of the last row, and the largest absolute value of
            each channel since the start [N].
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
    """Shared memory of a plate's recording, with fields of the program and of the recorder."""

    LABEL = "rid-daq-plate-1"
    WORDS = _Words

    # Methods that only the program calls:

    def request_stop(self) -> None:
        """Request the end of the stream and of the file. Safe in a signal handler."""
        self._words.stop = 1

    def status(self, now_s: float) -> PlateStatus:
        """Return the status at `now_s` [s, monotonic clock]."""
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
        """Heartbeat counter of the plate recorder."""
        return int(self._words.beat)

    @property
    def error(self) -> RidDaqError | None:
        """Error that ended the recorder; None without an error."""
        error: RidDaqError | None = self._words.error.get()
        return error

    # Methods that only the recorder calls:

    @property
    def stop(self) -> bool:
        """True if the program has requested the end."""
        return bool(self._words.stop)

    @property
    def state(self) -> PlateState:
        """State of the recorder."""
        return PlateState(self._words.state)

    @state.setter
    def state(self, state: PlateState) -> None:
        self._words.state = int(state)

    def count_heartbeat(self) -> None:
        """Increment the heartbeat counter."""
        self._words.beat += 1

    def count_loss(self) -> None:
        """Report a loss of the connection."""
        self._words.losses += 1
        self.state = PlateState.LINE_LOST

    def count_damage(self, rows_lost: int, bad_frames: int, garbage_bytes: int) -> None:
        """Report the transmission errors so far."""
        words = self._words
        words.rows_lost = rows_lost
        words.bad_frames = bad_frames
        words.garbage_bytes = garbage_bytes

    def add_rows(
        self, force_n: NDArray[np.float32], overload: NDArray[np.uint8], read_s: float
    ) -> None:
        """Report received rows: forces (rows, 8) [N] and overload words (rows,)."""
        words = self._words
        words.force_n[:] = force_n[-1].tolist()
        largest = np.maximum(np.array(words.force_max_n), np.abs(force_n).max(axis=0))
        words.force_max_n[:] = largest.tolist()
        words.overloads |= int(np.bitwise_or.reduce(overload))
        words.overloaded_rows += int(np.count_nonzero(overload))
        words.read_s = read_s
        words.rows += len(force_n)

    def fail(self, error: RidDaqError) -> None:
        """Report the error that ends the recorder."""
        self._words.error.put(error)
        self.state = PlateState.FAILED
