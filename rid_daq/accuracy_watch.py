"""`AccuracyWatch`: identifies while a motion runs, until the wanted accuracy is reached."""

from __future__ import annotations

from pathlib import Path

from acquisition.arrays import FloatArray
from acquisition.journal import read_journal
from acquisition.motion_samples import MotionSamples, Phase
from acquisition.periods import average_periods
from config.errors import ConfigError, DataQualityError, EstimationError
from config.robot import RobotDescription
from dynamics.robot_model import RobotModel
from identification.base_parameters import base_parameters
from identification.estimators import estimate_periodic
from identification.goals import Goal, GoalState, goal_states, parse_goals


class AccuracyWatch:
    """Judges the periods of a recording by the accuracy that they give.

    Parameters
    ----------
    goals : sequence of str
        As `--until` takes them.
    robot : RobotDescription
        The robot.
    samples : MotionSamples
        The motion.

    Raises
    ------
    ConfigError
        A goal cannot be meant, or the motion is not periodic.
    """

    def __init__(self, goals: list[str], robot: RobotDescription, samples: MotionSamples) -> None:
        if samples.samples_per_period is None:
            raise ConfigError("--until needs a periodic motion: its periods are what is averaged")
        model = RobotModel.from_description(robot)
        self.goals: tuple[Goal, ...] = parse_goals(goals, model, base_parameters(model))
        self.states: tuple[GoalState, ...] = ()
        self.periods = 0
        self.trouble = ""
        self._robot = robot
        main = samples.phase == Phase.MAIN
        period = slice(0, samples.samples_per_period)
        self._motion: tuple[FloatArray, FloatArray, FloatArray] = (
            samples.position[main][period],
            samples.velocity[main][period],
            samples.acceleration[main][period],
        )

    @property
    def reached(self) -> bool:
        """Whether every goal is reached."""
        return bool(self.states) and all(state.reached for state in self.states)

    def enough(self, journal: Path, periods: int) -> bool:
        """Identify from the periods so far; return whether all goals are reached.

        What cannot be identified yet is not enough; the reason is kept in `trouble`.
        """
        try:
            average = average_periods(read_journal(journal).recording())
            estimate = estimate_periodic(self._robot, [average])
        except (DataQualityError, EstimationError) as error:
            self.trouble = str(error)
            return False
        self.states = goal_states(self.goals, estimate, self._motion)
        self.periods = periods
        return self.reached

    def sentences(self) -> list[str]:
        """Say how far each goal is."""
        if not self.states:
            reason = f": {self.trouble}" if self.trouble else ": too few periods"
            return [f"{goal.text}: not judged{reason}" for goal in self.goals]
        return [state.sentence(self.periods) for state in self.states]
