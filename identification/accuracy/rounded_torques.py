"""`RoundedTorques`: effect of torques with few digits on an estimate.

The rounding errors of a torque with few levels are correlated with the torque and constant for many
rows, so that they are no noise that an estimate averages. Their effect is found as for positions
(`rounded_positions`): by rounding the torques once more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.recording.recording import Recording
from config.arrays import BoolArray, FloatArray
from config.robot.robot import RobotDescription
from identification.accuracy.rounded_positions import (
    ROUNDINGS,
    WIDER,
    further_errors,
    widening_sentences,
    with_rounding,
)
from identification.estimation.estimate import Estimate

MOST_STEPS: Final = 100
"""Largest number of steps in a torque's range for which an effect is computed."""
FEWEST_STEPS: Final = 10.0
"""Smallest range of a torque for which rounding once more has about the same effect as the first
rounding [steps]."""
EQUAL: Final = 1e-6
"""Torques are equal if they differ by less than this fraction of their range."""
MULTIPLE: Final = 0.05
"""Largest distance of a level from a multiple of the step [steps]."""


@dataclass(frozen=True, eq=False)
class RoundedTorques:
    """Rounding steps of the torques of some recordings.

    Attributes:
        robot: The robot.
        steps: Shape (recordings, n). Rounding step of each joint's torque [N m or N]; 0 without a
            step that has an effect.
        is_coarse: Shape (recordings, n). True for a torque of so few steps that its effect is not
            known.
        band_hz: Upper limit of the band [Hz].
        widening: Largest factor by which an interval became wider because of the rounding.
    """

    robot: RobotDescription
    steps: FloatArray
    is_coarse: BoolArray
    band_hz: float
    widening: float = 1.0

    @classmethod
    def of(
        cls, robot: RobotDescription, recordings: Sequence[Recording], band_hz: float
    ) -> RoundedTorques | None:
        """Return the rounding of some recordings; None if no step is large enough for an effect."""
        steps = np.array([torque_steps(each) for each in recordings])
        if not steps.any():
            return None
        ranges = np.array([np.ptp(each.torque_nm[each.valid], axis=0) for each in recordings])
        return cls(robot, steps, ranges < (FEWEST_STEPS - 0.5) * steps, band_hz)

    @property
    def is_material(self) -> bool:
        """True if an interval became much wider, or if the effect is not known."""
        return self.widening >= WIDER or bool(self.is_coarse.any())

    @property
    def sentence(self) -> str:
        """The finding in words."""
        sizes = ", ".join(
            f"{joint.name} {step:.2g} {joint.torque_unit}"
            for joint, step in zip(self.robot.joints, self.steps.max(axis=0), strict=True)
            if step > 0.0
        )
        found = [
            f"The recorded torques have few digits (steps: {sizes}), which changes the parameters."
        ]
        found += widening_sentences(self.widening)
        if self.is_coarse.any():
            names = np.array(self.robot.joint_names)[self.is_coarse.any(axis=0)]
            found.append(
                f"The torque of {', '.join(names)} has so few steps that the intervals can be too"
                " narrow."
            )
        return " ".join([*found, "Record torques with more digits."])

    def widen(
        self,
        estimate: Estimate,
        recordings: Sequence[Recording],
        estimate_again: Callable[[Sequence[Recording]], Estimate],
    ) -> tuple[Estimate, RoundedTorques]:
        """Return an estimate whose intervals contain the effect, and the rounding with `widening`.

        Args:
            estimate: The estimate from the recordings.
            recordings: The recordings.
            estimate_again: Function that repeats the estimate for other recordings.
        """
        others = [
            estimate_again(
                [
                    self._round_again(each, own, random)
                    for each, own in zip(recordings, self.steps, strict=True)
                ]
            )
            for random in map(np.random.default_rng, range(ROUNDINGS))
        ]
        wider, widening = with_rounding(estimate, others)
        return wider, replace(self, widening=widening)

    def _round_again(
        self, recording: Recording, steps: FloatArray, random: np.random.Generator
    ) -> Recording:
        errors = further_errors(recording.torque_nm, recording, steps, self.band_hz, random)
        return replace(recording, torque_nm=recording.torque_nm + errors)


def torque_steps(recording: Recording) -> FloatArray:
    """Return the rounding step of each joint's torque, (n,) [N m or N].

    It is 0 for a torque that is constant, that has more than `MOST_STEPS` steps in its range, or
    whose levels are no multiples of a step.
    """
    steps = np.zeros(len(recording.joint_names))
    for j, torque in enumerate(recording.torque_nm[recording.valid].T):
        levels = np.unique(torque)
        if not len(levels):
            continue
        levels = levels[np.diff(levels, prepend=-np.inf) > EQUAL * (levels[-1] - levels[0])]
        if 1 < len(levels) <= MOST_STEPS + 1:
            step = float(np.diff(levels).min())
            away = (levels - levels[0]) / step
            steps[j] = step if np.all(np.abs(away - np.round(away)) < MULTIPLE) else 0.0
    return steps
