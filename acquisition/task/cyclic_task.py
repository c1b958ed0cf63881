"""`CyclicTask`: the loop that moves the robot, once per cycle time.

Each cycle has these steps:
1. SYNC, and the drives' answers;
2. replacement of lost or implausible positions (`HeldPositions`);
3. position loop and supervisor;
4. the next velocities to the drives;
5. a row for the recorder, and a heartbeat.

A command sent in cycle k acts from SYNC k+1. Deadlines are absolute. If a cycle takes too long, the
cycles that it covers are skipped and counted. They are not executed later. Nothing is logged.
"""

from __future__ import annotations

import math

import numpy as np

from acquisition.journal.cycle_row import CycleRow
from acquisition.motion.approach import approach
from acquisition.motion.collision import refuse_collision
from acquisition.motion.limits import refuse_pose
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.motion.stop_distance import verify_stops
from acquisition.supervision.cycle import Cycle, SetPoint
from acquisition.supervision.held_positions import HeldPositions
from acquisition.supervision.lateness import Lateness
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.supervision.supervisor import Supervisor
from acquisition.task.control_block import ControlBlock
from acquisition.task.lockstep import Lockstep
from acquisition.task.position_loop import PositionLoop
from acquisition.task.ring import Ring
from acquisition.task.set_points import SetPointSource
from acquisition.task.states import Pace, TaskState
from acquisition.task.stop_orders import StopOrders
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


