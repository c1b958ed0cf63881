"""`MarkedStart`: a source of set-points that announces the beginning of its motion."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Protocol

from acquisition.supervision.cycle import SetPoint
from acquisition.supervision.stop_reason import StopReason
from acquisition.task.set_points import SetPointSource
from config.arrays import FloatArray
from drivers.interfaces.servo_axes import Answers


class StartMarker(Protocol):
    """Receiver of the announcement, in the process of the cyclic task."""

    @abstractmethod
    def open(self) -> None:
        """Prepare the announcement, before the motion."""

    @abstractmethod
    def mark(self, row: int) -> None:
        """Announce that the next SYNC belongs to a row of the motion."""


class MarkedStart:
    """A `SetPointSource` that announces a row near the beginning, before its SYNC.

    Args:
        source: The motion.
        marker: Receiver of the announcement.
    """

    def __init__(self, source: SetPointSource, marker: StartMarker) -> None:
        self._source = source
        self._marker = marker
        self._begun = False

    @property
    def samples_per_period(self) -> int | None:
        """Number of rows of one period; None if the motion is not periodic."""
        return self._source.samples_per_period

    @property
    def rows_expected(self) -> int:
        """Largest expected number of rows."""
        return self._source.rows_expected

    @property
    def period_ends(self) -> Mapping[int, int]:
        """Number of complete periods at each row that ends one."""
        return self._source.period_ends

    @property
    def stop(self) -> StopReason | None:
        """Reason for which the motion ended early."""
        return self._source.stop

    @property
    def notes(self) -> Sequence[str]:
        """Notes on the motion for the report, as those of the source of set-points."""
        return self._source.notes

    def prepare(self) -> None:
        """Prepare motion and announcement."""
        self._source.prepare()
        self._marker.open()

    def refuse_begin(self, answers: Answers) -> None:
        """Refuse to begin if the motion refuses."""
        self._source.refuse_begin(answers)

    def begin(self, lockstep: bool, position: FloatArray) -> FloatArray:
        """Return the start pose."""
        return self._source.begin(lockstep, position)

    def watch(self, answers: Answers) -> None:
        """Pass the drives' answers to the motion."""
        self._source.watch(answers)

    def at(self, row: int) -> SetPoint | None:
        """Return the set-point of a row; announce the first row after row 0.

        Row 0 is not announced: a streamed path rests there for a cycle more than a planned motion.
        """
        target = self._source.at(row)
        if not self._begun and target is not None and target.sample_index > 0:
            self._begun = True
            self._marker.mark(target.sample_index)
        return target
