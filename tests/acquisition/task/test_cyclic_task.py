"""Cyclic task in the test's process, with ideal drives on a simulated clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.journal.cycle_row import row_dtype
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.cyclic_task import CyclicTask
from acquisition.task.ring import Ring
from acquisition.task.service_beat import ServiceBeat
from acquisition.task.set_points import PlannedMotion
from acquisition.task.states import RecorderState, TaskState
from acquisition.task.stop_orders import StopOrders
from config.cell.cell import CellConfig
from config.errors import PreflightError, RecordingError, TransportError
from config.robot.robot import RobotDescription
from drivers.interfaces.servo_axes import Answers, DriveEvent, EventKind
from tests.builders.clock import Clock
from tests.builders.raised_codes import raises_code

T = 0.008


class Axes(Protocol):
    """Part of the fixture `axes` that these tests use."""

    script: Callable[[Any, int], None]
    answers: Answers
    true_position: NDArray[np.float64]
    true_velocity: NDArray[np.float64]
    calls: list[str]
    sent: list[list[float]]
    sync_times_s: list[float]
    events: list[DriveEvent]
    stopped_at: int | None
    reversed_joint: int | None
    unconfirmed: tuple[str, ...]
    cycle: int


class Bench:
    """A cyclic task with its axes, clock and ring buffer, and the rows that it has written."""

    def __init__(self, cell: CellConfig, robot: RobotDescription, axes: Any, clock: Any) -> None:
        self.control = ControlBlock.create()
        self.ring = Ring.create(3, 4096)
        self.parent_gone = False
        self.now, self.service = Clock(100.0), ServiceBeat.create()
        self.service.write(self.now(), 1e9)
        self.axes: Axes = axes
        self.clock = clock
        self.lockstep = True
        self._new_task = lambda: CyclicTask(
            axes, clock, cell, robot, self.ring, self.control, lockstep=self.lockstep,
            orders=StopOrders(self.control, lambda: self.parent_gone, self.service, self.now),
        )  # fmt: skip

    def run(self, motion: MotionSamples | PlannedMotion) -> StopReason | None:
        return self._new_task().run(
            PlannedMotion(motion) if isinstance(motion, MotionSamples) else motion
        )

    def rows(self) -> NDArray[Any]:
        return np.frombuffer(self.ring.read(), dtype=row_dtype(3))


@pytest.fixture
def bench(cell: CellConfig, robot: RobotDescription, axes: Any, clock: Any) -> Bench:
    return Bench(cell, robot, axes, clock)


def test_a_motion_has_approach_main_part_hold_and_end(bench: Bench, motion: MotionSamples) -> None:
    assert bench.run(motion) is None
    assert bench.axes.calls == ["enable", "disable"]
    rows = bench.rows()
    assert np.unique(np.diff(rows["cycle"].astype(int))).tolist() == [1]
    np.testing.assert_allclose(np.diff(rows["time_s"]), T, rtol=1e-9)
    streamed = rows[rows["sample_index"] >= 0]
    assert streamed["sample_index"].tolist() == list(range(len(motion)))
    np.testing.assert_array_equal(streamed["target_position"], motion.whole().position)
    np.testing.assert_array_equal(streamed["phase"], motion.whole().phase)
    assert rows["phase"][0] == Phase.APPROACH
    assert rows["phase"][-1] == Phase.HOLD
    assert rows["valid"].all()
    np.testing.assert_allclose(rows["exchange_s"], 0.001, rtol=1e-9)
    assert np.abs(bench.axes.true_velocity).max() < 1e-3
    np.testing.assert_allclose(bench.axes.true_position, motion.position[-1], atol=1e-3)


def test_the_first_set_point_is_the_robots_position(bench: Bench, motion: MotionSamples) -> None:
    bench.run(motion)
    first = bench.rows()[0]
    np.testing.assert_allclose(first["target_position"], first["position"], atol=1e-9)
    np.testing.assert_allclose(bench.axes.sent[0], 0.0, atol=1e-9)


@dataclass(frozen=True)
class Watching(PlannedMotion):
    """A motion that stores the measured positions that the task passes to it."""

    positions_seen: list[NDArray[np.float64]] = field(default_factory=list)

    def watch(self, answers: Answers) -> None:
        self.positions_seen.append(answers.position.copy())


def test_a_source_receives_every_position_during_approach_and_motion(
    bench: Bench, motion: MotionSamples
) -> None:
    source = Watching(motion)
    assert bench.run(source) is None
    positions = bench.rows()["position"]
    assert (bench.rows()["phase"][:20] == Phase.APPROACH).all()
    np.testing.assert_array_equal(source.positions_seen[1 : len(positions)], positions[:-1])


def test_the_command_of_the_position_loop_acts_one_cycle_later(
    bench: Bench, motion: MotionSamples
) -> None:
    bench.run(motion)
    rows = bench.rows()
    np.testing.assert_allclose(
        rows["velocity_command"],
        10.0 * (rows["target_position"] - rows["position"]) + rows["target_velocity"],
        atol=1e-12,
    )
    moved = np.diff(rows["position"], axis=0)[1:] / T
    np.testing.assert_allclose(moved, rows["velocity_command"][:-2], atol=1e-9)


def break_at(cycle: int, change: Callable[[Any], None]) -> Callable[[Any, int], None]:
    def script(axes: Any, now: int) -> None:
        if now >= cycle:
            change(axes)

    return script


def silence(axes: Any) -> None:
    axes.answers.received[1] = False


def lose_power(axes: Any) -> None:
    axes.answers.enabled[2] = False


def restart(axes: Any) -> None:
    axes.events.append(DriveEvent(EventKind.BOOT_UP, "joint1", 0.0, "joint1: booted"))


@pytest.mark.parametrize(
    ("change", "code", "after"),
    [
        (silence, StopCode.MISSED_FRAMES, 2),
        (lose_power, StopCode.NOT_ENABLED, 0),
        (restart, StopCode.DRIVE_RESTARTED, 0),
    ],
)
def test_a_fault_causes_a_quick_stop_in_the_cycle_that_shows_it(
    bench: Bench,
    motion: MotionSamples,
    change: Callable[[Any], None],
    code: StopCode,
    after: int,
) -> None:
    bench.axes.script = break_at(150, change)
    reason = bench.run(motion)
    assert reason is not None
    assert reason.code is code
    assert bench.control.task.stop_reason == reason
    assert bench.axes.stopped_at == 150 + after
    assert bench.axes.calls == ["enable", "quick_stop", "disable"]
    assert not bench.axes.true_velocity.any()
    assert bench.rows()["velocity_command"][-1].tolist() == [0.0, 0.0, 0.0]


def test_a_single_missed_answer_is_one_invalid_value(bench: Bench, motion: MotionSamples) -> None:
    def script(axes: Any, cycle: int) -> None:
        axes.answers.received[1] = cycle != 200

    bench.axes.script = script
    assert bench.run(motion) is None
    assert np.argwhere(bench.rows()["valid"] == 0).tolist() == [[199, 1]]


def test_a_reversed_axis_stops_after_a_short_distance(bench: Bench, motion: MotionSamples) -> None:
    bench.axes.reversed_joint = 0
    reason = bench.run(motion)
    assert reason is not None
    assert (reason.code, reason.joint) == (StopCode.FOLLOWING_ERROR, "joint1")
    rows = bench.rows()
    assert np.ptp(rows["position"][:, 0]) < 0.15
    assert not bench.axes.true_velocity.any()


def request(bench: Bench, code: StopCode) -> Callable[[Any, int], None]:
    return lambda axes, cycle: bench.control.program.request_stop(code) if cycle == 150 else None


def leave(bench: Bench) -> Callable[[Any, int], None]:
    def script(axes: Any, cycle: int) -> None:
        bench.parent_gone = cycle >= 150

    return script


def fail_recorder(bench: Bench) -> Callable[[Any, int], None]:
    return lambda axes, cycle: (
        bench.control.recorder.fail(RecordingError("disk full")) if cycle == 150 else None
    )


@pytest.mark.parametrize(
    ("order", "code"),
    [
        (lambda bench: request(bench, StopCode.INTERRUPTED), StopCode.INTERRUPTED),
        (lambda bench: request(bench, StopCode.RECORDER), StopCode.RECORDER),
        (leave, StopCode.PROGRAM_GONE),
        (fail_recorder, StopCode.RECORDER),
    ],
)
def test_a_stop_order_takes_effect_in_the_next_cycle(
    bench: Bench,
    motion: MotionSamples,
    order: Callable[[Bench], Callable[[Any, int], None]],
    code: StopCode,
) -> None:
    bench.axes.script = order(bench)
    reason = bench.run(motion)
    assert reason is not None
    assert reason.code is code
    assert bench.axes.stopped_at == 150
    assert bench.axes.calls[-1] == "disable"


def test_no_drive_is_enabled_after_a_stop_order(bench: Bench, motion: MotionSamples) -> None:
    bench.control.program.request_stop(StopCode.INTERRUPTED)
    reason = bench.run(motion)
    assert reason is not None
    assert reason.code is StopCode.INTERRUPTED
    assert bench.axes.calls == []


def test_no_drive_is_enabled_after_a_stop_order_during_the_path_check(
    bench: Bench, motion: MotionSamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    def request_stop_meanwhile(*_: object, **__: object) -> None:
        bench.control.program.request_stop(StopCode.STOP_BUTTON)

    monkeypatch.setattr("acquisition.task.cyclic_task.refuse_collision", request_stop_meanwhile)
    reason = bench.run(motion)
    assert reason is not None
    assert bench.control.task.stop_reason == reason
    assert bench.axes.calls == []


def test_an_overrun_is_skipped_and_counted_and_the_motion_keeps_its_schedule(
    bench: Bench, motion: MotionSamples
) -> None:
    bench.clock.oversleep_s = {100: 1.2 * T}
    assert bench.run(motion) is None
    rows = bench.rows()
    at = int(np.argmax(rows["lateness_s"]))
    assert rows["lateness_s"][at] == pytest.approx(1.2 * T)
    assert rows["cycle"][at] - rows["cycle"][at - 1] == 2
    assert np.sum(np.diff(rows["cycle"].astype(int)) - 1) == 1
    on_time = rows["time_s"] - rows["cycle"] * T
    assert np.abs(np.delete(on_time - on_time[0], at)).max() < 1e-9
    index = rows["sample_index"][rows["sample_index"] >= 0]
    assert len(index) in (len(motion) - 1, len(motion))


def test_after_a_long_pause_the_stop_is_the_first_action(
    bench: Bench, motion: MotionSamples
) -> None:
    bench.clock.oversleep_s = {200: 0.2}
    reason = bench.run(motion)
    assert reason is not None
    assert reason.code is StopCode.LATE_CYCLE
    sent_before = 200 - 1
    assert len(bench.axes.sent) == sent_before
    assert bench.axes.stopped_at == sent_before
    gaps = np.diff(bench.axes.sync_times_s)
    assert gaps.min() > 0.9 * T, "skipped cycles are not repeated"
    assert bench.rows()["lateness_s"].max() == pytest.approx(0.2), "its reason is recorded"


def test_a_lost_bus_ends_the_motion_and_the_clean_up_continues(
    bench: Bench, motion: MotionSamples
) -> None:
    def script(axes: Any, cycle: int) -> None:
        if cycle >= 150:
            raise TransportError("adapter unplugged")

    bench.axes.script = script
    reason = bench.run(motion)
    assert reason is not None
    assert (reason.code, reason.text) == (StopCode.BUS, "adapter unplugged")
    assert bench.axes.calls == ["enable", "quick_stop", "disable"]
    assert "while stopping: adapter unplugged" in bench.control.task.notes


def test_an_axis_that_does_not_stop_or_confirm_is_reported(
    bench: Bench, motion: MotionSamples
) -> None:
    bench.axes.script = break_at(150, silence)
    bench.axes.unconfirmed = ("joint2",)
    bench.run(motion)
    notes = " ".join(bench.control.task.notes)
    assert "did not come to rest within" in notes
    assert "joint2 did not confirm" in notes
    assert bench.axes.cycle < 300, "the wait for standstill is limited"


def test_in_real_time_a_slow_recorder_stops_the_motion_before_a_row_is_lost(
    bench: Bench, motion: MotionSamples
) -> None:
    bench.lockstep = False
    bench.ring = Ring.create(3, 200)
    reason = bench.run(motion)
    assert reason is not None
    assert reason.code is StopCode.RECORDER
    assert reason.value is not None
    rows = bench.rows()
    assert np.unique(np.diff(rows["cycle"].astype(int))).tolist() == [1]


def test_in_lock_step_simulated_time_waits_for_the_recorder(
    bench: Bench, motion: MotionSamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.ring = Ring.create(3, 64)
    blocks: list[bytes] = []
    sleep = "acquisition.task.lockstep.time.sleep"
    monkeypatch.setattr(sleep, lambda _: blocks.append(bench.ring.read()))
    assert bench.run(motion) is None
    blocks.append(bench.ring.read())
    rows = np.frombuffer(b"".join(blocks), dtype=row_dtype(3))
    assert np.unique(np.diff(rows["cycle"].astype(int))).tolist() == [1]
    np.testing.assert_allclose(np.diff(rows["time_s"]), T, rtol=1e-9)


def test_a_robot_outside_its_limits_is_not_moved(bench: Bench, motion: MotionSamples) -> None:
    bench.axes.answers.position[2] = 2.5
    with raises_code(PreflightError, "RID-POSE-OUTSIDE", "joint3", "2.5000", "-2 to"):
        bench.run(motion)
    assert bench.axes.sent == []


def test_the_control_block_shows_the_progress_of_the_task(
    bench: Bench, motion: MotionSamples
) -> None:
    reports = []
    bench.axes.script = lambda axes, cycle: reports.append(bench.control.progress)
    bench.run(motion)
    assert {progress.state for progress in reports} == {TaskState.MOVING}
    assert max(progress.sample_index for progress in reports) == len(motion) - 1
    assert bench.control.recorder.state is RecorderState.STARTING


class TestEnoughPeriods:
    def test_the_motion_continues_with_its_run_out_without_a_jump(
        self, bench: Bench, motion: MotionSamples
    ) -> None:
        bench.control.program.announce_judgement()
        bench.control.program.judge(1, True)
        assert bench.run(motion) is None
        rows = bench.rows()
        main = rows[rows["phase"] == Phase.MAIN]
        assert len(main) == motion.samples_per_period  # one of two periods
        assert (rows["phase"] == Phase.RUN_OUT).any()
        largest = np.abs(np.diff(motion.position, axis=0)).max()
        moved = rows[rows["sample_index"] >= 0]["target_position"]
        assert np.abs(np.diff(moved, axis=0)).max() <= largest * 1.001

    def test_a_motion_without_enough_periods_runs_to_its_end(
        self, bench: Bench, motion: MotionSamples
    ) -> None:
        bench.control.program.announce_judgement()
        bench.control.program.judge(2, False)
        assert bench.run(motion) is None
        main = bench.rows()["phase"] == Phase.MAIN
        assert main.sum() == 2 * (motion.samples_per_period or 0)

    def test_in_real_time_the_motion_does_not_wait_for_a_verdict(
        self, bench: Bench, motion: MotionSamples
    ) -> None:
        bench.lockstep = False
        bench.control.program.announce_judgement()
        assert bench.run(motion) is None
        main = bench.rows()["phase"] == Phase.MAIN
        assert main.sum() == 2 * (motion.samples_per_period or 0)
