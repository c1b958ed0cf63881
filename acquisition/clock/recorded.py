"""`RepeatCounter`: repeated rows of our own recordings, whose clock is the cyclic task's."""

from __future__ import annotations

import numpy as np

from acquisition.clock.repeats import longest_run, repeated_rows
from acquisition.clock.report import ClockReport, ClockState
from acquisition.clock.samples import Samples
from acquisition.recording.recording import Recording


class RepeatCounter:
    """Count repeated rows of a recording part by part; its memory does not grow."""

    def __init__(self) -> None:
        self._rows = self._repeated = 0
        self._longest = 1

    def add(self, part: Recording) -> Recording:
        """Count the next part, and return it."""
        position = part.position[part.valid]
        nothing = np.full_like(position, np.nan)
        samples = Samples(part.time_s[part.valid], position, nothing, part.torque_nm[part.valid])
        repeated = repeated_rows(samples)
        self._rows += len(samples)
        self._repeated += int(np.count_nonzero(repeated))
        self._longest = max(self._longest, longest_run(repeated))
        return part

    def report(self) -> ClockReport:
        """Return what was counted."""
        return ClockReport(
            clock=ClockState.UNVERIFIED,
            rows=self._rows,
            repeated_rows=self._repeated,
            longest_repeat=self._longest,
        )

    def notes(self) -> tuple[str, ...]:
        """Return a sentence if rows repeat."""
        if not self._repeated:
            return ()
        share = 100.0 * self._repeated / self._rows
        return (
            f"{self._repeated} of {self._rows} rows ({share:.1f} %) repeat positions and torques"
            " of the row before although the robot moves: the drives renew their values less often"
            " than the cell's cycle. Check their PDOs and cycle time",
        )
