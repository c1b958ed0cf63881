"""Last guards of the cyclic task, which act if the previous guard has failed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from acquisition.motion.samples import MotionSamples
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from acquisition.task.stop_orders import StopOrders
from config.cell.cell import CellConfig
from config.errors import PreflightError
from config.robot.robot import RobotDescription
from tests.acquisition.task.test_cyclic_task import Bench
from tests.builders.raised_codes import raises_code


@pytest.fixture
def bench(cell: CellConfig, robot: RobotDescription, axes: Any, clock: Any) -> Bench:
    return Bench(cell, robot, axes, clock)


def test_a_robot_that_leaves_its_limits_during_enabling_is_not_moved(
    bench: Bench, motion: MotionSamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    enable = bench.axes.enable  # type: ignore[attr-defined]

    def sag() -> float:
        bench.axes.answers.position[2] = 2.5
        return float(enable())

    monkeypatch.setattr(bench.axes, "enable", sag)
    with raises_code(PreflightError, "RID-POSE-OUTSIDE"):
        bench.run(motion)
    assert bench.axes.sent == []


def test_a_row_lost_by_a_full_ring_stops_the_motion(
    bench: Bench, motion: MotionSamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In lock-step the task waits until the recorder has emptied the ring buffer.

    Here this wait times out.
    """
    monkeypatch.setattr("acquisition.task.lockstep.RECORDER_PATIENCE_S", 0.0)
    bench.ring = Ring.create(3, 64)
    reason = bench.run(motion)
    assert reason is not None
    assert reason.code is StopCode.RECORDER
    assert len(bench.axes.sent) == 65
    assert np.unique(np.diff(bench.rows()["cycle"].astype(int))).tolist() == [1]


def test_no_command_is_sent_while_no_drive_answers(bench: Bench, motion: MotionSamples) -> None:
    def silence(axes: Any, cycle: int) -> None:
        axes.answers.received[:] = cycle not in (150, 151)

    bench.axes.script = silence
    assert bench.run(motion) is None
    rows = bench.rows()
    silent = ~rows["valid"].any(axis=1)
    assert np.count_nonzero(silent) == 2
    assert (rows["velocity_command"][silent] == 0.0).all()
    assert len(bench.axes.sent) == len(rows) - 2


def test_drives_that_ignore_commands_stop_the_motion(
    bench: Bench, motion: MotionSamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = bench.axes.command  # type: ignore[attr-defined]

    def refuse(velocity: Any) -> bool:
        return bench.axes.cycle < 150 and bool(command(velocity))

    monkeypatch.setattr(bench.axes, "command", refuse)
    reason = bench.run(motion)
    assert reason is not None
    assert reason.code is StopCode.NOT_ENABLED
    assert bench.axes.stopped_at == 150


def test_a_withdrawn_stop_order_still_stops_the_motion() -> None:
    gone = [True]
    orders = StopOrders(ControlBlock.create(), lambda: gone[0])
    assert orders.is_stop_ordered()
    gone[0] = False
    reason = orders.reason()
    assert reason is not None
    assert reason.code is StopCode.PROGRAM_GONE


def test_a_quick_stop_is_the_first_frame_of_its_cycle(
    bench: Bench, motion: MotionSamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    stopped_at: dict[int, int | None] = {}

    def note(_now_s: float) -> None:
        stopped_at.setdefault(bench.axes.cycle, bench.axes.stopped_at)

    def script(axes: Any, cycle: int) -> None:
        axes.answers.enabled[1] = cycle < 150

    bench.axes.script = script
    monkeypatch.setattr(bench.axes, "send_heartbeat", note)
    assert bench.run(motion) is not None
    assert (stopped_at[149], stopped_at[150]) == (None, 150)
