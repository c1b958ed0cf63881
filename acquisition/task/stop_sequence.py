"""`StopSequence`: a quick stop, a look at whether the axes come to rest, and the power off.

An axis that does not slow down as it must, or runs beyond its limit, is not waited for: power off
is next, with its brake.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from acquisition.motion.limits import position_bounds
from acquisition.task.task_words import TaskWords
from config.cell.cell import CellConfig
from config.errors import DriverError, SafetyStop
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from drivers.interfaces.servo_axes import ServoAxes
from drivers.ports.clock import Clock
from drivers.servo.stop_ramp import longest_ramp_s, quick_stop_decelerations

STOP_MARGIN_S = 0.5
REST_VELOCITY = 0.01
REST_CYCLES = 5
LOOK_S = 0.02
OBEY_S = 0.045
LEAST_SHARE = 0.5
SLACK = 0.1


class StopSequence:
    """How a motion ends. A bus that fails meanwhile is noted, not raised.

    Its patience is what the ramp takes from top speed, as the preflight has allowed it
    (`drivers.servo.stop_ramp.LONGEST_STOP_S` at most), and `STOP_MARGIN_S`. With a coupled wrist
    rest and limits are the joints', and each motor is judged by its own ramp: while all of them
    slow down, a joint may speed up.

    Args:
        axes: The drives.
        clock: The clock of their bus.
        cell, robot: Cycle time, decelerations of a quick stop, limits, coupling of the wrist.
        words: Takes the time to rest and the notes.
    """

    def __init__(
        self,
        axes: ServoAxes,
        clock: Clock,
        cell: CellConfig,
        robot: RobotDescription,
        words: TaskWords,
    ) -> None:
        self._axes = axes
        self._clock = clock
        self._words = words
        self._period_s = cell.cycle_time_s
        self._decelerations = quick_stop_decelerations(cell, robot)
        self._patience_s = longest_ramp_s(cell, robot) + STOP_MARGIN_S
        self._coupling = WristCoupling.of_robot(robot)
        self._low, self._high = position_bounds(cell, robot)

    def come_to_rest(self, cycle: Callable[[], tuple[float, int]]) -> None:
        """Quick stop, by set-point frames alone, and watch until everything rests.

        Args:
            cycle: Waits for the next cycle and does it, with a quick stop as its command; returns
                the time of its SYNC [s] and how many cycle times have passed since the last.
        """
        axes = self._axes
        before = axes.answers.position.tolist()
        began_s = time_s = self._clock.now_s()
        slowing = SlowingDown(self._decelerations, self._period_s, self._motors(), began_s)
        resting = 0
        try:
            axes.quick_stop()
            while time_s < began_s + self._patience_s:
                time_s, periods = cycle()
                received = axes.answers.received.tolist()
                position = axes.answers.position.tolist()
                most = REST_VELOCITY * self._period_s * periods
                rest = all(received) and all(
                    abs(now - then) <= most for now, then in zip(position, before, strict=True)
                )
                resting = resting + 1 if rest else 0
                if resting >= REST_CYCLES:
                    self._words.report_rest(time_s - (REST_CYCLES - 1) * self._period_s - began_s)
                    return
                beyond = self._beyond(before, position, most)
                before = position
                too_slow = slowing.too_slow(time_s, self._motors(), received)
                if why := self._why_at_once(beyond, too_slow):
                    self._words.add_note(f"{why}: the power was taken away at once")
                    return
        except (DriverError, SafetyStop) as error:
            self._words.add_note(f"while stopping: {error}")
            return
        self._words.add_note(
            f"standstill was not seen within {self._patience_s:.2g} s: the power was taken away"
        )

    def _motors(self) -> list[float]:
        """Return where the motors are, over their gear ratios [rad or m]."""
        position = self._axes.answers.position
        of_motors = position if self._coupling is None else self._coupling.to_motors(position)
        return list(of_motors.tolist())

    def _beyond(self, before: list[float], position: list[float], most: float) -> list[int]:
        """Return the axes that are outside their limits and still on their way out, by number."""
        moves = zip(before, position, self._low, self._high, strict=True)
        return [
            i
            for i, (then, now, low, high) in enumerate(moves)
            if (now > high and now - then > most) or (now < low and then - now > most)
        ]

    def _why_at_once(self, beyond: list[int], too_slow: list[int]) -> str:
        """Return why the ramp is not waited for; empty where it may go on."""
        names = self._axes.joint_names
        if beyond:
            return f"{', '.join(names[i] for i in beyond)} ran beyond its limit while stopping"
        if too_slow:
            return f"the quick stop did not slow down {', '.join(names[i] for i in too_slow)}"
        return ""

    def disable(self) -> None:
        """Take the power away, whether the axes rest or not."""
        try:
            unconfirmed = self._axes.disable()
        except DriverError as error:
            self._words.add_note(f"while disabling: {error}")
            return
        if unconfirmed:
            self._words.add_note(
                f"the drives of {', '.join(unconfirmed)} did not confirm being disabled: check them"
                " before going near the robot"
            )


class SlowingDown:
    """Whether every axis slows down as its quick stop must make it: at half the rate at least.

    Speeds are taken over some cycles, so that an encoder's increment is no speed. The first of them
    is what the axis had; where an axis was not seen, nothing is judged.

    Args:
        decelerations: Length axes. What each drive's quick stop has [rad/s² or m/s²].
        period_s: The cycle time [s].
        position: Length axes. Where the axes are, with a coupled wrist the motors [rad or m].
        began_s: When that was so [s].
    """

    def __init__(
        self,
        decelerations: Sequence[float],
        period_s: float,
        position: Sequence[float],
        began_s: float,
    ) -> None:
        self._least = [LEAST_SHARE * each for each in decelerations]
        self._cycles = math.ceil(LOOK_S / period_s)
        self._count = 0
        self._at = [(began_s, value) for value in position]
        self._first: list[tuple[float, float] | None] = [None] * len(position)

    def too_slow(
        self, time_s: float, position: Sequence[float], received: Sequence[bool]
    ) -> list[int]:
        """Return the axes that are too fast, by number, after one more cycle at `time_s` [s]."""
        self._count += 1
        if self._count % self._cycles:
            return []
        found = []
        for i, (now, answered) in enumerate(zip(position, received, strict=True)):
            then_s, then = self._at[i]
            if not answered or time_s <= then_s:
                continue
            self._at[i] = (time_s, now)
            speed = abs(now - then) / (time_s - then_s)
            first = self._first[i]
            if first is None:
                self._first[i] = (time_s, speed)
            elif time_s - first[0] >= OBEY_S:
                allowed = first[1] - self._least[i] * (time_s - first[0])
                if speed > max(allowed, SLACK):
                    found.append(i)
        return found
