"""`StopSequence`: a quick stop, a look at whether the axes come to rest, and the power off.

An axis that is told to and does not slow down is not waited for: power off is next.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from acquisition.control_block import ControlBlock
from config.cell import CellConfig
from config.errors import DriverError, SafetyStop
from config.robot import RobotDescription
from drivers.clock import Clock
from drivers.interfaces import ServoAxes

STOP_MARGIN_S = 0.5
REST_VELOCITY = 0.01
REST_CYCLES = 5
OBEY_CYCLES = 8


class StopSequence:
    """How a motion ends. A bus that fails meanwhile is noted in the control block, not raised.

    Parameters
    ----------
    axes : ServoAxes
        The drives.
    clock : Clock
        The clock of their bus.
    cell, robot : CellConfig, RobotDescription
        Cycle time, deceleration of a quick stop, largest velocities.
    control : ControlBlock
        Takes the time to rest and the notes.
    """

    def __init__(
        self,
        axes: ServoAxes,
        clock: Clock,
        cell: CellConfig,
        robot: RobotDescription,
        control: ControlBlock,
    ) -> None:
        self._axes = axes
        self._clock = clock
        self._control = control
        self._period_s = cell.cycle_time_s
        self._deceleration = cell.drive_safety.quick_stop_deceleration_rad_s2
        ramp_s = max(joint.limits.velocity for joint in robot.joints) / self._deceleration
        self._cycles = math.ceil((ramp_s + STOP_MARGIN_S) / self._period_s)

    def come_to_rest(self, cycle: Callable[[], tuple[float, int]]) -> None:
        """Quick stop, by set-point frames alone, and watch until everything rests.

        Parameters
        ----------
        cycle : callable
            Waits for the next cycle and does it, with a quick stop as its command; returns the time
            of its SYNC [s] and how many cycle times have passed since the last.
        """
        axes = self._axes
        before = axes.position.tolist()
        resting = 0
        first: list[float] = []
        began_s = self._clock.now_s()
        try:
            axes.quick_stop()
            for number in range(self._cycles):
                time_s, periods = cycle()
                received, position = axes.received.tolist(), axes.position.tolist()
                most = REST_VELOCITY * self._period_s * periods
                rest = all(received) and all(
                    abs(now - then) <= most for now, then in zip(position, before, strict=True)
                )
                speed = [
                    abs(now - then) / (self._period_s * periods)
                    for now, then in zip(position, before, strict=True)
                ]
                before = position
                resting = resting + 1 if rest else 0
                if resting >= REST_CYCLES:
                    self._control.report_rest(time_s - (REST_CYCLES - 1) * self._period_s - began_s)
                    return
                first = first or speed
                if number == OBEY_CYCLES and (deaf := self._disobedient(first, speed, received)):
                    self._control.add_note(
                        f"the quick stop did not slow down {', '.join(deaf)}: the power was taken"
                        " away at once"
                    )
                    return
        except (DriverError, SafetyStop) as error:
            self._control.add_note(f"while stopping: {error}")
            return
        self._control.add_note(
            "standstill could not be seen within the time that the ramp takes; the drives were"
            " disabled all the same"
        )

    def _disobedient(
        self, first: list[float], speed: list[float], received: list[bool]
    ) -> list[str]:
        """Return the axes that have slowed down by less than half of what the quick stop asks."""
        slower = 0.5 * self._deceleration * (OBEY_CYCLES - 2) * self._period_s
        return [
            name
            for name, then, now, answered in zip(
                self._axes.joint_names, first, speed, received, strict=True
            )
            if answered and now > max(10.0 * REST_VELOCITY, then - slower)
        ]

    def disable(self) -> None:
        """Take the power away, whether the axes rest or not."""
        try:
            unconfirmed = self._axes.disable()
        except DriverError as error:
            self._control.add_note(f"while disabling: {error}")
            return
        if unconfirmed:
            self._control.add_note(
                f"the drives of {', '.join(unconfirmed)} did not confirm being disabled: check them"
                " before going near the robot"
            )
