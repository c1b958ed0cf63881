"""End positions of stops during a motion, compared with limits, bodies and simulated drives."""

from __future__ import annotations

import math

import numpy as np
import pytest

from acquisition.motion.collision import refuse_collision
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import MotionSamples
from acquisition.motion.stop_distance import (
    ORDERED_STOP_CYCLES,
    late_stop_note,
    rest_positions,
    verify_stops,
)
from config.cell.cell import CellConfig
from config.errors import PreflightError
from config.robot.bodies import Plane, Workspace
from config.robot.robot import RobotDescription
from drivers.cell import Cell
from drivers.ports.can_link import CanLink
from dynamics.geometry.clearances import Clearances
from tests.builders.obedient_cell import ObedientCell, one_axis
from tests.builders.raised_codes import raises_code

AMPLITUDE = 1.98  # of a limit of 2 rad


def swing(robot: RobotDescription, period_s: float = 6.4) -> MotionSamples:
    """Return a motion within 0.02 rad of both limits; the default period gives a speed of 1.9
    rad/s.
    """
    joint = FourierJoint(joint="joint", offset=0.0, sine=(AMPLITUDE,), cosine=(0.0,))
    motion = FourierMotion(
        kind="fourier", robot="one", period_s=period_s, periods=2, ramp_s=3.2, joints=(joint,)
    )
    return motion.plan(robot, 0.008)


def cell_with(deceleration: float) -> tuple[CellConfig, RobotDescription]:
    return one_axis(deceleration=deceleration, velocity=3.0, acceleration=8.0, limit=2.0)


def verify(cell: CellConfig, robot: RobotDescription) -> None:
    verify_stops(swing(robot), cell, robot, Clearances.of(robot, cell.workspace))


def test_a_stop_that_ends_beyond_a_limit_is_refused_with_joint_and_distance() -> None:
    cell, robot = cell_with(1.0)
    end = rest_positions(swing(robot), cell, robot, ORDERED_STOP_CYCLES * cell.cycle_time_s)
    farthest = float(np.abs(end).max())
    assert farthest > 2.1
    with raises_code(PreflightError, "RID-MOTION-STOP", "joint", f"{farthest - 2.0:.3g} rad"):
        verify(cell, robot)


def test_a_stop_that_ends_within_the_limits_is_accepted() -> None:
    verify(*cell_with(8.0))


def test_an_axis_can_stop_faster_than_the_others() -> None:
    cell, robot = cell_with(1.0)
    (axis,) = cell.axes
    own = axis.model_copy(update={"quick_stop_deceleration_rad_s2": 8.0})
    verify(cell.model_copy(update={"axes": (own,)}), robot)


def test_a_stop_that_ends_in_contact_with_a_wall_is_refused() -> None:
    """The motion itself keeps its clearance; only the stop reaches the wall."""
    cell, robot = cell_with(2.0)
    robot = robot.model_copy(update={"tool_offset_m": (0.2, 0.0, 0.0)})
    samples = swing(robot)
    reach = float(np.abs(samples.position).max())
    end = rest_positions(samples, cell, robot, ORDERED_STOP_CYCLES * cell.cycle_time_s)
    assert np.abs(end).max() > reach
    lowest_m = 0.1 + 0.2 * math.cos(reach)  # of the tool point, which moves on a circle
    wall = Plane(name="wall", normal=(1.0, 0.0, 0.0), offset_m=lowest_m - 3e-4)
    clearances = Clearances.of(robot, Workspace(planes=(wall,), clearance_m=0.0))
    refuse_collision(clearances, samples.position, samples.sample_period_s, "the motion")
    with raises_code(PreflightError, "RID-MOTION-STOP", "tool point", "wall"):
        verify_stops(samples, cell, robot, clearances)


@pytest.mark.parametrize(("timeout_ms", "noted"), [(80, False), (2000, True)])
def test_a_late_stop_beyond_a_limit_is_a_remark(timeout_ms: int, noted: bool) -> None:
    cell, robot = cell_with(8.0)
    safety = cell.drive_safety.model_copy(update={"master_heartbeat_timeout_ms": timeout_ms})
    note = late_stop_note(swing(robot), cell.model_copy(update={"drive_safety": safety}), robot)
    assert bool(note) is noted


def test_with_a_coupled_wrist_each_motor_stops_by_its_own_ramp() -> None:
    cell, robot = cell_with(2.0)
    coupled = robot.model_copy(update={"coupling": ((2.0,),)})
    samples = swing(robot)
    brief = samples.whole(most_periods=2)
    end = rest_positions(samples, cell, coupled, 0.0)
    motor = brief.velocity / 2.0
    assert end == pytest.approx(brief.position + 2.0 * motor * np.abs(motor) / 4.0)


@pytest.mark.parametrize(("velocity", "deceleration"), [(1.5, 4.0), (-2.0, 8.0), (0.3, 5.0)])
def test_a_simulated_drive_comes_to_rest_where_it_was_computed(
    velocity: float, deceleration: float
) -> None:
    cell, robot = cell_with(deceleration)
    with Cell(cell, robot, CanLink(ObedientCell(cell, robot, 65536))) as opened:
        axes, clock = opened.axes, opened.clock
        axes.bring_up()
        axes.start()
        due_s = axes.enable()
        for _ in range(40):
            clock.sleep_until(due_s := due_s + cell.cycle_time_s)
            axes.exchange()
            before = float(axes.answers.position[0])
            axes.command(np.array([velocity]))
            axes.send_heartbeat(clock.now_s())
        clock.sleep_until(due_s := due_s + cell.cycle_time_s)
        axes.exchange()
        at = float(axes.answers.position[0])
        assert at - before == pytest.approx(velocity * cell.cycle_time_s, rel=0.02)
        assert axes.halt()
        end = float(axes.answers.position[0])
        axes.disable()
    delay_s = ORDERED_STOP_CYCLES * cell.cycle_time_s
    most = velocity * delay_s + 0.5 * velocity * abs(velocity) / deceleration
    assert abs(end - at) <= abs(most) + 1e-3
    assert abs(end - at) >= abs(most) - abs(velocity) * cell.cycle_time_s - 1e-3
