"""`AccuracyWatch`: running estimate during a motion.

It ends the motion when the accuracy is reached.
"""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.journal.monitor import read_run_temperatures, with_temperature_compensation
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.session.early_stop import NewPeriods
from config.arrays import FloatArray
from config.errors import ConfigError, DataQualityError, EstimationError
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from dynamics.terms.conditions import Conditions
from identification.accuracy.goals import Goal, GoalState, goal_states, parse_goals
from identification.choices import BAND_HZ, STANDSTILL_RAD_S
from identification.equations.segments import single_periods
from identification.equations.time_domain import TimeRun
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.running import RunningEstimate, RunningValues
from identification.model.base_parameters import base_parameters
from rid_daq.recording.average_so_far import AverageSoFar


class AccuracyWatch:
    """Watch of a periodic recording: running estimate, and comparison with accuracy goals.

    Goals are compared with the estimate from averaged periods, as `rid-daq identify` computes it.

    Args:
        goals: Goals in the syntax of `--until`; empty for the running estimate only.
        robot: Robot that moves.
        samples: The planned motion.

    Attributes:
        goals: The goals.
        states: Last state of each goal.
        periods: Number of periods at the last comparison with the goals.
        running: Last running estimate.
        trouble: Reason why the last estimate was not possible; empty if none failed.

    Raises:
        ConfigError: A goal is invalid, or the motion is not periodic.
    """

    def __init__(
        self, goals: Sequence[str], robot: RobotDescription, samples: MotionSamples
    ) -> None:
        if samples.samples_per_period is None:
            raise ConfigError(
                "--until needs a periodic motion, because the periods are averaged",
                code="RID-RECORDING-NOT-PERIODIC",
            )
        model = RobotModel.from_description(robot)
        self.goals: tuple[Goal, ...] = parse_goals(goals, model, base_parameters(model))
        self.states: tuple[GoalState, ...] = ()
        self.periods = 0
        self.running: RunningValues | None = None
        self.trouble = ""
        self._robot = robot
        self._estimate = (
            None if model.transmission.losses else RunningEstimate.empty(model, STANDSTILL_RAD_S)
        )
        self._followed = 0
        self._average = AverageSoFar(robot)
        main = samples.phase == Phase.MAIN
        period = slice(0, samples.samples_per_period)
        self._motion: tuple[FloatArray, FloatArray, FloatArray] = (
            samples.position[main][period],
            samples.velocity[main][period],
            samples.acceleration[main][period],
        )

    @property
    def reached(self) -> bool:
        """True if every goal is reached; also True without goals."""
        return len(self.states) == len(self.goals) and all(state.reached for state in self.states)

    def add_periods(self, new: NewPeriods) -> bool:
        """Add periods; return True if there are goals and all are reached.

        If no estimate is possible yet, return False and store the reason in `trouble`.
        """
        try:
            self._follow(new)
            if not self.goals:
                return False
            estimate = fit_periodic(self._robot, [self._average.with_new_periods(new)]).estimate()
        except (DataQualityError, EstimationError) as error:
            self.trouble = str(error)
            return False
        self.states = goal_states(self.goals, estimate, self._motion)
        self.periods = new.periods
        return self.reached

    def line(self) -> str:
        """Return a status line: the first goal that is not reached, or the running estimate."""
        if self.states:
            left = [state for state in self.states if not state.reached]
            return left[0].sentence(self.periods) if left else "accuracy reached"
        return self.running_sentence()

    def running_sentence(self) -> str:
        """Return a phrase with the residual of each joint; empty before an estimate exists."""
        if self.running is None:
            return ""
        percent = ", ".join(f"{value:.1f}" for value in self.running.relative_percent)
        return f"residual of {self._followed} single periods {percent} % of the torque (RMS)"

    def sentences(self) -> list[str]:
        """Return a sentence on each goal."""
        if not self.states:
            reason = f": {self.trouble}" if self.trouble else ": too few periods"
            return [f"{goal.text}: not estimated{reason}" for goal in self.goals]
        return [state.sentence(self.periods) for state in self.states]

    def _follow(self, new: NewPeriods) -> None:
        """Add the new periods without missing rows to the running estimate."""
        if self._estimate is None:
            return
        monitor, _ = read_run_temperatures(new.recording, new.folder)
        recording = with_temperature_compensation(new.recording, monitor, self._robot)
        for signals in single_periods(recording, BAND_HZ, new.first_row).values():
            run = TimeRun(signals, Conditions(temperature_k=signals.temperature_k))
            self._estimate = self._estimate.add(run)
            self._followed += 1
        self.running = self._estimate.current_values()
