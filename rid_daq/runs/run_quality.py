"""`RunQuality`: whether what was recorded is whole enough to go on with, and what is left out."""

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
    """What a whole recording has lost.

    Attributes:
        joint_names: Base to flange.
        rows: Rows of the motion that were driven.
        lost: How many of them hold no valid answer, of each joint.
        average: Its mean period, where it is periodic and good enough.
        trouble: Why it is not good enough; empty where it is.
    """

    joint_names: tuple[str, ...]
    rows: int
    lost: tuple[int, ...]
    average: PeriodAverage | None = None
    trouble: str = ""

    @property
    def good(self) -> bool:
        """Whether the commands that come next take it."""
        return not self.trouble

    def sentences(self) -> list[str]:
        """Say what is lost and what is left out; nothing where nothing is."""
        said = []
        if any(self.lost):
            lost = zip(self.lost, self.joint_names, strict=True)
            counts = ", ".join(f"{count} of {name}" for count, name in lost if count)
            said.append(f"Answers lost in {self.rows} rows of the motion: {counts}.")
        if self.average is not None:
            if self.average.missing_samples:
                said.append(
                    f"{self.average.missing_samples} single rows are left out of the mean period."
                )
            said += [
                f"Period {period.number} is left out: {period.reason}."
                for period in self.average.rejected
            ]
        return said

    def to_dict(self) -> dict[str, JsonValue]:
        """Return it as a command's document has it."""
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
    """Judge a recording of a motion that ran to its end.

    A periodic one is good enough where its periods can be averaged, any other where no joint's
    answers are missing in more than 2 % of the rows of the motion.

    Args:
        tally: What was measured by the program itself.
        averaged: Averages its periods.
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
            f"joint {names[worst]!r}: {lost[worst]} of {rows} rows of the motion"
            f" are missing or not valid; more than {MISSING_FRACTION_LIMIT:.0%} is too much: look"
            " for lost frames on the bus"
        )
    return RunQuality(names, rows, lost, average, trouble)
