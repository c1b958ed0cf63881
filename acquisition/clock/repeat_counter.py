"""`RepeatCounter`: counts repeated rows in recordings of this program."""

from __future__ import annotations

import numpy as np

from acquisition.clock.repeats import longest_run, repeated_rows
from acquisition.clock.report import ClockReport, ClockState
from acquisition.clock.samples import Samples
from acquisition.recording.recording import Recording


class RepeatCounter:
    """Counter of repeated rows in a recording that is read in parts; each part is judged alone."""

    def __init__(self) -> None:
        self._rows = self._repeated = 0
        self._longest = 1

    def add(self, part: Recording) -> Recording:
        """Count the repeated rows of the next part, and return the part."""
        position = part.position[part.valid]
        nothing = np.full_like(position, np.nan)
        samples = Samples(part.time_s[part.valid], position, nothing, part.torque_nm[part.valid])
        repeated = repeated_rows(samples)
        self._rows += len(samples)
        self._repeated += int(np.count_nonzero(repeated))
        self._longest = max(self._longest, longest_run(repeated))
        return part

    def report(self) -> ClockReport:
        """Return the report with the counts."""
        return ClockReport(
            clock=ClockState.UNVERIFIED,
            rows=self._rows,
            repeated_rows=self._repeated,
            longest_repeat=self._longest,
        )

    def notes(self) -> tuple[str, ...]:
        """Return a note for the report if rows repeat; otherwise return nothing."""
        if not self._repeated:
            return ()
        share = 100.0 * self._repeated / self._rows
        return (
            f"{self._repeated} of {self._rows} rows ({share:.1f} %) repeat the positions and"
            " torques of the previous row although the robot moves: the drives update these"
            " values more slowly than the cell's cycle. Check the drives' PDO settings and the"
            " cycle time",
        )
