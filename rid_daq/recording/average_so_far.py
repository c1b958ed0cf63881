"""`AverageSoFar`: mean period of a running motion, updated with its new periods only."""

from __future__ import annotations

import math

from acquisition.journal.monitor import (
    MONITOR,
    read_run_temperatures,
    with_temperature_compensation,
)
from acquisition.processing.period_table import PeriodCutter
from acquisition.processing.periods import PeriodAverage, average_table
from acquisition.recording.recording import Recording, concatenate_recordings
from acquisition.session.early_stop import NewPeriods
from config.robot.robot import RobotDescription


class AverageSoFar:
    """Running average of periods.

    Each row is processed once, as soon as its temperature is known.
    """

    def __init__(self, robot: RobotDescription) -> None:
        self._robot = robot
        self._cutter = PeriodCutter()
        self._unsettled: list[Recording] = []

    def with_new_periods(self, new: NewPeriods) -> PeriodAverage:
        """Return the mean period including new periods.

        Raises:
            DataQualityError: The periods are not good enough yet.
            RecordingError: The parts of the recording do not fit together.
        """
        rows = concatenate_recordings([*self._unsettled, new.recording])
        stream, _ = read_run_temperatures(rows, new.folder)
        self._cutter.add(with_temperature_compensation(rows, stream, self._robot))
        if (new.folder / MONITOR).exists():
            # temperatures are interpolated: rows after the last reading wait for the next reading
            known_s = -math.inf if stream is None else stream.known_until_s
            self._unsettled = [rows.part(rows.time_s > known_s)]
        return average_table(self._cutter.table())
