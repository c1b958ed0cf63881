"""`RunQuality`: completeness of a recording, and the rows and periods that are left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydantic import JsonValue

from acquisition.processing.period_table import MISSING_FRACTION_LIMIT
from acquisition.processing.periods import PeriodAverage
from acquisition.processing.recording_tally import RecordingTally
from config.errors import DataQualityError


@dataclass(frozen=True)
class RunQuality:
    """Completeness of a recording whose motion ran to its end.

    Attributes:
        joint_names: Base to flange.
        rows: Number of rows of the motion.
        lost: For each joint, number of rows without a valid answer.
        average: Mean period, if the motion has at least two periods and the recording is good
            enough.
        trouble: Reason why the recording is not good enough; empty if it is.
    """

    joint_names: tuple[str, ...]
    rows: int
    lost: tuple[int, ...]
    average: PeriodAverage | None = None
    trouble: str = ""

    @property
    def good(self) -> bool:
        """True if the recording is good enough for the next step."""
        return not self.trouble

    def sentences(self) -> list[str]:
        """Return sentences on lost answers and left-out periods."""
        sentences = []
        if any(self.lost):
            lost = zip(self.lost, self.joint_names, strict=True)
            counts = ", ".join(f"{count} of {name}" for count, name in lost if count)
            sentences.append(f"Lost answers in {self.rows} rows of the motion: {counts}.")
        if self.average is not None:
            if self.average.missing_samples:
                sentences.append(
                    f"{self.average.missing_samples} single rows are left out of the mean period."
                )
            sentences += [
                f"Period {period.number} is left out: {period.reason}."
                for period in self.average.rejected
            ]
        return sentences

    def to_dict(self) -> dict[str, JsonValue]:
        """Return the JSON document."""
        rejected = () if self.average is None else self.average.rejected
        return {
            "good": self.good,
            "trouble": self.trouble,
            "rows": self.rows,
            "lost_answers": dict(zip(self.joint_names, self.lost, strict=True)),
            "periods_kept": None if self.average is None else self.average.periods_kept,
            "rejected": [{"index": each.index, "reason": each.reason} for each in rejected],
        }


def run_quality(tally: RecordingTally, averaged: Callable[[], PeriodAverage]) -> RunQuality:
    """Evaluate the recording of a motion that ran to its end.

    A recording with two or more periods is good enough if they can be averaged. Any other recording
    is good enough if no joint's answers are missing in more than 2 % of the rows of the motion.

    Args:
        tally: Statistics of a recording by rid-daq.
        averaged: Function that averages the periods.
    """
    names, rows, lost = tally.head.joint_names, tally.motion_rows, tally.lost
    average, trouble = None, ""
    if tally.cutter.periods >= 2:
        try:
            average = averaged()
        except DataQualityError as error:
            trouble = str(error)
    elif max(lost) > MISSING_FRACTION_LIMIT * rows:
        worst = int(np.argmax(lost))
        trouble = (
            f"joint {names[worst]!r}: {lost[worst]} of {rows} rows of the motion are missing or"
            f" invalid; at most {MISSING_FRACTION_LIMIT:.0%} are allowed: look for lost frames on"
            " the bus"
        )
    return RunQuality(names, rows, lost, average, trouble)
