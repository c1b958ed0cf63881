"""Watches during a payload session: warm-up of the joints, and accuracy of the mass."""

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

WarmUpReport = Callable[[Sequence[str], Sequence[Sequence[float]], float], None]


class WarmUpWatch:
    """Watch of a warm-up: ends the warm-up when the mean power per period has settled.

    The mean mechanical power of a joint over a period is its friction power, plus the power that it
    exchanges with the other joints. The latter is the same in every period, so changes are those of
    friction, which falls as a motor warms up.

    Args:
        drift_percent: Friction has settled if no joint's power changes by more than this per
            period.
        report: Function that gets the names of the joints, the power of the new periods (one row
            each) [W], and `drift_percent`.
    """

    def __init__(self, drift_percent: float, report: WarmUpReport | None = None) -> None:
        self._limit = drift_percent
        self._report = report
        self._power: list[FloatArray] = []
        self.drift_percent: float | None = None
        self.periods = 0
        self.worst = ""

    @property
    def settled(self) -> bool:
        """True if no joint's friction power changes by more than the limit per period."""
        return self.drift_percent is not None and self.drift_percent <= self._limit

    @property
    def fact(self) -> dict[str, JsonValue]:
        """Result of the warm-up, as the session's file stores it."""
        return {
            "drift_percent": self.drift_percent,
            "periods": self.periods,
            "verdict": "settled" if self.settled else "NOT settled",
            "settled_percent": self._limit,
        }

    def add_periods(self, new: NewPeriods) -> bool:
        """Add periods; return True if friction has settled."""
        more = period_powers(new.recording, new.first_row)
        self._power.extend(more)
        if self._report is not None and len(more):
            self._report(new.recording.joint_names, more.tolist(), self._limit)
        power = np.array(self._power)
        if len(power) < FEWEST_PERIODS:
            return False
        change = np.abs(power_change_percent(power))
        worst = int(np.argmax(change))
        self.drift_percent, self.periods = float(change[worst]), len(power)
        self.worst = new.recording.joint_names[worst]
        return self.settled

    def sentences(self) -> list[str]:
        """Return a sentence on the last change of the friction power, for the report."""
        return [self.line()]

    def line(self) -> str:
        """Return a status line with the change of the friction power."""
        if self.drift_percent is None:
            return "warming up"
        return (
            f"friction of {self.worst} changes by {self.drift_percent:.2f} % per period (goal:"
            f" {self._limit:g} %)"
        )


def warm_up_findings(fact: JsonValue) -> list[str]:
    """Return a sentence on the warm-up for the report; empty if the session had none.

    Args:
        fact: `WarmUpWatch.fact` from the session's file.
    """
    if not isinstance(fact, dict):
        return []
    if fact["drift_percent"] is None:
        return ["Warm-up: too few periods to tell whether friction has settled."]
    return [
        f"Warm-up: {fact['verdict']} after {fact['periods']} periods; at its end friction changed"
        f" by {fact['drift_percent']:.2f} % per period."
    ]


class MassWatch:
    """Watch of a run with the payload: ends it when the payload's mass is accurate enough.

    If the robot's model contains effects that mean periods do not show, the mass cannot be
    followed; the watch then reports this and never ends the run.

    Args:
        before: Runs recorded before this one.
        payload_request: Options of the payload estimate.
        goal_kg: Goal for 2 sigma of the mass; None never ends the run.
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
        self._time_domain_effects = payload_request.time_domain_effects
        self._sentence = ""
        if self._time_domain_effects:
            self._sentence = (
                "The mass was not estimated while the robot moved: the model contains"
                f" {self._time_domain_effects}, which is applied only to a complete run"
            )
        self._average = AverageSoFar(robot)

    def add_periods(self, new: NewPeriods) -> bool:
        """Add periods and estimate the mass; return True if the goal is reached."""
        if self._time_domain_effects:
            return False
        try:
            runs = self._runs_with(self._average.with_new_periods(new))
            estimate = identify_payload(self._robot, runs, self._payload_request.how)
        except (DataQualityError, EstimationError) as error:
            self._sentence = str(error)
            return False
        two_sigma = 2.0 * float(estimate.sigma[0])
        mass, reach = format_measured(float(estimate.reported[0]), two_sigma)
        self._sentence = f"{new.periods} periods: {mass} ± {reach} kg"
        return self._goal_kg is not None and two_sigma <= self._goal_kg

    def sentences(self) -> list[str]:
        """Return a sentence on the last estimate of the mass, for the report."""
        return [self._sentence] if self._sentence else []

    def line(self) -> str:
        """Return a status line with the present estimate of the mass."""
        return "mass not estimated during the run" if self._time_domain_effects else self._sentence

    def _runs_with(self, average: PeriodAverage) -> PeriodicRuns:
        new = periodic_runs((average,), (True,), self._payload_request)
        if self._before is None:
            return new
        return replace(
            self._before,
            sources=(*self._before.sources, *new.sources),
            loaded=(*self._before.loaded, *new.loaded),
        )
