"""`watch_drives`: read the drives of a cell cyclically without power, as a motion reads them.

The rows are written into a ring in shared memory, in which a service finds them. No recorder reads
this ring, so its old rows are removed here.
"""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from acquisition.journal.cycle_row import CycleRow
from acquisition.motion.samples import Phase
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from acquisition.task.states import MonitorState, Pace, TaskState
from config.cell.cell import CellConfig
from config.cell.drive_profile import DriveProfile
from config.errors import DriverError
from config.load import LoadedCell
from config.robot.robot import RobotDescription
from drivers.cell import Cell, open_cell
from drivers.modbus.drive_monitor import open_drive_monitor
from drivers.ports.clock import MonotonicClock
from rid_daq.operations.cell.watch import WatchRequest
from rid_daq.operations.operation import Context
from rid_daq.session.cells import hold_reachable_cell
from rid_daq.session.drive_writes import new_write_log

RING_ROWS: Final = 16384
SHOW_S: Final = 0.5
"""Time between two lines of progress, on the cell's clock [s]."""


@dataclass
class WatchedJoint:
    """Values of a joint.

    Attributes:
        unit: Unit of the positions, "rad" or "m".
        position_min, position_max: Extremes of the position [rad or m]; None without an answer.
        answers_missing: Number of cycles in which the drive did not answer.
    """

    name: str
    unit: str
    position_min: float | None = None
    position_max: float | None = None
    answers_missing: int = 0

    def note(self, position: float, *, is_received: bool) -> None:
        """Add the answer of one cycle."""
        if not is_received:
            self.answers_missing += 1
            return
        low, high = self.position_min, self.position_max
        self.position_min = position if low is None else min(low, position)
        self.position_max = position if high is None else max(high, position)

    def format_position(self, value: float | None) -> str:
        """Return a position for people, in degrees or millimetres."""
        if value is None:
            return "no answer"
        return f"{1e3 * value:.2f} mm" if self.unit == "m" else f"{math.degrees(value):.2f} °"


@dataclass(frozen=True)
class WatchedDrives:
    """Values of all joints, base to flange, and the number of cycles."""

    joints: tuple[WatchedJoint, ...]
    cycles: int


def watch_drives(loaded: LoadedCell, request: WatchRequest, context: Context) -> WatchedDrives:
    """Read the drives until the time is over, or a stop is requested.

    Raises:
        ConfigError, LockedError: The cell cannot be opened.
        PreflightError: A drive has a wrong setting.
        DriverError: Bus or drives failed.
        SafetyStop: A stop was requested before the first cycle.
        RecordingError: The lock or the write log cannot be used.
    """
    control = ControlBlock.create()
    watch = _Watch(loaded.robot, control, context)
    control.task.state = TaskState.BRING_UP
    try:
        with hold_reachable_cell(loaded, request.simulation) as (reachable, simulated):
            write_log = new_write_log(request.runs) if simulated is None else None
            with (
                open_cell(
                    reachable, loaded.robot, write_log, stopped=watch.is_stop_requested
                ) as opened,
                _temperatures(reachable, loaded.drive_profile, control),
            ):
                opened.axes.bring_up()
                opened.axes.start()
                watch.read(opened, request.seconds)
    finally:
        if watch.is_stop_requested():
            control.task.report_stop(StopReason(StopCode.STOP_COMMAND, "watching was ended"))
            control.task.report_rest(0.0)
        control.task.state = TaskState.FINISHED
    return WatchedDrives(watch.joints, watch.cycle)


class _Watch:
    """Cycles without power.

    Args:
        robot: The robot.
        control: Receives the state; a stop request in it ends the cycles.
        context: Receives the progress.
    """

    def __init__(self, robot: RobotDescription, control: ControlBlock, context: Context) -> None:
        self._control = control
        self._context = context
        self._ring = Ring.create(len(robot.joints), RING_ROWS)
        self._unknown = [math.nan] * len(robot.joints)
        self._rest = [0.0] * len(robot.joints)
        self.joints = tuple(WatchedJoint(joint.name, joint.unit) for joint in robot.joints)
        self.cycle = 0

    def is_stop_requested(self) -> bool:
        return self._control.program.stop_code != 0

    def read(self, opened: Cell, seconds: float) -> None:
        """Run cycles for a time [s] or until a stop; a late cycle postpones the following ones."""
        clock, period_s = opened.clock, opened.config.cycle_time_s
        is_real_time = isinstance(opened.clock, MonotonicClock)
        self._control.task.pace = Pace.REAL_TIME if is_real_time else Pace.LOCKSTEP
        begin_s = due_s = shown_s = clock.now_s()
        with self._context.progress("watching", seconds, "s") as progress:
            while due_s - begin_s < seconds and not self.is_stop_requested():
                due_s = max(due_s + period_s, clock.now_s())
                clock.sleep_until(due_s)
                self._run_cycle(opened, due_s)
                if due_s >= shown_s + SHOW_S:
                    shown_s = due_s
                    progress.update(min(seconds, due_s - begin_s), self._line(opened))

    def _run_cycle(self, opened: Cell, due_s: float) -> None:
        axes, clock = opened.axes, opened.clock
        sync_s = axes.exchange()
        exchange_s = clock.now_s() - sync_s
        axes.send_heartbeat(clock.now_s())
        axes.quick_stop()  # the drives need a command in each cycle; this command moves nothing
        axes.take_events()
        self.cycle += 1
        answers = axes.answers
        position, received = answers.position.tolist(), answers.received.tolist()
        row = CycleRow(
            time_s=sync_s,
            lateness_s=sync_s - due_s,
            exchange_s=exchange_s,
            target_position=self._unknown,
            target_velocity=self._rest,
            velocity_command=self._rest,
            position=position,
            torque_nm=answers.torque_nm.tolist(),
            position_counts=answers.position_counts.tolist(),
            cycle=self.cycle,
            sample_index=-1,
            torque_raw=answers.torque_raw.tolist(),
            statusword=answers.statusword.tolist(),
            valid=received,
            phase=Phase.HOLD,
        ).values()
        if not self._ring.write(row):
            self._ring.read(RING_ROWS // 2)
            self._ring.write(row)
        self._control.task.set_progress(-1, Phase.HOLD, self.cycle)
        for joint, value, is_received in zip(self.joints, position, received, strict=True):
            joint.note(value, is_received=is_received)

    def _line(self, opened: Cell) -> str:
        position = opened.axes.answers.position.tolist()
        each = zip(self.joints, position, strict=True)
        return ", ".join(f"{joint.name} {joint.format_position(value)}" for joint, value in each)


@contextlib.contextmanager
def _temperatures(
    cell: CellConfig, profile: DriveProfile | None, control: ControlBlock
) -> Iterator[None]:
    """Read the motors' temperatures in a thread, if the cell has a drive monitor."""
    if cell.monitor is None or profile is None:
        yield
        return
    config, over = cell.monitor, threading.Event()
    control.program.announce_monitor(len(cell.axes))

    def read() -> None:
        try:
            with open_drive_monitor(config, profile) as monitor:
                control.monitor.state = MonitorState.POLLING
                while not over.is_set():
                    reading = monitor.read()
                    control.monitor.show_temperatures(
                        reading.temperature_k.tolist(), reading.problems
                    )
                    over.wait(config.period_s)
        except DriverError as error:
            control.monitor.fail(error)

    thread = threading.Thread(target=read, name="temperatures", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
