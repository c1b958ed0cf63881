"""The process that the cyclic task runs in, alone."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

from acquisition.motion.known_pose import KnownPose
from acquisition.task.control_block import ControlBlock
from acquisition.task.cyclic_task import CyclicTask
from acquisition.task.lockstep import PAUSE_S, RECORDER_PATIENCE_S
from acquisition.task.realtime import become_realtime, freeze_garbage
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
from drivers.servo.watchdog_test import prove_watches
from drivers.settings.write_log import WriteLog


@dataclass(frozen=True)
class Ordering:
    """Who has ordered a motion, and without whom it stops.

    Attributes:
        parent: Process id of the program.
        service: Signs of life of the service that has ordered the motion, if one has.
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
    ordering: Ordering,
    pose: KnownPose | None = None,
) -> None:
    """Run the cyclic task; the main function of its process.

    Signals are ignored: the program asks for a stop through `control`. When the program is
    gone the motion is stopped all the same; before the drives have power they get none any more.

    Args:
        cell, robot: The cell and its robot.
        source: The motion.
        ring, control: Shared with recorder and program.
        drive_writes: Where what is written to the drives is kept.
        ordering: Who has ordered the motion.
        pose: Where the robot was seen last.
    """
    leave_terminal()
    set_process_name(ProcessName.TASK)
    control.task.state = TaskState.BRING_UP
    axes: CanServoAxes | None = None

    def orphaned() -> bool:
        return os.getppid() != ordering.parent

    orders = StopOrders(control, orphaned, ordering.service)
    try:
        _await_recorder(control, orders)
        source.prepare()
        log = WriteLog(drive_writes, durable=not cell.simulated)
        with open_cell(cell, robot, log, stopped=orders.given) as opened:
            lockstep = not isinstance(opened.clock, MonotonicClock)
            axes = opened.axes
            axes.bring_up()
            prove_watches(opened.axes, opened.clock, cell)
            freeze_garbage()
            if not lockstep:
                for note in become_realtime():
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


def _await_recorder(control: ControlBlock, orders: StopOrders) -> None:
    """Wait until the recorder has its file: nothing is moved that is not recorded."""
    until_s = time.monotonic() + RECORDER_PATIENCE_S
    while control.recorder.state is RecorderState.STARTING:
        if orders.given():
            break
        if time.monotonic() > until_s:
            raise RecordingError(
                "the recorder did not start; nothing was moved", code="RID-SYSTEM-PROCESS-DIED"
            )
        time.sleep(PAUSE_S)
    if control.recorder.state is RecorderState.FAILED:
        failed = control.recorder.error
        code = "RID-SYSTEM-PROCESS-DIED" if failed is None else failed.refusal
        raise RecordingError(f"{failed}; nothing was moved", code=code)