class CyclicTask:
    """Sends set-points to enabled drives; at the end, also after an error, disables the drives.

    Args:
        axes: The drives in cyclic exchange (`start` was called).
        clock: Clock of the bus.
        cell, robot: Cycle time, gains, limits.
        ring: Receives one row per cycle.
        control: Receives progress and stop reason.
        lockstep: True if `clock` is simulated and stands still while this task works; the task then
            waits if the ring is full.
        orders: Orders to stop.
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
        orders: StopOrders,
    ) -> None:
        self._axes = axes
        self._clock = clock
        self._cell = cell
        self._robot = robot
        self._ring = ring
        self._control = control
        self._orders = orders
        self._period_s = cell.cycle_time_s
        self._loop = PositionLoop.of_cell(cell, robot)
        self._lateness = Lateness(cell)
        self._positions = HeldPositions(cell, robot)
        self._supervisor = Supervisor(cell, robot, self._positions)
        self._ending = StopSequence(axes, clock, cell, robot, control.task)
        self._velocity = np.zeros(len(robot.joints))
        self._rest = [0.0] * len(robot.joints)
        self._origin_s = 0.0
        self._cycle = 0
        control.task.pace = Pace.LOCKSTEP if lockstep else Pace.REAL_TIME
        self._lockstep = None
        if lockstep:
            self._lockstep = Lockstep(
                control, ring, cell, lambda: self._find_stop_reason() is not None
            )
        self._unrecorded_s = 0.0  # delay of the latest cycle that wrote no row

    def run(self, source: SetPointSource) -> StopReason | None:
        """Enable the drives, approach, send the source's set-points, hold, stop and disable.

        Args:
            source: The prepared motion; the approach is planned from the robot's present pose.

        Returns:
            Reason for which the motion was stopped before its end, as in the control block; None if
            it was not.

        Raises:
            PreflightError: The robot is outside its limits, the approach or a stop in it would
                collide or end beyond a limit, or the source refuses to begin.
            DriverError: The drives cannot be enabled.
            SafetyStop: A stop was ordered while the drives were being enabled.
        """
        control, axes = self._control, self._axes
        refuse_pose(self._robot, axes.answers.position.tolist())
        source.refuse_begin(axes.answers)
        # A first call of `approach`, so that its one-time costs do not occur between two cycles.
        start = source.begin(self._lockstep is not None, axes.answers.position)
        approach(start, start, self._robot, self._period_s)
        reason = self._find_stop_reason()
        if reason is None:
            self._refuse_approach(start)
            reason = self._find_stop_reason()
        if reason is not None:
            control.task.report_stop(reason)
            return reason
        control.task.state = TaskState.ENABLING
        synced_s = axes.enable()
        refuse_pose(self._robot, axes.answers.position.tolist())
        way = approach(axes.answers.position, start, self._robot, self._period_s)
        self._supervisor.begin(axes.answers)
        self._origin_s = synced_s
        self._cycle = max(1, math.ceil((self._clock.now_s() - synced_s) / self._period_s))
        control.task.state = TaskState.MOVING
        try:
            reason = self._stream_motion(way, source)
        except (DriverError, SafetyStop) as error:
            reason = StopReason(StopCode.BUS, str(error))
        if reason is not None:
            control.task.report_stop(reason)
            control.task.state = TaskState.STOPPING
            self._quick_stop()
        for note in (*source.notes, *axes.bus_notes()):
            control.task.add_note(note)
        self._ending.disable()
        return reason

    def _refuse_approach(self, start: FloatArray) -> None:
        """Check the approach and stops in it before power-on, while heartbeats continue."""
        clearances = Clearances.of(self._robot, self._cell.workspace)
        way = approach(self._axes.answers.position, start, self._robot, self._period_s)
        what = "the approach to the motion"

        def keep_alive() -> None:
            self._axes.keep_alive(self._clock.now_s())

        refuse_collision(clearances, way.position, self._period_s, what, meanwhile=keep_alive)
        verify_stops(way, self._cell, self._robot, clearances, what, meanwhile=keep_alive)

    def _stream_motion(self, way: MotionSamples, source: SetPointSource) -> StopReason | None:
        begin, answers = self._cycle + len(way), self._axes.answers
        ends = source.period_ends
        left_out = 0  # number of rows that are skipped, because enough periods are recorded
        held_until: int | None = None
        position = way.position[-1].tolist()
        while True:
            lateness_s, periods = self._wait_for_cycle()
            reason = self._lateness.judge(lateness_s) or self._find_stop_reason()
            if reason is not None:
                return reason
            row = self._cycle - begin + left_out
            if row in ends and self._has_enough_periods(ends[row]):
                left_out += max(ends) - row
                row = max(ends)
            source.watch(answers)
            target = None
            if held_until is None:
                target = _approach_set_point(way, row) if row < 0 else source.at(row)
            if target is None:
                if held_until is None:
                    held_until = self._cycle + math.ceil(HOLD_S / self._period_s)
                if self._cycle >= held_until:
                    return source.stop
                target = SetPoint(position, self._rest, self._rest, -1, Phase.HOLD)
            position = target.position
            reason = self._run_cycle(target, lateness_s, periods)
            if reason is not None:
                return reason

    def _has_enough_periods(self, periods: int) -> bool:
        """Return True if the program needs no more than this number of whole periods.

        In lock-step, simulated time waits until they are judged. In real time the latest judgement
        counts; a judgement during a period ends the motion after that period.
        """
        control = self._control
        if not control.program.judging:
            return False
        if self._lockstep is not None and not self._lockstep.wait_for_judgement(periods):
            return False
        return control.program.enough

    def _wait_for_cycle(self) -> tuple[float, int]:
        """Wait for the next cycle; return its delay [s] and the elapsed cycle times."""
        deadline_s = self._origin_s + self._cycle * self._period_s
        self._clock.sleep_until(deadline_s)
        lateness_s = max(0.0, self._clock.now_s() - deadline_s)
        skipped = int(lateness_s / self._period_s)
        self._cycle += skipped
        self._unrecorded_s = lateness_s = max(lateness_s, self._unrecorded_s)
        return lateness_s, 1 + skipped

    def _find_stop_reason(self) -> StopReason | None:
        if (reason := self._orders.reason()) is not None:
            return reason
        if self._lockstep is None and (fill := self._ring.fill) > RING_LIMIT:
            return StopReason(
                StopCode.RECORDER,
                f"the recorder is too slow: {fill:.0%} of its buffer is full. Check the disk",
                value=fill,
                limit=RING_LIMIT,
            )
        return None

    def _run_cycle(self, target: SetPoint, lateness_s: float, periods: int) -> StopReason | None:
        cycle = self._exchange(target, lateness_s, periods)
        self._positions.take(cycle)
        cycle.command = self._loop.velocity_command(
            target.position, target.feedforward, self._positions.position
        )
        reason = self._supervisor.judge(cycle) or self._send_command(cycle)
        if reason is not None:
            cycle.command = self._rest
            self._axes.quick_stop()
        full = self._finish_cycle(cycle)
        if self._lockstep is not None:
            self._lockstep.wait_for_monitor(cycle.time_s)
        return reason or full

    def _exchange(self, target: SetPoint, lateness_s: float, periods: int) -> Cycle:
        """Start a cycle and receive the drives' answers."""
        axes = self._axes
        answers = axes.answers
        time_s = axes.exchange()
        exchange_s = self._clock.now_s() - time_s
        return Cycle(
            number=self._cycle,
            periods=periods,
            lateness_s=lateness_s,
            target=target,
            time_s=time_s,
            exchange_s=exchange_s,
            received=answers.received.tolist(),
            enabled=answers.enabled.tolist(),
            fault=answers.fault.tolist(),
            position=answers.position.tolist(),
            torque_nm=answers.torque_nm.tolist(),
            position_counts=answers.position_counts.tolist(),
            torque_raw=answers.torque_raw.tolist(),
            statusword=answers.statusword.tolist(),
            events=axes.take_events(),
            late_frames=answers.late_frames,
            second_answers=answers.second_answers.tolist(),
        )

    def _send_command(self, cycle: Cycle) -> StopReason | None:
        """Send the command of a cycle; if no drive has answered, send nothing and record zero."""
        self._velocity[:] = cycle.command
        if not any(cycle.received):  # otherwise the bus could deliver this command too late
            cycle.command = self._rest
        elif not self._axes.command(self._velocity):
            return StopReason(
                StopCode.NOT_ENABLED, "the drives accept no more commands: a drive is not enabled"
            )
        return None

    def _finish_cycle(self, cycle: Cycle) -> StopReason | None:
        """Send heartbeats and record the cycle; return the stop reason if the row was lost."""
        target = cycle.target
        self._axes.send_heartbeat(self._clock.now_s())
        full = self._record_cycle(cycle)
        self._control.task.set_progress(target.sample_index, target.phase, self._cycle)
        self._cycle += 1
        return full

    def _record_cycle(self, cycle: Cycle) -> StopReason | None:
        self._unrecorded_s = 0.0
        target = cycle.target
        row = CycleRow(
            time_s=cycle.time_s,
            lateness_s=cycle.lateness_s,
            exchange_s=cycle.exchange_s,
            target_position=target.position,
            target_velocity=target.feedforward,
            velocity_command=cycle.command,
            position=cycle.position,
            torque_nm=cycle.torque_nm,
            position_counts=cycle.position_counts,
            cycle=cycle.number,
            sample_index=target.sample_index,
            torque_raw=cycle.torque_raw,
            statusword=cycle.statusword,
            valid=cycle.valid,
            phase=target.phase,
        ).values()
        if self._ring.write(row):
            return None
        if self._lockstep is not None and self._lockstep.wait_for_room():
            self._ring.write(row)
            return None
        full = StopReason(StopCode.RECORDER, "the recorder's buffer is full: a row was lost")
        return self._find_stop_reason() or full

    def _quick_stop(self) -> None:
        position = self._axes.answers.position.tolist()
        here = SetPoint(position, self._rest, self._rest, -1, Phase.HOLD)
        self._ending.come_to_rest(lambda: self._run_stop_cycle(here))

    def _run_stop_cycle(self, here: SetPoint) -> tuple[float, int]:
        """Run one cycle of a quick stop; return its SYNC time [s] and the elapsed cycle times."""
        lateness_s, periods = self._wait_for_cycle()
        cycle = self._exchange(here, lateness_s, periods)
        self._axes.quick_stop()
        cycle.command = self._rest
        cycle.valid = [int(received) for received in cycle.received]
        self._finish_cycle(cycle)
        return cycle.time_s, periods


def _approach_set_point(way: MotionSamples, row: int) -> SetPoint:
    """Return the set-point of a row of the approach; the row is counted from the approach's end."""
    position, velocity = way.position[row].tolist(), way.velocity[row].tolist()
    return SetPoint(position, velocity, velocity, -1, Phase.APPROACH)
