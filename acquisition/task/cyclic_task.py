"""`CyclicTask`: the loop that moves the robot, one cycle time after the other.

A cycle: SYNC, the drives' answers, the supervisor, the position loop, the next velocities, a row
for the recorder, a sign of life. What is sent in cycle k acts at SYNC k+1. Deadlines are absolute;
a cycle that was overrun is skipped and counted, never made up for. Nothing is logged.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np

from acquisition.motion.approach import approach
from acquisition.motion.collision import refuse_collision
from acquisition.motion.limits import refuse_pose
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.supervision.cycle import SetPoint
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.supervision.supervisor import Supervisor
from acquisition.task.control_block import ControlBlock, Pace, RecorderState, TaskState
from acquisition.task.monitor_rounds import MonitorRounds
from acquisition.task.position_loop import PositionLoop
from acquisition.task.ring import Ring
from acquisition.task.set_points import SetPointSource
from acquisition.task.stop_sequence import StopSequence
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.errors import DriverError, SafetyStop
from config.robot.robot import RobotDescription
from drivers.interfaces.servo_axes import ServoAxes
from drivers.ports.clock import Clock
from dynamics.geometry.clearances import Clearances

HOLD_S = 0.2
RING_LIMIT = 0.8
RECORDER_PATIENCE_S = 30.0
PAUSE_S = 0.001
JUDGE_PATIENCE_S = 60.0

_TEXT_OF_ORDER = {
    StopCode.INTERRUPTED: "stopped by the operator",
    StopCode.STOP_COMMAND: "stopped by `rid-daq stop`",
    StopCode.STOP_BUTTON: "stopped by the live page's stop button",
    StopCode.RECORDER: "the recorder process has died; what it had written is kept",
    StopCode.PLATE_LINE: "the force plate's rows have ended",
    StopCode.PLATE_OVERLOAD: "the force plate was overloaded in more periods than can be left out",
}


class CyclicTask:
    """Streams set-points to enabled drives and stops them, whatever happens.

    Parameters
    ----------
    axes : ServoAxes
        The drives, in the cyclic exchange (`start` was called).
    clock : Clock
        The clock of their bus.
    cell, robot : CellConfig, RobotDescription
        Cycle time, gains, limits.
    ring : Ring
        Takes a row a cycle.
    control : ControlBlock
        Stop requests in, progress and the reason of a stop out.
    lockstep : bool
        Whether `clock` is a simulated one, that stands still while this task works: then a full
        ring is waited for.
    orphaned : callable
        Whether the program that started this task is gone.
    """

    def __init__(
        self,
        axes: ServoAxes,
        clock: Clock,
        cell: CellConfig,
        robot: RobotDescription,
        ring: Ring,
        control: ControlBlock,
        *,
        lockstep: bool,
        orphaned: Callable[[], bool],
    ) -> None:
        self._axes = axes
        self._clock = clock
        self._cell = cell
        self._robot = robot
        self._ring = ring
        self._control = control
        self._lockstep = lockstep
        self._orphaned = orphaned
        self._period_s = cell.cycle_time_s
        self._loop = PositionLoop.of_cell(cell, robot)
        self._supervisor = Supervisor(cell, robot)
        self._ending = StopSequence(axes, clock, cell, robot, control)
        self._velocity = np.zeros(len(robot.joints))
        self._rest = [0.0] * len(robot.joints)
        self._origin_s = 0.0
        self._cycle = 0
        self._late_frames = 0
        control.pace = Pace.LOCKSTEP if lockstep else Pace.REAL_TIME
        self._monitor = None
        if lockstep and control.monitored and cell.monitor is not None:
            self._monitor = MonitorRounds(control, cell.monitor.period_s, cell.cycle_time_s)
        self._unrecorded_s = 0.0  # lateness of a cycle that was given up before its row

    def run(self, source: SetPointSource) -> StopReason | None:
        """Enable the drives, approach, stream the source's set-points, hold, stop and disable.

        Parameters
        ----------
        source : SetPointSource
            The motion, prepared; the way to its start is planned from where the robot stands.

        Returns
        -------
        StopReason or None
            Why the motion was stopped before its end; the same is in the control block.

        Raises
        ------
        PreflightError
            The robot stands outside its limits, or the way to the motion is blocked.
        DriverError
            The drives cannot be enabled.
        """
        control, axes = self._control, self._axes
        # once before it counts, so that no first-time cost falls between two cycles
        start = source.begin(self._lockstep)
        approach(start, start, self._robot, self._period_s)
        reason = self._order_to_stop()
        if reason is not None:
            control.report_stop(reason)
            return reason
        self._refuse_collision(start)
        control.task_state = TaskState.ENABLING
        synced_s = axes.enable()
        position = axes.answers.position.tolist()
        refuse_pose(self._robot, position)
        way = approach(axes.answers.position, start, self._robot, self._period_s)
        self._supervisor.begin(position)
        self._late_frames = axes.answers.late_frames
        self._origin_s = synced_s
        self._cycle = max(1, math.ceil((self._clock.now_s() - synced_s) / self._period_s))
        control.task_state = TaskState.MOVING
        try:
            reason = self._stream(way, source)
        except (DriverError, SafetyStop) as error:
            reason = StopReason(StopCode.BUS, str(error))
        if reason is not None:
            control.report_stop(reason)
            control.task_state = TaskState.STOPPING
            self._stop()
        for note in (*source.notes, *axes.bus_notes()):
            control.add_note(note)
        self._ending.disable()
        return reason

    def _refuse_collision(self, start: FloatArray) -> None:
        """Measure the way to the motion, still without power, with signs of life in between."""
        clearances = Clearances.of(self._robot, self._cell.workspace)
        position = self._axes.answers.position
        refuse_pose(self._robot, position.tolist())
        way = approach(position, start, self._robot, self._period_s)
        refuse_collision(
            clearances,
            way.position,
            self._period_s,
            "the way to the motion's start",
            meanwhile=lambda: self._axes.send_heartbeat(self._clock.now_s()),
        )

    def _stream(self, way: MotionSamples, source: SetPointSource) -> StopReason | None:
        begin = self._cycle + len(way)
        ends = source.period_ends
        left_out = 0  # rows of the motion that are not driven, since enough was seen
        held_until: int | None = None
        position = way.position[-1].tolist()
        while True:
            lateness_s, periods = self._wake()
            reason = self._supervisor.check_timing(lateness_s) or self._order_to_stop()
            if reason is not None:
                return reason
            row = self._cycle - begin + left_out
            if row in ends and self._seen_enough(ends[row]):
                left_out += max(ends) - row
                row = max(ends)
            target = None
            if held_until is None:
                target = _on_the_way(way, row) if row < 0 else source.at(row)
            if target is None:
                if held_until is None:
                    held_until = self._cycle + math.ceil(HOLD_S / self._period_s)
                if self._cycle >= held_until:
                    return source.stop
                target = SetPoint(position, self._rest, self._rest, -1, Phase.HOLD)
            position = target.position
            reason = self._move(target, lateness_s, periods)
            if reason is not None:
                return reason

    def _seen_enough(self, periods: int) -> bool:
        """Return whether the program has seen enough after so many whole periods.

        In lock-step simulated time stands still until they are judged; else the program's latest
        word counts, and what it says during a period ends the motion after that period.
        """
        control = self._control
        if not control.judging:
            return False
        if self._lockstep:
            until_s = time.monotonic() + JUDGE_PATIENCE_S
            while control.periods_judged < periods and time.monotonic() < until_s:
                if self._order_to_stop() is not None:
                    return False
                control.beat_task()  # a judgement may take longer than a task may be silent
                time.sleep(PAUSE_S)
        return control.enough

    def _wake(self) -> tuple[float, int]:
        """Sleep to the next cycle; return how late it begins [s] and how many periods passed."""
        deadline_s = self._origin_s + self._cycle * self._period_s
        self._clock.sleep_until(deadline_s)
        lateness_s = max(0.0, self._clock.now_s() - deadline_s)
        skipped = int(lateness_s / self._period_s)
        self._cycle += skipped
        self._unrecorded_s = lateness_s = max(lateness_s, self._unrecorded_s)
        return lateness_s, 1 + skipped

    def _order_to_stop(self) -> StopReason | None:
        control = self._control
        if control.stop_code:
            code = StopCode(control.stop_code)
            return StopReason(code, _TEXT_OF_ORDER.get(code, code.name.lower()))
        if control.recorder_state in (RecorderState.FAILED, RecorderState.ENDING):
            return StopReason(StopCode.RECORDER, control.recorder_error)
        if not self._lockstep and (fill := self._ring.fill) > RING_LIMIT:
            return StopReason(
                StopCode.RECORDER,
                f"the recorder is behind: {fill:.0%} of its buffer waits. Check the disk",
                value=fill,
                limit=RING_LIMIT,
            )
        if self._orphaned():
            return StopReason(StopCode.PROGRAM_GONE, "the program that started the motion is gone")
        return None

    def _move(self, target: SetPoint, lateness_s: float, periods: int) -> StopReason | None:
        axes, supervisor = self._axes, self._supervisor
        answers = axes.answers
        time_s, exchange_s = self._exchange()
        late_frames = answers.late_frames - self._late_frames
        self._late_frames = answers.late_frames
        reason = (
            supervisor.check_events(axes.take_events())
            or supervisor.check_late_frames(late_frames)
            or supervisor.check_second_answers(answers.second_answers.tolist())
            or supervisor.check_target(target.position, target.velocity, periods)
            or supervisor.check_measured(
                answers,
                target.position,
                target.velocity,
                periods,
            )
        )
        command = self._rest
        if reason is None:
            wanted = self._loop.velocity_command(
                target.position, target.feedforward, supervisor.position
            )
            reason = supervisor.check_set_point(target.position, target.velocity, wanted, periods)
            if reason is None:
                self._velocity[:] = wanted
                if not answers.received.any():
                    command = self._rest  # a bus without drives would keep it for their return
                elif axes.command(self._velocity):
                    command = wanted
                else:
                    reason = StopReason(
                        StopCode.NOT_ENABLED, "the drives took no more commands: one is not enabled"
                    )
        if reason is not None:
            axes.quick_stop()
        axes.send_heartbeat(self._clock.now_s())
        full = self._write(target, time_s, lateness_s, exchange_s, command, supervisor.valid)
        self._control.set_progress(target.sample_index, target.phase, self._cycle)
        self._cycle += 1
        if self._monitor is not None:
            self._monitor.ask_when_due(time_s, lambda: self._order_to_stop() is not None)
        return reason or full

    def _exchange(self) -> tuple[float, float]:
        """Do the exchange; return the time of SYNC and how long the answers took [s]."""
        time_s = self._axes.exchange()
        return time_s, self._clock.now_s() - time_s

    def _write(
        self,
        target: SetPoint,
        time_s: float,
        lateness_s: float,
        exchange_s: float,
        command: list[float],
        valid: list[int],
    ) -> StopReason | None:
        answers = self._axes.answers
        self._unrecorded_s = 0.0
        row = (
            time_s,
            lateness_s,
            exchange_s,
            *target.position,
            *target.feedforward,
            *command,
            *answers.position.tolist(),
            *answers.torque_nm.tolist(),
            *answers.position_counts.tolist(),
            self._cycle,
            target.sample_index,
            *answers.torque_raw.tolist(),
            *answers.statusword.tolist(),
            *valid,
            target.phase,
        )
        if self._ring.write(row):
            return None
        if self._lockstep and self._wait_for_room():
            self._ring.write(row)
            return None
        full = StopReason(StopCode.RECORDER, "the recorder's buffer is full: a row was lost")
        return self._order_to_stop() or full

    def _wait_for_room(self) -> bool:
        """Let simulated time stand still until the recorder has made room."""
        until_s = time.monotonic() + RECORDER_PATIENCE_S
        while time.monotonic() < until_s:
            if self._ring.waiting < self._ring.capacity:
                return True
            if self._recorder_gone():
                return False
            time.sleep(PAUSE_S)
        return False

    def _recorder_gone(self) -> bool:
        control = self._control
        failed = control.recorder_state is RecorderState.FAILED
        return failed or control.stop_code == StopCode.RECORDER

    def _stop(self) -> None:
        position = self._axes.answers.position.tolist()
        here = SetPoint(position, self._rest, self._rest, -1, Phase.HOLD)
        self._ending.come_to_rest(lambda: self._stop_cycle(here))

    def _stop_cycle(self, here: SetPoint) -> tuple[float, int]:
        """Do a cycle of a quick stop; return the time of SYNC [s] and how many periods passed."""
        axes = self._axes
        lateness_s, periods = self._wake()
        time_s, exchange_s = self._exchange()
        axes.quick_stop()
        axes.send_heartbeat(self._clock.now_s())
        valid = [int(received) for received in axes.answers.received.tolist()]
        self._write(here, time_s, lateness_s, exchange_s, self._rest, valid)
        self._control.set_progress(-1, Phase.HOLD, self._cycle)
        self._cycle += 1
        return time_s, periods


def _on_the_way(way: MotionSamples, row: int) -> SetPoint:
    """Return the set-point of a row of the approach, counted from its end."""
    position, velocity = way.position[row].tolist(), way.velocity[row].tolist()
    return SetPoint(position, velocity, velocity, -1, Phase.APPROACH)
