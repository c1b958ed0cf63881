"""`RunRequest`: what is recorded into one run folder."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from acquisition.motion.samples import MotionSamples
from acquisition.session.early_stop import NewPeriods
from acquisition.session.outcome import RecordOutcome
from acquisition.task.set_points import SetPointSource

Record = Callable[[MotionSamples | SetPointSource], RecordOutcome]
"""Function that executes planned rows, or the points of a set-point source, and records them."""


class Watch(Protocol):
    """Observer of the periods of a running motion; it can end the motion."""

    @abstractmethod
    def add_periods(self, new: NewPeriods) -> bool:
        """Add periods; return True if the motion can end after the present period."""

    @abstractmethod
    def line(self) -> str:
        """Return a short status line; empty if there is nothing to report."""

    @abstractmethod
    def sentences(self) -> Sequence[str]:
        """Return sentences for the report on the final state of the observed quantities."""


@dataclass(frozen=True)
class RunRequest:
    """Definition of a recording into one run folder.

    Attributes:
        label: Label of the run.
        sentence: Sentence on the motion.
        samples: Planned rows; None if the points come from another source.
        drive: Function that is called with a `Record` function and must call it with the
            set-points. None to record `samples`.
        role: Purpose of the motion, shown on the terminal and in the report.
        files: Content by name of files for the folder, in addition to the cell's files.
        observed: Function that returns files with what was observed during the motion. They are
            written after the motion, also if an error ended it, and may replace some of `files`.
        watch: Observer of the periods, which can end the motion.
        frames: True to record all frames on the bus too.
        epilogue: Sentence that a storage error contains if this run is only one step of a job.
        held: True if the robot moves only while a person holds a key.
        tested_joint: Joint that moves in an axis test; None in other motions.
    """

    label: str
    sentence: str
    samples: MotionSamples | None
    drive: Callable[[Record], RecordOutcome] | None = None
    role: str = "recording"
    files: Mapping[str, bytes] = field(default_factory=dict)
    observed: Callable[[], Mapping[str, bytes]] = dict
    watch: Watch | None = None
    frames: bool = False
    epilogue: str = ""
    held: bool = False
    tested_joint: str | None = None
