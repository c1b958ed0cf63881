"""Set-points that exceed a speed limit gradually, without a large step."""

from __future__ import annotations

import pytest

from acquisition.supervision.cycle import Cycle
from acquisition.supervision.stop_reason import StopCode
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from tests.acquisition.supervision.test_supervisor import Fault, T, Watch, at_speed


@pytest.fixture
def watch(cell: CellConfig, robot: RobotDescription) -> Watch:
    return at_speed(cell, robot)


def accelerating_set_point(quantity: str) -> Fault:
    """Return a fault that increases the set-point's velocity or feedforward by 0.11 rad/s per
    cycle.
    """

    def fault(cycle: Cycle) -> None:
        gained = 0.11 * cycle.number
        if quantity == "velocity":
            where = cycle.position[0] + T * 0.055 * cycle.number * (cycle.number + 1)
            cycle.position[0] = cycle.target.position[0] = where
            cycle.target.velocity[0] += gained
        else:
            cycle.target.feedforward[0] += gained

    return fault


@pytest.mark.parametrize("quantity", ["velocity", "feedforward"])
def test_a_set_point_that_becomes_too_fast_gradually_is_not_sent(
    watch: Watch, quantity: str
) -> None:
    """No step is too large, and the measured velocity is within its limit."""
    fault = accelerating_set_point(quantity)

    def fault_and_delay(cycle: Cycle) -> None:
        fault(cycle)
        if cycle.number == 16:  # the answer is lost: only the set-point shows the speed
            cycle.received[0] = False

    number, reason = watch.run(fault_and_delay)
    assert number == 16
    assert reason is not None
    assert (reason.code, reason.joint) == (StopCode.SET_POINT, "joint1")
    assert reason.value == pytest.approx(2.26)
    assert reason.limit == pytest.approx(2.2)
