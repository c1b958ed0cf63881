"""End of a motion: quick stop, check of standstill, power off."""

from __future__ import annotations

from typing import Any

import pytest

from acquisition.task.control_block import ControlBlock
from acquisition.task.stop_sequence import REST_CYCLES, STOP_MARGIN_S, StopSequence
from config.cell.cell import CellConfig
from config.errors import TransportError
from config.robot.robot import RobotDescription

T = 0.008
SPEED = 0.4


class Ending:
    """Axes that move at `SPEED` when they receive the stop."""

    def __init__(self, cell: CellConfig, robot: RobotDescription, axes: Any, clock: Any) -> None:
        self.axes, self.clock = axes, clock
        self.control = ControlBlock.create()
        self.sequence = StopSequence(axes, clock, cell, robot, self.control.task)
        axes.enable()
        axes.true_velocity[:] = SPEED
        axes.answers.position[:] = axes.true_position
        self.began_s = clock.now_s()
        self.cycles = 0

    def run(self) -> None:
        self.sequence.come_to_rest(self.cycle)

    def cycle(self) -> tuple[float, int]:
        self.cycles += 1
        self.clock.sleep_until(self.began_s + self.cycles * T)
        return self.axes.exchange(), 1


@pytest.fixture
def ending(cell: CellConfig, robot: RobotDescription, axes: Any, clock: Any) -> Ending:
    return Ending(cell, robot, axes, clock)


def test_the_quick_stop_is_sent_first_and_the_time_to_rest_is_reported(
    ending: Ending, cell: CellConfig
) -> None:
    ending.run()
    assert ending.axes.calls == ["enable", "quick_stop"]
    assert ending.axes.stopped_at == 0
    ramp_s = SPEED / cell.drive_safety.quick_stop_deceleration_rad_s2
    assert ending.control.task.ramp_s == pytest.approx(ramp_s, abs=3 * T)
    assert ending.cycles <= ramp_s / T + REST_CYCLES + 3
    assert ending.control.task.notes == ()


def test_a_silent_axis_does_not_count_as_at_rest(ending: Ending) -> None:
    def silent(axes: Any, _cycle: int) -> None:
        axes.answers.received[2] = False

    ending.axes.script = silent
    ending.run()
    assert ending.control.task.ramp_s is None
    (note,) = ending.control.task.notes
    assert note.startswith("the axes did not come to rest within")
    assert ending.cycles * T < 1.0 + STOP_MARGIN_S


def test_an_axis_that_does_not_slow_down_is_disabled_at_once(ending: Ending) -> None:
    def deaf(axes: Any, _cycle: int) -> None:
        axes.true_velocity[1] = SPEED

    ending.axes.script = deaf
    ending.run()
    (note,) = ending.control.task.notes
    assert note == "the quick stop did not decelerate joint2: the drives were disabled at once"
    assert ending.cycles * T < 0.15


def test_an_axis_that_runs_beyond_its_limit_is_disabled_at_once(
    ending: Ending, robot: RobotDescription
) -> None:
    ending.axes.true_position[0] = robot.joints[0].limits.position_max + 0.019
    ending.axes.answers.position[:] = ending.axes.true_position
    ending.run()
    (note,) = ending.control.task.notes
    assert note == "joint1 exceeded its limit during the stop: the drives were disabled at once"


def test_a_bus_that_fails_during_the_wait_is_noted_and_power_is_still_removed(
    ending: Ending,
) -> None:
    def unplug(_axes: Any, _cycle: int) -> None:
        raise TransportError("adapter unplugged")

    ending.axes.script = unplug
    ending.run()
    ending.sequence.disable()
    assert ending.control.task.notes == ("while stopping: adapter unplugged",)
    assert ending.axes.calls[-1] == "disable"


def test_drives_that_do_not_confirm_power_off_are_named(ending: Ending) -> None:
    ending.axes.unconfirmed = ("joint1", "joint3")
    ending.sequence.disable()
    (note,) = ending.control.task.notes
    assert note.startswith("the drives of joint1, joint3 did not confirm that they are")
