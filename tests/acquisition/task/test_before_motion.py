"""Checks before a motion: after a stop or a refusal the drives get no power, and no drive reports a
timeout.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import can
import numpy as np
import pytest

from acquisition.motion.known_pose import KnownPose
from acquisition.motion.samples import MotionSamples, Phase, phases_of, standstill
from acquisition.supervision.stop_reason import StopCode
from acquisition.task import process
from acquisition.task.control_block import ControlBlock
from acquisition.task.set_points import PlannedMotion, SetPointSource
from acquisition.task.states import RecorderState, TaskState
from config.cell.cell import CellConfig
from config.cell.servo_profile import ServoProfile
from config.errors import PreflightError, RecordingError
from config.robot.robot import RobotDescription
from drivers.cell import Cell
from drivers.ports.can_link import CanLink
from drivers.servo.axes import CanServoAxes
from drivers.settings.write_log import WriteLog
from tests.builders.obedient_cell import RING, ObedientCell, SpeedUp, one_axis

LEFT_TO_TRIAL = ServoProfile(lacks=("6007h", "605Ah", "605Eh", "1029h"))
TOLD_TO_SWITCH_ON = b"\x07\x00"


class Started:
    """Main function of the task's process, run in the test's process on simulated drives."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
        cell, self.robot = one_axis(deceleration=8.0, velocity=1.0, acceleration=4.0, limit=2.0)
        self.cell = cell.model_copy(update={"simulated": True})
        self.control = ControlBlock.create()
        self.control.recorder.state = RecorderState.RECORDING
        self.parent = os.getppid()
        self.folder = folder
        self.pose: KnownPose | None = None
        self.use(LEFT_TO_TRIAL)
        for name in ("leave_terminal", "set_process_name", "disable_garbage_collection"):
            monkeypatch.setattr(process, name, lambda *_: None)
        monkeypatch.setattr(process, "open_cell", self.open_cell)

    def use(self, profile: ServoProfile) -> None:
        """Replace the drives on the bus by drives with this profile."""
        self.cell = self.cell.model_copy(update={"servo": profile})
        self.bus = ObedientCell(self.cell, self.robot, 4096)

    def open_cell(
        self,
        cell: CellConfig,
        robot: RobotDescription,
        write_log: WriteLog,
        *,
        stopped: Callable[[], bool] = lambda: False,
    ) -> Cell:
        return Cell(cell, robot, CanLink(self.bus), write_log, stopped=stopped)

    def run(self, source: SetPointSource | None = None) -> None:
        source = source or SpeedUp(self.cell, self.robot, 10, 1, self.control)
        writes = self.folder / "writes.jsonl"
        process.run_cyclic_task(
            self.cell,
            self.robot,
            source,
            RING[1],
            self.control,
            writes,
            process.MotionOwner(self.parent),
            self.pose,
        )
        RING[1].read(8192)

    def assert_stopped_by(self, code: StopCode) -> None:
        task = self.control.task
        assert task.error is None
        assert task.stop_reason is not None
        assert task.stop_reason.code is code
        assert task.state is TaskState.FINISHED
        assert task.cycles == 0
        assert task.notes == ()
        assert not any(axis.powered for axis in self.bus.axes)


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Started:
    return Started(monkeypatch, tmp_path)


def test_without_a_stop_order_the_drives_are_checked_and_moved(started: Started) -> None:
    started.run()
    assert started.control.task.error is None
    assert started.control.task.cycles > 0
    assert any(any(powered) for *_, powered in started.bus.trace)


@pytest.mark.parametrize(("deceleration", "refused"), [(3.0, True), (8.0, False)])
def test_an_approach_whose_stop_would_end_beyond_a_limit_gets_no_power(
    started: Started, deceleration: float, refused: bool
) -> None:
    cell, started.robot = one_axis(
        deceleration=deceleration, velocity=5.0, acceleration=20.0, limit=4.0
    )
    started.cell = cell.model_copy(update={"simulated": True})
    started.use(ServoProfile())
    started.bus.axes[0].counts = started.bus.units[0].counts(3.45)
    rest = standstill(np.array([3.98]), 5)
    phase = phases_of((Phase.MAIN, 5))
    started.run(PlannedMotion(MotionSamples(("joint",), cell.cycle_time_s, *rest, phase=phase)))
    error = started.control.task.error
    assert (error is not None and error.refusal == "RID-MOTION-STOP") is refused
    assert any(any(powered) for *_, powered in started.bus.trace) is not refused


