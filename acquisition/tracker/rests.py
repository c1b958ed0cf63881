"""`find_rests`: the poses in which a recorded robot was at rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.recording.recording import Recording
from config.arrays import FloatArray, freeze
from config.errors import DataQualityError

SHORTEST_S: Final = 0.4
"""Shortest standstill that counts as a rest [s]."""
SETTLING: Final = 0.3
"""Fraction of each rest, at its beginning, that is left out, because the robot still settles."""
STILL: Final = 2e-3
"""Largest speed of a joint at rest [rad/s or m/s], as a mean over `WINDOW_S`."""
WINDOW_S: Final = 0.1


@dataclass(frozen=True, eq=False)
class Rests:
    """Poses at rest, in the order of the recording.

    Attributes:
        begin_s, end_s: Shape (rests,). Times of the settled part of each rest [s].
        position: Shape (rests, n). Mean joint positions in this part [rad or m].
    """

    begin_s: FloatArray
    end_s: FloatArray
    position: FloatArray

    def __post_init__(self) -> None:
        freeze(self, DataQualityError, (None,), "begin_s")
        freeze(self, DataQualityError, (len(self.begin_s),), "end_s")
        freeze(self, DataQualityError, (len(self.begin_s), None), "position")

    def __len__(self) -> int:
        return len(self.begin_s)


def find_rests(recording: Recording) -> Rests:
    """Return the rests of a recording; the approach before the motion is not included.

    Raises:
        DataQualityError: The recording has no rest.
    """
    rows = recording.valid & (recording.sample_index >= 0)
    time_s, position = recording.time_s[rows], recording.position[rows]
    if len(time_s) < 2:
        raise _no_rest(recording)
    step_s = float(np.median(np.diff(time_s)))
    window = max(1, round(WINDOW_S / step_s))
    moved = np.abs(position[window:] - position[:-window]).max(axis=1)
    elapsed = time_s[window:] - time_s[:-window]
    is_still = np.zeros(len(time_s) + 2, dtype=np.bool_)
    is_still[1 + window // 2 : 1 + window // 2 + len(moved)] = moved <= STILL * elapsed
    edges = np.flatnonzero(np.diff(is_still.astype(np.int8)))
    found = []
    for begin, end in edges.reshape(-1, 2):
        last = min(end, len(time_s)) - 1
        if time_s[last] - time_s[begin] >= SHORTEST_S - WINDOW_S:
            settled = begin + round(SETTLING * (last - begin))
            mean = position[settled : last + 1].mean(axis=0)
            found.append((time_s[settled], time_s[last], mean))
    if not found:
        raise _no_rest(recording)
    begins, ends, poses = zip(*found, strict=True)
    return Rests(np.array(begins), np.array(ends), np.array(poses))


def _no_rest(recording: Recording) -> DataQualityError:
    return DataQualityError(
        f"run {recording.run_id} has no rest of at least {SHORTEST_S:g} s: record a motion that"
        " rests at each pose (kind pose_sequence)",
        code="RID-TRACKER-RESTS",
    )
