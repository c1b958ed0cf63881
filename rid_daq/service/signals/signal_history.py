"""`SignalHistory`: the last ten minutes of a cell's live signals, in memory of constant size.

`SignalReader` reads the rows of a motion, `SignalBinner` reduces them, and the history keeps them.
A viewer keeps only the numbers of the bins that it has sent (`SignalView`), so a slow viewer needs
no memory.
"""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rid_daq.service.signals.signal_bins import BIN_S, SignalBins, lanes_of

KEPT_S: Final = 600.0
MOST_BINS: Final = round(KEPT_S / BIN_S)
"""Number of bins that a history keeps: ten minutes of motion."""


class SignalHistory:
    """Bins of a cell, numbered from 0; old bins are overwritten.

    Args:
        most_bins: Number of bins that are kept.

    Attributes:
        key: Changes when the numbers begin again, after a restart or a change of the joints.
        joints: Names of the joints.
        count: Number of bins so far.
        appended_s: Time at which the newest bins were appended [s, CLOCK_MONOTONIC].
    """

    def __init__(self, most_bins: int = MOST_BINS) -> None:
        self.most_bins = most_bins
        self._end_s: NDArray[np.float64] = np.empty(0)
        self._after_gap: NDArray[np.bool_] = np.empty(0, dtype=np.bool_)
        self._values: NDArray[np.float32] = np.empty((0, 0), dtype=np.float32)
        self._begin(())

    def append(self, joints: Sequence[str], bins: SignalBins) -> None:
        """Append bins; other joints than before begin a new history."""
        if tuple(joints) != self.joints:
            self._begin(tuple(joints))
        if not len(bins):
            return
        if not len(self._end_s):  # memory is used only once a robot has moved
            self._end_s = np.empty(self.most_bins)
            self._after_gap = np.empty(self.most_bins, dtype=np.bool_)
            self._values = np.empty((self.most_bins, lanes_of(len(joints))), dtype=np.float32)
        numbers = np.arange(self.count, self.count + len(bins))[-self.most_bins :]
        places = numbers % self.most_bins
        self._end_s[places] = bins.end_s[-self.most_bins :]
        self._after_gap[places] = bins.after_gap[-self.most_bins :]
        self._values[places] = bins.values[-self.most_bins :]
        self.count += len(bins)
        self.appended_s = time.monotonic()

    @property
    def oldest(self) -> int:
        """Number of the oldest bin that is kept."""
        return max(0, self.count - self.most_bins)

    def bins(self, first: int, count: int) -> SignalBins:
        """Return bins by their numbers; all of them must be kept."""
        places = np.arange(first, first + count) % self.most_bins
        return SignalBins(self._end_s[places], self._after_gap[places], self._values[places])

    def _begin(self, joints: tuple[str, ...]) -> None:
        self.key = secrets.token_hex(4)
        self.joints = joints
        self.count = 0
        self.appended_s = -math.inf
        self._end_s = np.empty(0)