@pytest.mark.parametrize("moved_rad", [0.2, -0.02])
def test_a_robot_away_from_its_last_known_pose_gets_no_power(
    started: Started, moved_rad: float
) -> None:
    started.use(ServoProfile())
    started.pose = KnownPose((moved_rad,), "run A")
    started.run()
    error = started.control.task.error
    assert isinstance(error, PreflightError)
    assert error.refusal == "RID-POSE-MOVED"
    assert not any(any(powered) for *_, powered in started.bus.trace)


def test_a_hold_to_run_motion_can_move_a_displaced_robot_and_a_note_is_kept(
    started: Started,
) -> None:
    started.pose = KnownPose((0.2,), "run A", binding=False)
    started.run()
    assert started.control.task.error is None
    assert started.control.task.cycles > 0
    assert started.control.task.displaced
    assert any("run A" in note for note in started.control.task.notes)


def test_a_robot_that_sagged_into_its_brakes_counts_as_not_displaced(started: Started) -> None:
    started.pose = KnownPose((0.002,), "run A")
    started.run()
    assert started.control.task.error is None
    assert not started.control.task.displaced


def test_no_drive_times_out_during_the_collision_check_of_a_long_path(
    started: Started, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The drive's timeout ends 80 ms after the master's last heartbeat (1016h) or command
    (1400h:05).
    """
    started.use(ServoProfile())
    bus = started.bus

    def measured_for_long(*_way: object, meanwhile: Callable[[], None]) -> None:
        assert bus.drives[0].objects[0x1400, 5] == 80
        for _ in range(60):
            meanwhile()
            bus.run_until(bus.now_s + 0.005)

    monkeypatch.setattr("acquisition.task.cyclic_task.refuse_collision", measured_for_long)
    started.run()
    assert started.control.task.error is None
    assert started.control.task.cycles > 0


@pytest.mark.parametrize("code", [StopCode.STOP_COMMAND, StopCode.PROGRAM_GONE])
def test_a_stop_while_the_drives_are_configured_powers_none(
    started: Started, monkeypatch: pytest.MonkeyPatch, code: StopCode
) -> None:
    bring_up = CanServoAxes.bring_up

    def stopped_meanwhile(axes: CanServoAxes) -> None:
        bring_up(axes)
        if code is StopCode.STOP_COMMAND:
            started.control.program.request_stop(code)
        else:
            monkeypatch.setattr("os.getppid", lambda: started.parent + 1)

    monkeypatch.setattr(CanServoAxes, "bring_up", stopped_meanwhile)
    started.run()
    started.assert_stopped_by(code)
    assert started.bus.trace == []


@pytest.mark.parametrize("trial", [True, False])
def test_a_stop_while_the_drives_are_enabled_ends_the_enabling_within_a_cycle(
    started: Started, monkeypatch: pytest.MonkeyPatch, trial: bool
) -> None:
    if not trial:
        started.use(ServoProfile())
    send = started.bus.send
    after: list[bytes] = []

    def send_and_stop(message: can.Message, timeout: float | None = None) -> None:
        send(message, timeout)
        if message.arbitration_id == 0x201:
            word = bytes(message.data[:2])
            if started.control.program.stop_code:
                after.append(word)
            elif word == TOLD_TO_SWITCH_ON:
                started.control.program.request_stop(StopCode.STOP_BUTTON)

    monkeypatch.setattr(started.bus, "send", send_and_stop)
    started.run()
    started.assert_stopped_by(StopCode.STOP_BUTTON)
    assert after[0] == b"\x02\x00"
    assert b"\x0f\x00" not in after


@pytest.mark.parametrize("state", [RecorderState.STARTING, RecorderState.FAILED])
def test_without_a_recorder_no_device_is_opened(
    started: Started, monkeypatch: pytest.MonkeyPatch, state: RecorderState
) -> None:
    monkeypatch.setattr(process, "RECORDER_PATIENCE_S", 0.0)
    started.control.recorder.state = state
    started.run()
    error = started.control.task.error
    assert isinstance(error, RecordingError)
    assert error.refusal == "RID-SYSTEM-PROCESS-DIED"
    assert started.bus.trace == []
    started.bus.shutdown()


def test_a_drive_whose_watchdog_acts_too_late_is_not_moved(
    started: Started, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drivers.servo.watchdog_test.reaction_limit_s", lambda _cell: 1e-3)
    started.run()
    error = started.control.task.error
    assert isinstance(error, PreflightError)
    assert error.refusal == "RID-DRIVE-WATCHDOG"
    assert started.control.task.cycles == 0
    assert not any(axis.powered for axis in started.bus.axes)
