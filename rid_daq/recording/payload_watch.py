"""What is looked at while a payload session moves: whether it is warm, how sure the mass is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.processing.period_table import cut_periods
from acquisition.processing.periods import PeriodAverage
from acquisition.recording.recording import Recording
from acquisition.session.early_stop import NewPeriods
from config.arrays import FloatArray
from config.errors import DataQualityError, EstimationError
from config.robot.robot import RobotDescription
from identification.payload.measured_runs import MeasuredRuns
from identification.payload.periodic_runs import PeriodicRuns
from identification.payload.procedures import identify_payload
from rid_daq.jobs.payload.payload_job import PayloadRequest
from rid_daq.recording.average_so_far import AverageSoFar

FEWEST_PERIODS = 4
FITTED_PERIODS = 6


class WarmUpWatch:
    """Tells whether friction has settled: what the motors burn in one period after the other.

    Over a period that begins and ends alike, the mechanical power of a joint is what its friction
    takes, and that falls as a motor warms up.

    Parameters
    ----------
    drift_percent : float
        Settled where no joint's power changes by more in a period.
    """

    def __init__(self, drift_percent: float) -> None:
        self._limit = drift_percent
        self._power: list[FloatArray] = []
        self.drift_percent: float | None = None
        self.periods = 0
        self.worst = ""

    @property
    def settled(self) -> bool:
        """Whether the last periods agree."""
        return self.drift_percent is not None and self.drift_percent <= self._limit

    def enough(self, new: NewPeriods) -> bool:
        """Look at the periods so far."""
        self._power.extend(period_powers(new.recording, new.first_row))
        power = np.array(self._power)
        if len(power) < FEWEST_PERIODS:
            return False
        # The slope of a line through the last periods, so that their noise does not decide.
        last = power[-FITTED_PERIODS:]
        slope = np.polyfit(np.arange(len(last)), last, 1)[0]
        change = 100.0 * np.abs(slope) / np.maximum(np.abs(last.mean(axis=0)), 1e-9)
        worst = int(np.argmax(change))
        self.drift_percent, self.periods = float(change[worst]), len(power)
        self.worst = new.recording.joint_names[worst]
        return self.settled

    def sentences(self) -> list[str]:
        """Say for the report how much the power still changed."""
        return [self.line()]

    def line(self) -> str:
        """Say how much the power still changes."""
        if self.drift_percent is None:
            return "warming up"
        return (
            f"friction of {self.worst} changes by {self.drift_percent:.2f} % a period (settled at"
            f" {self._limit:g} %)"
        )


def period_powers(recording: Recording, start: int | None = None) -> FloatArray:
    """Return the mean mechanical power of each joint in each whole period, (periods, n) [W].

    `start` is the row of the motion at which the first period begins, where that is known.
    """
    if recording.samples_per_period is None or recording.sample_period_s is None:
        raise DataQualityError("warming up is told from periods: the motion must be periodic")
    n = len(recording.joint_names)
    if int(np.count_nonzero(recording.phase == Phase.MAIN)) < recording.samples_per_period:
        return np.zeros((0, n))
    values, present = cut_periods(recording, start)
    whole = values[present.all(axis=(1, 2))]
    speed = np.gradient(whole[:, :, :n], recording.sample_period_s, axis=1)
    return np.asarray(np.mean(speed * whole[:, :, n:], axis=1))


class MassWatch:
    """Tells whether the mass of the payload is sure enough.

    Parameters
    ----------
    robot : RobotDescription
        The robot.
    before : PeriodicRuns or None
        The runs recorded until now.
    payload_request : PayloadRequest
        How it will be estimated.
    goal_kg : float or None
        2 sigma that are enough; None follows only.
    """

    def __init__(
        self,
        robot: RobotDescription,
        before: PeriodicRuns | None,
        payload_request: PayloadRequest,
        goal_kg: float | None,
    ) -> None:
        self._robot, self._before = robot, before
        self._payload_request, self._goal_kg = payload_request, goal_kg
        self._said = ""
        self._average = AverageSoFar(robot)

    def enough(self, new: NewPeriods) -> bool:
        """Estimate from the periods so far."""
        try:
            runs = self._runs(self._average.with_more(new))
            estimate = identify_payload(self._robot, runs, self._payload_request.how)
        except (DataQualityError, EstimationError) as error:
            self._said = str(error)
            return False
        two_sigma = 2.0 * float(estimate.sigma[0])
        self._said = f"{new.periods} periods: {estimate.reported[0]:.3f} ± {two_sigma:.2g} kg"
        return self._goal_kg is not None and two_sigma <= self._goal_kg

    def sentences(self) -> list[str]:
        """Say for the report what the mass was."""
        return [self._said] if self._said else []

    def line(self) -> str:
        """Say what the mass is so far."""
        return self._said

    def _runs(self, average: PeriodAverage) -> MeasuredRuns:
        if self._before is None:
            payload_request = self._payload_request
            return PeriodicRuns(
                (average,), (True,), payload_request.band_hz, payload_request.standstill_rad_s
            )
        return replace(
            self._before,
            averages=(*self._before.averages, average),
            loaded=(*self._before.loaded, True),
        )
