"""Stop on simulated drives that obey their quick stop: no axis is reported as too slow."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from acquisition.supervision.stop_reason import StopCode
from config.cell.cell import CellConfig, DriveAxis
from config.cell.extra_setting import ExtraSetting
from config.cell.servo_profile import ServoProfile
from config.robot.robot import RobotDescription
from drivers.cell import Cell
from drivers.ports.can_link import CanLink
from drivers.servo.power_sequence import HALT_MARGIN_S
from tests.builders.obedient_cell import ObedientCell, Outcome, one_axis, rows_until

Make = Callable[[], tuple[CellConfig, RobotDescription]]

INCREMENTS = 65536
GEAR = 100.0
STATED = 2.0
"""Deceleration of a drive whose 6085h cannot be set, stated in its profile [rad/s²]."""


def cell_with_stated_deceleration() -> tuple[CellConfig, RobotDescription]:
    """Return a cell of one drive whose profile states its deceleration, and its robot."""
    cell, robot = one_axis(deceleration=12.0, velocity=2.0, acceleration=6.0, limit=3.0)
    ramp = round(STATED * INCREMENTS * GEAR / (2.0 * math.pi))
    profile = ServoProfile(
        deceleration_rad_s2=STATED,
        settings=(ExtraSetting(object="6085h:00", bits=32, value=ramp, written=False),),
    )
    return cell.model_copy(update={"servo": profile}), robot


def wrist() -> tuple[CellConfig, RobotDescription]:
    """Return a cell with a coupled wrist: q2 = alpha1 + alpha2.

    At top speed motor 1 turns with 2 rad/s, motor 2 with -0.5 rad/s; while both slow down, joint 2
    continues with 1.5 rad/s until motor 2 is at rest.
    """
    cell, robot = one_axis(deceleration=4.0, velocity=2.0, acceleration=6.0, limit=3.0)
    (one,) = robot.joints
    slower = one.limits.model_copy(update={"velocity": 1.5, "acceleration": 4.5})
    joints = tuple(
        one.model_copy(update={"name": f"joint{i}", "limits": limits})
        for i, limits in enumerate((one.limits, slower), start=1)
    )
    axes = tuple(DriveAxis(joint=joint.name, node_id=i) for i, joint in enumerate(joints, start=1))
    rows = robot.kinematics.rows * 2
    return cell.model_copy(update={"axes": axes}), robot.model_copy(
        update={
            "joints": joints,
            "coupling": ((1.0, 0.0), (1.0, 1.0)),
            "kinematics": robot.kinematics.model_copy(update={"rows": rows}),
        }
    )


@pytest.mark.parametrize("make", [wrist, cell_with_stated_deceleration])
def test_axes_that_obey_their_quick_stop_keep_power_until_they_are_at_rest(make: Make) -> None:
    cell, robot = make()
    outcome = Outcome(cell, robot, INCREMENTS, rows_until(cell, robot, 1.0), 1)
    assert outcome.error is None
    assert outcome.reason is not None
    assert outcome.reason.code is StopCode.INTERRUPTED
    assert outcome.notes == ()
    for i in range(len(robot.joints)):
        with_power = [speeds[i] for _, _, speeds, powered in outcome.bus.trace if powered[i]]
        assert with_power[-1] < 0.02


def test_the_wait_for_rest_lasts_as_long_as_the_ramp_of_the_slowest_drive() -> None:
    cell, robot = cell_with_stated_deceleration()
    bus = ObedientCell(cell, robot, INCREMENTS)
    with Cell(cell, robot, CanLink(bus)) as opened:
        opened.axes.bring_up()
        opened.axes.start()
        opened.axes.enable()
        bus.drives.clear()  # no drive answers, so that the wait lasts as long as allowed
        bus.axes.clear()
        bus.units.clear()
        began_s = bus.now_s
        assert not opened.axes.halt()
        waited_s = bus.now_s - began_s
        opened.axes.disable()
    assert waited_s == pytest.approx(2.0 / STATED + HALT_MARGIN_S, abs=2.0 * cell.cycle_time_s)
