"""`run_cyclic_task`: main function of the process of the cyclic task."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

from acquisition.motion.known_pose import KnownPose
from acquisition.task.control_block import ControlBlock
from acquisition.task.cyclic_task import CyclicTask
from acquisition.task.lockstep import PAUSE_S, RECORDER_PATIENCE_S
from acquisition.task.realtime import disable_garbage_collection, request_realtime
from acquisition.task.ring import Ring
from acquisition.task.service_beat import ServiceBeat
from acquisition.task.set_points import SetPointSource
from acquisition.task.states import RecorderState, TaskState
from acquisition.task.stop_orders import StopOrders
from config.cell.cell import CellConfig
from config.errors import RecordingError, SafetyStop
from config.process.own_process import ProcessName, set_process_name
from config.process.shortage import named_error
from config.process.termination import leave_terminal
from config.robot.robot import RobotDescription
from drivers.cell import open_cell
from drivers.ports.clock import MonotonicClock
from drivers.servo.axes import CanServoAxes
from drivers.servo.watchdog_test import require_watchdogs
from drivers.settings.write_log import WriteLog


@dataclass(frozen=True)
class MotionOwner:
    """Processes without which a motion must stop.

    Attributes:
        parent: Process id of the program.
        service: Heartbeat of the service that ordered the motion, if any.
    """

    parent: int
    service: ServiceBeat | None = None


def run_cyclic_task(
    cell: CellConfig,
    robot: RobotDescription,
    source: SetPointSource,
    ring: Ring,
    control: ControlBlock,
    drive_writes: Path,
    owner: MotionOwner,
    pose: KnownPose | None = None,
) -> None:
    """Run the cyclic task; main function of its process.

    Signals are ignored: the program requests a stop through `control`.

    Args:
        cell, robot, source, ring, control, drive_writes, owner, pose: As for `drive_motion`.
    """
    leave_terminal()
    set_process_name(ProcessName.TASK)
    drive_motion(cell, robot, source, ring, control, drive_writes, owner, pose)


def drive_motion(
    cell: CellConfig,
    robot: RobotDescription,
    source: SetPointSource,
    ring: Ring,
    control: ControlBlock,
    drive_writes: Path,
    owner: MotionOwner,
    pose: KnownPose | None = None,
) -> None:
    """Open the cell and run the cyclic task, in a child process of the program.

    If the program is gone, the motion stops; if the drives are not enabled yet, they are not
    enabled any more.

    Args:
        cell, robot: The cell and its robot.
        source: The motion.
        ring, control: Shared with recorder and program.
        drive_writes: File of the write log.
        owner: Processes without which the motion must stop.
        pose: Last known pose of the robot.
    """
    control.task.state = TaskState.BRING_UP
    axes: CanServoAxes | None = None

    def is_orphaned() -> bool:
        return os.getppid() != owner.parent

    orders = StopOrders(control, is_orphaned, owner.service)
    try:
        _wait_for_recorder(control, orders)
        source.prepare()
        log = WriteLog(drive_writes, durable=not cell.simulated)
        with open_cell(cell, robot, log, stopped=orders.is_stop_ordered) as opened:
            lockstep = not isinstance(opened.clock, MonotonicClock)
            axes = opened.axes
            axes.bring_up()
            require_watchdogs(opened.axes, opened.clock, cell)
            if not lockstep:
                disable_garbage_collection()
                for note in request_realtime():
                    control.task.add_note(note)
            opened.axes.start()
            if pose is not None:
                note = pose.refuse_moved(robot, axes.answers.position.tolist())
                control.task.displaced = note != ""
                if note:
                    control.task.add_note(note)
            CyclicTask(
                opened.axes,
                opened.clock,
                cell,
                robot,
                ring,
                control,
                lockstep=lockstep,
                orders=orders,
            ).run(source)
    except Exception as error:
        reason = orders.reason() if isinstance(error, SafetyStop) else None
        if reason is None:
            control.task.fail(named_error(error))
        else:
            control.task.report_stop(reason)
            for note in getattr(error, "__notes__", ()):
                control.task.add_note(note)
    finally:
        control.task.power_off = axes is not None and axes.without_power
        control.task.state = TaskState.FINISHED


def _wait_for_recorder(control: ControlBlock, orders: StopOrders) -> None:
    """Wait until the recorder has opened its file; otherwise the motion must not begin."""
    until_s = time.monotonic() + RECORDER_PATIENCE_S
    while control.recorder.state is RecorderState.STARTING:
        if orders.is_stop_ordered():
            break
        if time.monotonic() > until_s:
            raise RecordingError(
                f"the recorder has not opened its file within {RECORDER_PATIENCE_S:g} s; nothing"
                " was moved: close other programs, and record again",
                code="RID-SYSTEM-PROCESS-DIED",
            )
        time.sleep(PAUSE_S)
    if control.recorder.state is RecorderState.FAILED:
        failed = control.recorder.error
        code = "RID-SYSTEM-PROCESS-DIED" if failed is None else failed.refusal
        raise RecordingError(f"{failed}; nothing was moved", code=code)
