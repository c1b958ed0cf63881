"""A simulated cell in the test's process with ideal drives and axes."""

from __future__ import annotations

import heapq
import itertools
import re
from collections import deque
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import can
import numpy as np

from acquisition.supervision.cycle import SetPoint
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.cyclic_task import CyclicTask
from acquisition.task.ring import Ring
from acquisition.task.stop_orders import StopOrders
from config.cell.cell import CanBusConfig, CellConfig, DriveAxis
from config.cell.drive_safety import DriveSafety
from config.errors import RidDaqError
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from drivers.canopen.frames import REMOTE_FLAG, Frame
from drivers.cell import Cell
from drivers.interfaces.servo_axes import DriveSetting
from drivers.ports.can_link import CanLink
from drivers.servo.cia402 import AxisUnits
from mock_hw.drive.axis import AxisPort
from mock_hw.drive.drive import SimulatedDrive
from mock_hw.drive.objects import SimulatedIdentity

WIRE_S = 120e-6
STEP_S = 0.002


class IdealAxis(AxisPort):
    """An axis that follows its drive's ramp exactly; without power it stops at once."""

    def __init__(self, counts: float) -> None:
        self.counts = counts
        self.rate = 0.0
        self.powered = False
        self.torque = 0

    def position_counts(self) -> int:
        return round(self.counts)

    def velocity_counts_s(self) -> float:
        return self.rate

    def torque_permille(self) -> int:
        return self.torque

    def digital_inputs(self) -> int:
        return 0


class Clock:
    def __init__(self, bus: ObedientCell) -> None:
        self._bus = bus

    def now_s(self) -> float:
        return self._bus.now_s

    def sleep_until(self, time_s: float) -> None:
        self._bus.run_until(time_s)


class ObedientCell(can.BusABC):
    """A bus with simulated drives; time advances only while the master waits.

    Attributes:
        trace: Time [s], position [rad], speed [rad/s] and power state of every axis for each step,
            since the first power-on.
    """

    channel_info = "obedient"

    def __init__(
        self,
        cell: CellConfig,
        robot: RobotDescription,
        increments: int,
        *,
        referenced: bool = True,
    ) -> None:
        super().__init__("obedient")
        self.now_s = 0.0
        self.simulated_clock = Clock(self)
        self.axes: list[IdealAxis] = []
        self.drives: list[SimulatedDrive] = []
        self.units: list[AxisUnits] = []
        self.trace: list[tuple[float, tuple[float, ...], tuple[float, ...], tuple[bool, ...]]] = []
        self._events: list[tuple[float, int, Frame]] = []
        self._number = itertools.count()
        self._arrived: deque[tuple[float, Frame]] = deque()
        for axis, joint in zip(cell.axes, robot.joints, strict=True):
            rated_mnm = max(1, round(1000.0 * joint.limits.torque / abs(joint.gear_ratio) / 3.0))
            gear = Fraction(abs(joint.gear_ratio)).limit_denominator(1_000_000)
            profile = cell.servo_of(axis)
            motor_increments = round(profile.encoder_increments or increments)
            identity = SimulatedIdentity(
                axis.node_id, motor_increments, gear, rated_mnm, profile, referenced
            )
            units = AxisUnits.of_motor(identity.motor, profile, joint.gear_ratio, axis.direction)
            middle = 0.5 * (joint.limits.position_min + joint.limits.position_max)
            self.units.append(units)
            self.axes.append(IdealAxis(units.counts(middle)))
            self.drives.append(SimulatedDrive(identity, self.axes[-1]))

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        remote = REMOTE_FLAG if msg.is_remote_frame else 0
        frame = Frame(remote | msg.arbitration_id, bytes(msg.data))
        for drive in self.drives:
            drive.receive(frame, self.now_s)
        self._take()

    def recv(self, timeout: float | None = None) -> can.Message | None:
        assert timeout is not None, "a driver must not wait without a timeout"
        until_s = self.now_s + timeout
        while not self._arrived and self.now_s < until_s:
            self._advance(until_s)
        if not self._arrived:
            return None
        time_s, frame = self._arrived.popleft()
        return can.Message(
            timestamp=time_s, arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False
        )

    def run_until(self, time_s: float) -> None:
        while self.now_s < time_s:
            self._advance(time_s)

    def _advance(self, until_s: float) -> None:
        """Advance to the next arrival of a frame or action of a drive, at most to `until_s`."""
        due_s = min((drive.next_s for drive in self.drives), default=until_s)
        if self._events:
            due_s = min(due_s, self._events[0][0])
        end_s = max(self.now_s, min(due_s, until_s))
        while self.now_s < end_s:
            powered = any(drive.power.powered for drive in self.drives)
            self._step(min(end_s, self.now_s + STEP_S) if powered else end_s)
        for drive in self.drives:
            if drive.next_s <= self.now_s:
                drive.advance(self.now_s)
        self._take()
        while self._events and self._events[0][0] <= self.now_s:
            time_s, _, frame = heapq.heappop(self._events)
            self._arrived.append((time_s, frame))

    def _step(self, end_s: float) -> None:
        for axis, drive in zip(self.axes, self.drives, strict=True):
            command = drive.axis.command(self.now_s, end_s)
            axis.powered = command.powered
            mean = 0.5 * (command.velocity_start + command.velocity_end)
            axis.rate = command.velocity_end if command.powered else 0.0
            axis.counts += mean * (end_s - self.now_s) if command.powered else 0.0
        self.now_s = end_s
        for drive in self.drives:
            drive.axis.observe(end_s)
        if not self.trace and not any(axis.powered for axis in self.axes):
            return
        pairs = list(zip(self.axes, self.units, strict=True))
        self.trace.append(
            (
                end_s,
                tuple(axis.counts / units.counts_per_rad for axis, units in pairs),
                tuple(abs(axis.rate / units.counts_per_rad) for axis, units in pairs),
                tuple(axis.powered for axis in self.axes),
            )
        )

    def _take(self) -> None:
        for drive in self.drives:
            for earliest_s, frame in drive.take_frames():
                time_s = max(earliest_s, self.now_s) + WIRE_S
                heapq.heappush(self._events, (time_s, next(self._number), frame))

    def shutdown(self) -> None:
        super().shutdown()


