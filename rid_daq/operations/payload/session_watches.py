"""What is looked at while a payload session moves: whether it is warm, how sure the mass is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from pydantic import JsonValue

from acquisition.processing.periods import PeriodAverage
from acquisition.session.early_stop import NewPeriods
from config.arrays import FloatArray
from config.errors import DataQualityError, EstimationError
from config.robot.robot import RobotDescription
from identification.payload.periodic_runs import PeriodicRuns
from identification.payload.procedures import identify_payload
from identification.payload.warm_up import FEWEST_PERIODS, period_powers, power_change_percent
from rid_daq.blocks.formats import format_measured
from rid_daq.operations.payload.payload_estimate import PayloadRequest, periodic_runs
from rid_daq.recording.average_so_far import AverageSoFar

WarmUpTold = Callable[[Sequence[str], Sequence[Sequence[float]], float], None]


class WarmUpWatch:
    """Tells whether friction has settled: what the motors burn in one period after the other.

    Over a period that begins and ends alike, the mechanical power of a joint is what its friction
    takes, and that falls as a motor warms up.

    Args:
        drift_percent: Settled where no joint's power changes by more in a period.
        told: Told the joints' names, the power of more periods, one row each [W], and
            `drift_percent`.
    """

    def __init__(self, drift_percent: float, told: WarmUpTold | None = None) -> None:
        self._limit = drift_percent
        self._told = told
        self._power: list[FloatArray] = []
        self.drift_percent: float | None = None
        self.periods = 0
        self.worst = ""

    @property
    def settled(self) -> bool:
        """Whether the last periods agree."""
        return self.drift_percent is not None and self.drift_percent <= self._limit

    @property
    def fact(self) -> dict[str, JsonValue]:
        """How far the warm-up came, as the session's file keeps it."""
        return {
            "drift_percent": self.drift_percent,
            "periods": self.periods,
            "verdict": "settled" if self.settled else "NOT settled",
            "settled_percent": self._limit,
        }

    def enough(self, new: NewPeriods) -> bool:
        """Look at the periods so far."""
        more = period_powers(new.recording, new.first_row)
        self._power.extend(more)
        if self._told is not None and len(more):
            self._told(new.recording.joint_names, more.tolist(), self._limit)
        power = np.array(self._power)
        if len(power) < FEWEST_PERIODS:
            return False
        change = np.abs(power_change_percent(power))
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


class MassWatch:
    """Tells whether the mass of the payload is sure enough.

    By a model that says what no mean period shows the mass is not followed: the watch says so,
    and ends nothing.

    Args:
        before: The runs recorded until now.
        payload_request: How it will be estimated.
        goal_kg: 2 sigma that are enough; None follows only.
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
        self._only_in_time = payload_request.only_in_time
        self._said = ""
        if self._only_in_time:
            self._said = (
                "The mass was not followed while the robot moved: the model says"
                f" {self._only_in_time}, which is made up for once a run is complete"
            )
        self._average = AverageSoFar(robot)

    def enough(self, new: NewPeriods) -> bool:
        """Estimate from the periods so far."""
        if self._only_in_time:
            return False
        try:
            runs = self._runs(self._average.with_more(new))
            estimate = identify_payload(self._robot, runs, self._payload_request.how)
        except (DataQualityError, EstimationError) as error:
            self._said = str(error)
            return False
        two_sigma = 2.0 * float(estimate.sigma[0])
        mass, reach = format_measured(float(estimate.reported[0]), two_sigma)
        self._said = f"{new.periods} periods: {mass} ± {reach} kg"
        return self._goal_kg is not None and two_sigma <= self._goal_kg

    def sentences(self) -> list[str]:
        """Say for the report what the mass was."""
        return [self._said] if self._said else []

    def line(self) -> str:
        """Say what the mass is so far."""
        return "mass not followed" if self._only_in_time else self._said

    def _runs(self, average: PeriodAverage) -> PeriodicRuns:
        new = periodic_runs((average,), (True,), self._payload_request)
        if self._before is None:
            return new
        return replace(
            self._before,
            sources=(*self._before.sources, *new.sources),
            loaded=(*self._before.loaded, *new.loaded),
        )
