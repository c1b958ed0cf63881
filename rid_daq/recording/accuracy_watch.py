"""`AccuracyWatch`: estimates while a motion runs, and says when the wanted accuracy is reached."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.journal.monitor import monitored, with_temperature_compensation
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
    """Follows the periods of a recording with a running estimate, and holds them against goals.

    Goals are judged on the averaged periods, as `rid-daq identify` estimates from them.

    Args:
        goals: As `--until` takes them; none to follow only.
        samples: The motion.

    Attributes:
        goals, states: The goals, and how far each was at the last look.
        periods: Periods at the last look at the goals.
        running: The running estimate at the last look.
        trouble: Why there was nothing to see.

    Raises:
        ConfigError: A goal is invalid, or the motion is not periodic.
    """

    def __init__(
        self, goals: Sequence[str], robot: RobotDescription, samples: MotionSamples
    ) -> None:
        if samples.samples_per_period is None:
            raise ConfigError(
                "--until needs a periodic motion: its periods are what is averaged",
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
            None if model.transmission.losses else RunningEstimate.begin(model, STANDSTILL_RAD_S)
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
        """Whether every goal is reached; there is nothing to reach without goals."""
        return len(self.states) == len(self.goals) and all(state.reached for state in self.states)

    def enough(self, new: NewPeriods) -> bool:
        """Look at the periods so far; return whether there are goals and all are reached.

        What cannot be estimated yet is not enough; the reason is kept in `trouble`.
        """
        try:
            self._follow(new)
            if not self.goals:
                return False
            estimate = fit_periodic(self._robot, [self._average.with_more(new)]).estimate()
        except (DataQualityError, EstimationError) as error:
            self.trouble = str(error)
            return False
        self.states = goal_states(self.goals, estimate, self._motion)
        self.periods = new.periods
        return self.reached

    def line(self) -> str:
        """Say in a few words how far it is."""
        if self.states:
            left = [state for state in self.states if not state.reached]
            return left[0].sentence(self.periods) if left else "accuracy reached"
        return self.running_sentence()

    def running_sentence(self) -> str:
        """Say what the model leaves of single periods so far; empty before that is known."""
        if self.running is None:
            return ""
        shares = ", ".join(f"{share:.1f}" for share in self.running.relative_percent)
        return f"residual of {self._followed} single periods {shares} % of the torque (RMS)"

    def sentences(self) -> list[str]:
        """Say how far each goal is."""
        if not self.states:
            reason = f": {self.trouble}" if self.trouble else ": too few periods"
            return [f"{goal.text}: not judged{reason}" for goal in self.goals]
        return [state.sentence(self.periods) for state in self.states]

    def _follow(self, new: NewPeriods) -> None:
        """Add the new periods that miss no row to the running estimate."""
        if self._estimate is None:
            return
        monitor, _ = monitored(new.recording, new.folder)
        recording = with_temperature_compensation(new.recording, monitor, self._robot)
        for signals in single_periods(recording, BAND_HZ, new.first_row).values():
            run = TimeRun(signals, Conditions(temperature_k=signals.temperature_k))
            self._estimate = self._estimate.add(run)
            self._followed += 1
        self.running = self._estimate.look()
