"""Fixtures: a small cell, and ideal drives in the test's process on a simulated clock."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import MotionSamples
from config.cell.cell import CanBusConfig, CellConfig, DriveAxis, Supervision
from config.cell.drive_safety import DriveSafety
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from drivers.interfaces.servo_axes import Answers, DriveEvent, DriveSetting

PERIOD_S = 0.008
DECELERATION = 20.0
COUNTS_PER_RAD = 100_000.0


class SteppedClock:
    """Simulated clock; it advances by sleeps, or if a test changes `time_s`.

    `oversleep_s` maps the number of a sleep (from 1) to its delay in s.
    """

    def __init__(self) -> None:
        self.time_s = 0.0
        self.oversleep_s: dict[int, float] = {}
        self.sleeps = 0

    def now_s(self) -> float:
        return self.time_s

    def sleep_until(self, time_s: float) -> None:
        self.sleeps += 1
        self.time_s = max(self.time_s, time_s) + self.oversleep_s.get(self.sleeps, 0.0)


class FakeAxes:
    """Ideal velocity servos: a command acts at the next SYNC, a quick stop ramps down.

    `script(axes, cycle)` is called in each cycle after the answers have been stored in the arrays.
    It can change the answers to simulate a fault of the bus or a drive.
    """

    def __init__(self, clock: SteppedClock, joint_names: tuple[str, ...]) -> None:
        n = len(joint_names)
        self.clock = clock
        self.joint_names = joint_names
        self.true_position = np.array([0.1, -0.2, 0.3])[:n]
        self.true_velocity = np.zeros(n)
        self.answers = Answers.initial(n)
        self.answers.position[:] = self.true_position
        self.answers_within_s = 0.6 * PERIOD_S
        self.events: list[DriveEvent] = []
        self.script: Callable[[FakeAxes, int], None] = lambda axes, cycle: None
        self.cycle = 0
        self.calls: list[str] = []
        self.sent: list[list[float]] = []
        self.sync_times_s: list[float] = []
        self.stopped_at: int | None = None
        self.reversed_joint: int | None = None
        self.unconfirmed: tuple[str, ...] = ()
        self._pending = np.zeros(n)
        self._stopping = False

    def bring_up(self) -> None:
        self.calls.append("bring_up")

    def settings(self) -> tuple[DriveSetting, ...]:
        return ()

    def start(self) -> None:
        self.calls.append("start")

    def keep_alive(self, now_s: float) -> None:
        pass

    def enable(self) -> float:
        self.calls.append("enable")
        self.answers.enabled[:] = True
        self.sync_times_s.append(self.clock.now_s())
        return self.clock.now_s()

    def exchange(self) -> float:
        now_s = self.clock.now_s()
        elapsed_s = now_s - self.sync_times_s[-1]
        self.true_position += self.true_velocity * elapsed_s
        self.sync_times_s.append(now_s)
        if self._stopping:
            change = DECELERATION * elapsed_s
            self.true_velocity -= np.clip(self.true_velocity, -change, change)
        else:
            self.true_velocity[:] = self._pending
        self.cycle += 1
        answers = self.answers
        answers.received[:] = True
        answers.position[:] = self.true_position
        answers.position_counts[:] = np.round(self.true_position * COUNTS_PER_RAD)
        answers.torque_nm[:] = 5.0 * self.true_velocity
        self.clock.time_s += 0.001
        self.script(self, self.cycle)
        return now_s

    def command(self, velocity: NDArray[np.float64]) -> bool:
        if self._stopping:
            return False
        self.sent.append(velocity.tolist())
        self._pending[:] = velocity
        if self.reversed_joint is not None:
            self._pending[self.reversed_joint] *= -1.0
        return True

    def send_heartbeat(self, now_s: float) -> None:
        pass

    def bus_notes(self) -> tuple[str, ...]:
        return ()

    def take_events(self) -> tuple[DriveEvent, ...]:
        events, self.events = tuple(self.events), []
        return events

    def quick_stop(self) -> None:
        self._stopping = True
        if self.stopped_at is None:
            self.stopped_at = self.cycle
            self.calls.append("quick_stop")

    def halt(self) -> bool:
        return True

    def disable(self) -> tuple[str, ...]:
        self.calls.append("disable")
        self.answers.enabled[:] = False
        return self.unconfirmed


@pytest.fixture
def clock() -> SteppedClock:
    return SteppedClock()


@pytest.fixture
def robot() -> RobotDescription:
    limits = JointLimits(
        position_min=-2.0, position_max=2.0, velocity=2.0, acceleration=10.0, torque=100.0
    )
    return RobotDescription(
        name="test-arm",
        kinematics=Kinematics(convention="modified_dh", rows=(KinematicRow(),) * 3),
        joints=tuple(Joint(name=f"joint{i}", limits=limits, gear_ratio=100.0) for i in (1, 2, 3)),
    )


@pytest.fixture
def cell() -> CellConfig:
    return CellConfig(
        name="test-cell",
        robot="test-arm",
        cycle_time_ms=8,
        can=CanBusConfig(interface="virtual", channel="none"),
        axes=tuple(DriveAxis(joint=f"joint{i}", node_id=i) for i in (1, 2, 3)),
        position_gain_per_s=10.0,
        drive_safety=DriveSafety(
            quick_stop_deceleration_rad_s2=DECELERATION, following_error_rad=0.1
        ),
        supervision=Supervision(),
    )


@pytest.fixture
def axes(clock: SteppedClock, robot: RobotDescription) -> FakeAxes:
    return FakeAxes(clock, robot.joint_names)


@pytest.fixture
def motion(robot: RobotDescription) -> MotionSamples:
    """Three periods of 0.8 s; the first period is the transient."""
    joints = tuple(
        FourierJoint(joint=name, offset=0.0, sine=(0.1,), cosine=(0.05,))
        for name in robot.joint_names
    )
    return FourierMotion(
        kind="fourier",
        robot="test-arm",
        period_s=0.8,
        periods=2,
        transient_periods=1,
        ramp_s=0.8,
        joints=joints,
    ).plan(
        robot,
        PERIOD_S,
    )
