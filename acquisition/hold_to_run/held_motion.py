"""`HeldMotion`: set-points along a line while a key is held; a release stops the robot."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np

from acquisition.hold_to_run.dead_man import DEAD_MAN_S, DeadMan
from acquisition.hold_to_run.line import FASTEST_SHARE
from acquisition.motion.approach import APPROACH_SPEED_FRACTION
from acquisition.motion.samples import Phase
from acquisition.supervision.cycle import SetPoint
from acquisition.supervision.stop_reason import StopReason
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.process.safety_clock import safety_now_s
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import convert_to_motors
from drivers.interfaces.servo_axes import Answers
from drivers.servo.stop_ramp import quick_stop_decelerations

IDLE_S: Final = 60.0
LONGEST_S: Final = 600.0
STOP_SHARE: Final = 0.8
"""Largest deceleration of a line, as a fraction of that of a quick stop. A quick stop on the line
therefore ends before the line's goal."""


class HeldMotion:
    """Source of set-points that reads a dead-man in every cycle.

    The robot slows down from the first cycle in which the key is no longer held, with the
    acceleration of an approach, but more slowly than in a quick stop. A press that has ended or
    whose key was released does not move the robot again. On a simulated cell in lock-step, the
    motion runs in real time if a person holds the key (not `unattended`).

    Args:
        cell, robot: Cycle time, decelerations of a quick stop, joint limits.
        dead_man: Shared memory with the held key.
        once: True to end the motion with the first press. Otherwise the motion ends with
            `DeadMan.finish`, or after `IDLE_S` without a held key.
        unattended: True if the key counts as held until the end of each line: for simulated cells
            without a person.
        now_s: Clock of the held keys [s].
    """

    def __init__(
        self,
        cell: CellConfig,
        robot: RobotDescription,
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
        self._step_s = cell.cycle_time_s
        self._robot = robot
        self._speed = FASTEST_SHARE * np.array([each.velocity for each in limits])
        self._low = np.array([each.position_min for each in limits])
        self._high = np.array([each.position_max for each in limits])
        self._slope = APPROACH_SPEED_FRACTION * np.array([each.acceleration for each in limits])
        self._stop_slope = STOP_SHARE * np.array(quick_stop_decelerations(cell, robot))
        self._row = -1
        self._idle_rows = 0
        self._press = 0  # number of the key press that began the latest line
        self._share = self._rate = 0.0  # completed fraction of the line, and its derivative [1/s]
        self._pace = self._change = 0.0  # largest `_rate`, and its largest change per cycle
        self._paced_s: float | None = None

    samples_per_period: int | None = None
    period_ends: Mapping[int, int] = {}
    stop: StopReason | None = None

    @property
    def rows_expected(self) -> int:
        """Largest expected number of rows, to check the disk space."""
        return round(LONGEST_S / self._step_s)

    @property
    def notes(self) -> Sequence[str]:
        """One note if the motion ended because no key was held for `IDLE_S`; otherwise empty."""
        if not self._idle_too_long:
            return ()
        return (f"nothing was held for {IDLE_S:g} s: the drives were disabled",)

    def prepare(self) -> None:
        """Do nothing."""

    def refuse_begin(self, answers: Answers) -> None:
        """Do nothing: the motion may always begin."""

    def begin(self, lockstep: bool, position: FloatArray) -> FloatArray:
        """Begin the motion at the robot's present position."""
        self._paced_s = self._now_s() if lockstep and not self._unattended else None
        self._start = self._pose = np.array(position)
        self._way = np.zeros(len(self._pose))
        return self._pose

    def watch(self, answers: Answers) -> None:
        """Do nothing: the set-points start from the pose passed to `begin`."""

    def at(self, row: int) -> SetPoint | None:
        """Return the set-point of a cycle; None if the robot is at rest and the motion is over."""
        if self._paced_s is not None:
            self._wait_for_real_time()
        for _ in range(row - self._row):
            self._advance()
        self._row = row
        if self._rate == 0.0:
            if self._over and self._idle_rows > 0:  # a set-point at rest was sent
                return None
            self._idle_rows += 1
            self._dead_man.report_rest(self._pose, self._press)
        else:
            self._idle_rows = 0
        velocity = (self._rate * self._way).tolist()
        return SetPoint(self._pose.tolist(), velocity, velocity, row, Phase.MAIN)

    @property
    def _over(self) -> bool:
        done = self._once and self._press > 0
        return done or self._dead_man.is_finishing or self._idle_too_long

    @property
    def _idle_too_long(self) -> bool:
        return self._idle_rows * self._step_s > IDLE_S

    def _held(self) -> bool:
        """Return True if a key is held now; an end time too far in the future is invalid."""
        if self._unattended:
            return True
        left_s = self._dead_man.held_until_s - self._now_s()
        return 0.0 < left_s < DEAD_MAN_S + self._step_s

    def _advance(self) -> None:
        """Advance the motion by one cycle."""
        held = self._held() and not self._dead_man.is_finishing
        if self._rate == 0.0:
            number = self._dead_man.press_count
            if number == self._press:
                return
            self._press = number
            if not held or not self._begin_line():
                return
        elif not held:
            self._pace = 0.0
        self._pose = self._next_pose()

    def _begin_line(self) -> bool:
        """Begin the line of a new press; return False if the line is invalid or empty."""
        goal, pace = self._dead_man.latest_line(len(self._pose))
        inside = (goal >= self._low) & (goal <= self._high) | (goal == self._pose)
        if not (inside.all() and math.isfinite(pace) and pace > 0.0):
            return False  # the goal is outside the limits, or the pace is invalid
        self._start, self._way = self._pose, goal - self._pose
        self._share = 0.0
        moving = self._way != 0.0
        if not moving.any():
            return False
        size = np.abs(self._way[moving])
        self._pace = min(pace, float((self._speed[moving] / size).min()))
        slope = float((self._slope[moving] / size).min())
        motors = np.abs(convert_to_motors(self._robot, self._way))
        turning = motors > 0.0
        stop_slope = float((self._stop_slope[turning] / motors[turning]).min())
        self._change = min(slope, stop_slope) * self._step_s
        return True

    def _next_pose(self) -> FloatArray:
        """Return the pose of the next cycle: accelerated, at the permitted pace, or braking."""
        step_s, change, before = self._step_s, self._change, self._rate
        left = 1.0 - self._share
        # The rest of the line fits in one cycle.
        if left <= change * step_s and before <= change:
            self._share, self._rate = 1.0, 0.0
            return self._start + self._way
        # Largest rate from which the robot can stop on the rest of the line.
        room = max(0.0, left - 0.5 * before * step_s)
        braking = -0.5 * change + math.sqrt(0.25 * change**2 + 2.0 * change / step_s * room)
        most = min(self._pace, braking)
        rate = min(before + change, most) if before < most else max(before - change, most)
        if rate <= 0.0:
            rate = 0.0
        self._share = min(1.0, self._share + 0.5 * (before + rate) * step_s)
        self._rate = rate
        return self._start + self._share * self._way

    def _wait_for_real_time(self) -> None:
        """Delay simulated time until real time has caught up."""
        assert self._paced_s is not None
        self._paced_s += self._step_s
        wait_s = self._paced_s - self._now_s()
        if wait_s > 0.0:
            time.sleep(wait_s)
        else:
            self._paced_s -= wait_s  # after a delay, simulated time does not run faster to catch up
