"""`StopSequence`: quick stop, supervision of the deceleration, and power off.

If an axis does not decelerate as required, or exceeds its limit, the drives are disabled at once
and the brakes engage.
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
    """End of a motion. A bus failure during the stop becomes a note, not an error.

    The timeout is the duration of the ramp from the largest speed, plus `STOP_MARGIN_S`. The
    preflight limits this duration to `drivers.servo.stop_ramp.LONGEST_STOP_S`. With a coupled
    wrist, rest and limits are checked per joint, and the deceleration per motor: a joint may
    accelerate while all motors decelerate.

    Args:
        axes: The drives.
        clock: Clock of the bus.
        cell, robot: Cycle time, quick-stop decelerations, limits, coupling of the wrist.
        words: Receives the time to rest and the notes.
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
        """Command a quick stop by set-point frames, and watch the axes until all are at rest.

        The watch ends earlier if an axis decelerates too slowly or moves further beyond its limit,
        after a bus failure, and after the timeout.

        Args:
            cycle: Function that waits for the next cycle and runs it with a quick stop as its
                command. It returns the time of the cycle's SYNC [s] and the number of cycle times
                since the previous cycle.
        """
        axes = self._axes
        before = axes.answers.position.tolist()
        began_s = time_s = self._clock.now_s()
        slowing = DecelerationCheck(
            self._decelerations, self._period_s, self._motor_positions(), began_s
        )
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
                beyond = self._axes_beyond_limits(before, position, most)
                before = position
                too_slow = slowing.too_slow(time_s, self._motor_positions(), received)
                if why := self._reason_to_disable_now(beyond, too_slow):
                    self._words.add_note(f"{why}: the drives were disabled at once")
                    return
        except (DriverError, SafetyStop) as error:
            self._words.add_note(f"while stopping: {error}")
            return
        self._words.add_note(
            f"the axes did not come to rest within {self._patience_s:.2g} s: the drives were"
            " disabled"
        )

    def _motor_positions(self) -> list[float]:
        """Return the motor positions divided by the gear ratios [rad or m]."""
        position = self._axes.answers.position
        of_motors = position if self._coupling is None else self._coupling.to_motors(position)
        return list(of_motors.tolist())

    def _axes_beyond_limits(
        self, before: list[float], position: list[float], most: float
    ) -> list[int]:
        """Return the indices of the axes that are outside their limits and move further out."""
        moves = zip(before, position, self._low, self._high, strict=True)
        return [
            i
            for i, (then, now, low, high) in enumerate(moves)
            if (now > high and now - then > most) or (now < low and then - now > most)
        ]

    def _reason_to_disable_now(self, beyond: list[int], too_slow: list[int]) -> str:
        """Return the reason to disable the drives at once; empty if the ramp may continue."""
        names = self._axes.joint_names
        if beyond:
            return f"{', '.join(names[i] for i in beyond)} exceeded its limit during the stop"
        if too_slow:
            return f"the quick stop did not decelerate {', '.join(names[i] for i in too_slow)}"
        return ""

    def disable(self) -> None:
        """Disable the drives, even if axes still move."""
        try:
            unconfirmed = self._axes.disable()
        except DriverError as error:
            self._words.add_note(f"while disabling: {error}")
            return
        if unconfirmed:
            self._words.add_note(
                f"the drives of {', '.join(unconfirmed)} did not confirm that they are disabled:"
                " check them before going near the robot"
            )


class DecelerationCheck:
    """Check that every axis decelerates at half of its quick-stop rate or more.

    Speeds are averaged over at least 20 ms, so that one encoder increment does not count as a
    speed. The first value is the initial speed. An axis that did not answer is not checked.

    Args:
        decelerations: Quick-stop deceleration of each drive [rad/s² or m/s²].
        period_s: Cycle time [s].
        position: Initial position of each axis, or of each motor for a coupled wrist [rad or m].
        began_s: Time of these positions [s].
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
        """Return the indices of axes that decelerate too slowly, after a cycle at `time_s` [s]."""
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