RING = {joints: Ring.create(joints, 8192) for joints in (1, 2)}


class SpeedUp:
    """Set-points that accelerate all joints to their speed limits; then a stop is requested."""

    samples_per_period = None
    period_ends: Mapping[int, int] = {}
    stop = None
    notes = ()

    def __init__(
        self, cell: CellConfig, robot: RobotDescription, rows: int, sign: int, control: ControlBlock
    ) -> None:
        self.rows_expected = rows
        self._period_s = cell.cycle_time_s
        self._limits = [joint.limits for joint in robot.joints]
        self._sign = sign
        self._control = control
        self._middle = [0.5 * (x.position_min + x.position_max) for x in self._limits]

    def prepare(self) -> None:
        pass

    def refuse_begin(self, answers: Any) -> None:
        pass

    def begin(self, lockstep: bool, position: Any) -> Any:
        return np.array(self._middle)

    def watch(self, answers: Any) -> None:
        pass

    def at(self, row: int) -> SetPoint | None:
        if row >= self.rows_expected:
            self._control.program.request_stop(StopCode.INTERRUPTED)
        time_s = row * self._period_s
        position, velocity = [], []
        for limits, middle in zip(self._limits, self._middle, strict=True):
            rising_s = min(time_s, limits.velocity / limits.acceleration)
            speed = self._sign * limits.acceleration * rising_s
            moved = speed * (0.5 * rising_s + time_s - rising_s)
            position.append(min(max(middle + moved, limits.position_min), limits.position_max))
            velocity.append(speed)
        return SetPoint(position, velocity, velocity, row, 0)


class Outcome:
    """Outcome for one cell: an error, or the motion and its stop."""

    def __init__(
        self, cell: CellConfig, robot: RobotDescription, increments: int, rows: int, sign: int
    ) -> None:
        self.bus = ObedientCell(cell, robot, increments)
        self.reason: StopReason | None = None
        self.error: RidDaqError | None = None
        self.settings: tuple[DriveSetting, ...] = ()
        self.ordered_s = np.inf
        control = ControlBlock.create()
        ring = RING[len(robot.joints)]
        try:
            with Cell(cell, robot, CanLink(self.bus)) as opened:
                try:
                    opened.axes.bring_up()
                finally:
                    self.settings = opened.axes.settings()
                opened.axes.start()
                quick_stop = opened.axes.quick_stop

                def stopped() -> None:
                    self.ordered_s = min(self.ordered_s, self.bus.now_s)
                    quick_stop()

                opened.axes.quick_stop = stopped  # type: ignore[method-assign]
                task = CyclicTask(
                    opened.axes, opened.clock, cell, robot, ring, control,
                    lockstep=True, orders=StopOrders(control, lambda: False),
                )  # fmt: skip
                self.reason = task.run(SpeedUp(cell, robot, rows, sign, control))
        except RidDaqError as error:
            self.error = error
        finally:
            ring.read(8192)
        self.notes = control.task.notes
        self.bus.run_until(self.bus.now_s + 0.05)

    def stated_s(self, joint: str) -> float:
        """Return the time of a joint's stop from top speed that the preflight shows [s]."""
        (shown,) = (
            s
            for s in self.settings
            if s.joint == joint and s.name.startswith("stop from top speed")
        )
        return float(re.match(r"[\d.e-]+", shown.found)[0])  # type: ignore[index]


def one_axis(
    *, deceleration: float, velocity: float, acceleration: float, limit: float
) -> tuple[CellConfig, RobotDescription]:
    """Return a cell with one axis whose position limits are -`limit` and `limit`, and its robot."""
    cell = CellConfig(
        name="one",
        robot="one",
        cycle_time_ms=8,
        can=CanBusConfig(interface="virtual", channel="one"),
        axes=(DriveAxis(joint="joint", node_id=1),),
        position_gain_per_s=10.0,
        drive_safety=DriveSafety(
            quick_stop_deceleration_rad_s2=deceleration, following_error_rad=0.1
        ),
    )
    limits = JointLimits(
        position_min=-limit,
        position_max=limit,
        velocity=velocity,
        acceleration=acceleration,
        torque=300.0,
    )
    kinematics = Kinematics(convention="modified_dh", rows=(KinematicRow(a_m=0.1),))
    joint = Joint(name="joint", gear_ratio=100.0, limits=limits)
    return cell, RobotDescription(name="one", kinematics=kinematics, joints=(joint,))


def rows_until(cell: CellConfig, robot: RobotDescription, position: float) -> int:
    """Return the number of cycles in which `SpeedUp` moves the first joint from 0 to a position."""
    limits = robot.joints[0].limits
    rising_s = limits.velocity / limits.acceleration
    left = position - 0.5 * limits.velocity * rising_s
    return round((rising_s + left / limits.velocity) / cell.cycle_time_s)
