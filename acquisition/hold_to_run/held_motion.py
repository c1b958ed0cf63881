"""`HeldMotion`: set-points along a line while a key is held; at rest as soon as it is not."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.hold_to_run.dead_man import DEAD_MAN_S, DeadMan
from acquisition.hold_to_run.line import FASTEST_SHARE
from acquisition.motion.approach import APPROACH_SPEED_FRACTION
from acquisition.motion.samples import Phase
from acquisition.supervision.cycle import SetPoint
from acquisition.supervision.stop_reason import StopReason
from config.arrays import FloatArray
from config.process.safety_clock import safety_now_s
from config.robot.robot import RobotDescription

IDLE_S: Final = 60.0
LONGEST_S: Final = 600.0


class HeldMotion:
    """A `SetPointSource` that obeys a dead-man, asked in every cycle.

    The cycle in which the key is held no more is the first that slows down, with the acceleration
    of an approach. A press that was over, or let go, begins nothing again. On a simulated cell in
    lock-step the motion keeps the pace of the clock, since a person holds the key.

    Args:
        robot: Limits.
        cycle_time_s: The cell's cycle [s].
        dead_man: Says what is held.
        once: Whether the motion is over with the first press; else with `DeadMan.finish`, or once
            nothing was held for `IDLE_S`.
        unattended: Whether each press counts as held to its end: for simulated cells, where no
            person is.
        now_s: The clock that keys are held by [s].
    """

    def __init__(
        self,
        robot: RobotDescription,
        cycle_time_s: float,
        dead_man: DeadMan,
        *,
        once: bool = False,
        unattended: bool = False,
        now_s: Callable[[], float] = safety_now_s,
    ) -> None:
        limits = [joint.limits for joint in robot.joints]
        self._dead_man = dead_man
        self._once = once
        self._unattended = unattended
        self._now_s = now_s
        self._step_s = cycle_time_s
        self._speed = FASTEST_SHARE * np.array([each.velocity for each in limits])
        self._low = np.array([each.position_min for each in limits])
        self._high = np.array([each.position_max for each in limits])
        self._slope = APPROACH_SPEED_FRACTION * np.array([each.acceleration for each in limits])
        self._row = -1
        self._idle_rows = 0
        self._press = 0  # the latest that was begun or is over
        self._share = self._rate = 0.0  # of the line: driven, and driven in a second
        self._pace = self._change = 0.0  # what that may be, and by how much it may change a cycle
        self._paced_s: float | None = None

    samples_per_period: int | None = None
    period_ends: Mapping[int, int] = {}
    stop: StopReason | None = None

    @property
    def rows_expected(self) -> int:
        """As many as an unusually long motion has."""
        return round(LONGEST_S / self._step_s)

    @property
    def notes(self) -> Sequence[str]:
        """That nobody held a key, where that was the end."""
        if not self._idle_too_long:
            return ()
        return (f"no key was held for {IDLE_S:g} s: the power was taken away",)

    def prepare(self) -> None:
        """Do nothing."""

    def begin(self, lockstep: bool, position: FloatArray) -> FloatArray:
        """Begin where the robot stands."""
        self._paced_s = self._now_s() if lockstep and not self._unattended else None
        self._start = self._pose = np.array(position)
        self._way = np.zeros(len(self._pose))
        return self._pose

    def watch(self, position: FloatArray, counts: NDArray[np.int32]) -> None:
        """Do nothing: the pose that was begun at counts."""

    def at(self, row: int) -> SetPoint | None:
        """Return the set-point of a cycle; None once the robot rests for good."""
        if self._paced_s is not None:
            self._keep_pace()
        for _ in range(row - self._row):
            self._go_on()
        self._row = row
        if self._rate == 0.0:
            if self._over and self._idle_rows > 0:  # the pose at rest was shown
                return None
            self._idle_rows += 1
            self._dead_man.rest(self._pose, self._press)
        else:
            self._idle_rows = 0
        velocity = (self._rate * self._way).tolist()
        return SetPoint(self._pose.tolist(), velocity, velocity, row, Phase.MAIN)

    @property
    def _over(self) -> bool:
        done = self._once and self._press > 0
        return done or self._dead_man.finishing or self._idle_too_long

    @property
    def _idle_too_long(self) -> bool:
        return self._idle_rows * self._step_s > IDLE_S

    def _held(self) -> bool:
        """Return whether a key is held now; one that says so for longer than it may is not."""
        if self._unattended:
            return True
        left_s = self._dead_man.held_until_s - self._now_s()
        return 0.0 < left_s < DEAD_MAN_S + self._step_s

    def _go_on(self) -> None:
        """Move on by a cycle."""
        held = self._held() and not self._dead_man.finishing
        if self._rate == 0.0:
            number = self._dead_man.number
            if number == self._press:
                return
            self._press = number
            if not held or not self._take_line():
                return
        elif not held:
            self._pace = 0.0
        self._pose = self._next_pose()

    def _take_line(self) -> bool:
        """Take the line of a new press; return whether it leads anywhere."""
        goal, pace = self._dead_man.ordered(len(self._pose))
        inside = (goal >= self._low) & (goal <= self._high) | (goal == self._pose)
        if not (inside.all() and math.isfinite(pace) and pace > 0.0):
            return False  # nobody orders that; what is no number leads nowhere
        self._start, self._way = self._pose, goal - self._pose
        self._share = 0.0
        moving = self._way != 0.0
        if not moving.any():
            return False
        size = np.abs(self._way[moving])
        self._pace = min(pace, float((self._speed[moving] / size).min()))
        self._change = float((self._slope[moving] / size).min()) * self._step_s
        return True

    def _next_pose(self) -> FloatArray:
        """Return the pose a cycle later: faster, as fast as is allowed, or slower to the end."""
        step_s, change, before = self._step_s, self._change, self._rate
        left = 1.0 - self._share
        if left <= change * step_s and before <= change:  # the rest of the way is one cycle's
            self._share, self._rate = 1.0, 0.0
            return self._start + self._way
        # so fast that after this cycle the rest of the way is enough to slow down on
        room = max(0.0, left - 0.5 * before * step_s)
        braking = -0.5 * change + math.sqrt(0.25 * change**2 + 2.0 * change / step_s * room)
        most = min(self._pace, braking)
        rate = min(before + change, most) if before < most else max(before - change, most)
        if rate <= 0.0:
            rate = 0.0
        self._share = min(1.0, self._share + 0.5 * (before + rate) * step_s)
        self._rate = rate
        return self._start + self._share * self._way

    def _keep_pace(self) -> None:
        """Let simulated time stand still until the clock has come as far."""
        assert self._paced_s is not None
        self._paced_s += self._step_s
        wait_s = self._paced_s - self._now_s()
        if wait_s > 0.0:
            time.sleep(wait_s)
        else:
            self._paced_s -= wait_s  # what the computer was late by is not made up for
