"""`DriveRack`: a simulated robot with its drives, which advance in time together."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from config.cell.cell import CellConfig, DriveAxis
from config.cell.servo_profile import ServoProfile
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from config.simulation.faults import NO_SCRIPT, FaultScript
from config.simulation.plant import PlantConfig
from drivers.canopen.frames import SYNC_COB_ID, Frame
from drivers.servo.cia402 import AxisUnits, MotorRatings
from mock_hw.drive.axis import AxisPort
from mock_hw.drive.drive import SimulatedDrive
from mock_hw.drive.faults import DriveFaults
from mock_hw.drive.objects import SimulatedIdentity
from mock_hw.host.fault_clock import controlword_places
from mock_hw.plant.load_transfer import DigitalInputs, LoadTransfer
from mock_hw.plant.plant import Plant
from mock_hw.plant.snapshot import SnapshotWriter
from mock_hw.plant.tracker import HEADER, Tracker

CONTROL_PERIOD_S = 0.004
"""Longest time between two measurements of the axes by the drives [s]."""


class PlantAxis(AxisPort):
    """Values of one axis of the plant, as its drive measures them.

    Args:
        measured: Latest measurements of all axes.
        number: Number of the axis.
        axis: The drive's axis in the cell file, with zero point and counting direction.
    """

    def __init__(self, measured: AxisMeasurements, number: int, axis: DriveAxis) -> None:
        self._measured = measured
        self._number = number
        self._direction = axis.direction
        self._zero_counts = axis.position_zero_counts

    def position_counts(self) -> int:
        """Return the encoder position [increments]."""
        return self._direction * self._measured.counts[self._number] + self._zero_counts

    def velocity_counts_s(self) -> float:
        """Return the encoder velocity [increments/s]."""
        return self._direction * self._measured.counts_s[self._number]

    def torque_permille(self) -> int:
        """Return the motor torque [0.1 % of its rated torque]."""
        return self._direction * self._measured.permille[self._number]

    def digital_inputs(self) -> int:
        """Return the levels of the digital inputs."""
        return self._measured.inputs[self._number]


class AxisMeasurements:
    """Measured positions, velocities and torques of all axes, in the joints' directions.

    `inputs` are the levels of the drives' digital inputs.
    """

    def __init__(self, count: int) -> None:
        self.counts = [0] * count
        self.counts_s = [0.0] * count
        self.permille = [0] * count
        self.inputs = [0] * count


class DriveRack:
    """Drives and plant, which advance in time together, as one `SimulatedDevice`.

    Args:
        cell: The cell.
        robot: Description of the robot.
        plant: True parameters of the robot.
        seed: Random seed of all noise.
        snapshots: Receives the true state of the axes after every `advance`; None for no snapshots.
        now_s: Switch-on time [s].
        faults: Faults of the drives.
        announce: Called with the number of a fault in the script's part `program` when it begins.

    Attributes:
        drives: The drives in the order of the robot's joints.
        time_s: Time up to which drives and plant have been advanced [s].

    Raises:
        ConfigError: Cell and robot have different joints, or plant and robot do not fit.
    """

    def __init__(
        self,
        cell: CellConfig,
        robot: RobotDescription,
        plant: PlantConfig,
        seed: int,
        snapshots: SnapshotWriter | None = None,
        now_s: float = 0.0,
        faults: FaultScript = NO_SCRIPT,
        announce: Callable[[int], None] = lambda _number: None,
    ) -> None:
        axes = {axis.joint: axis for axis in cell.axes}
        if set(axes) != set(robot.joint_names):
            raise ConfigError(
                f"cell {cell.name!r} has drives for {', '.join(axes)}, robot {robot.name!r} has"
                f" joints {', '.join(robot.joint_names)}: each joint needs one drive",
                code="RID-CELL-JOINTS",
            )
        count = len(robot.joints)
        self._plant = Plant(robot, plant, cell.torque_filter, seed)
        self._payloads: list[str | None] = [None, *plant.payloads]
        self._payload = self._payloads.index(plant.attached)
        if snapshots is not None:
            snapshots.payload = self._payload
        self._measured = AxisMeasurements(count)
        self._snapshots = snapshots
        self._transfers: tuple[LoadTransfer, ...] = ()
        self._joint_names = robot.joint_names
        self._inputs = DigitalInputs((), robot.joint_names)
        self._cycle_s = cell.cycle_time_s
        self.time_s = now_s
        self.drives: list[SimulatedDrive] = []
        self._counts_per_position = np.empty(count)
        self._command_factors = np.empty(count)
        self._torque_limit_nm = np.empty(count)
        for number, (joint, simulated) in enumerate(zip(robot.joints, plant.axes, strict=True)):
            axis = axes[joint.name]
            motor = MotorRatings(
                simulated.encoder_increments_per_motor_rev, simulated.rated_motor_torque_nm
            )
            units = AxisUnits.of_motor(motor, ServoProfile(), joint.gear_ratio)
            self._counts_per_position[number] = units.counts_per_rad
            self._command_factors[number] = axis.direction / units.counts_per_rad
            self._torque_limit_nm[number] = 1000.0 * units.nm_per_torque_unit
            port = PlantAxis(self._measured, number, axis)
            identity = SimulatedIdentity.of_axis(cell, axis, joint, simulated)
            self.drives.append(SimulatedDrive(identity, port, now_s))
        self._faults = None
        if faults.drives or faults.program:
            self._faults = DriveFaults(
                faults, robot.joint_names, self.drives, controlword_places(cell), now_s, announce
            )
        self._start: NDArray[np.float64] = np.zeros(count)
        self._end: NDArray[np.float64] = np.zeros(count)
        self._powered: NDArray[np.bool_] = np.zeros(count, dtype=np.bool_)
        self._limit: NDArray[np.float64] = np.zeros(count)
        self._tracker: tuple[Tracker, TextIO] | None = None
        self._measure()
        self._publish()

    @property
    def next_s(self) -> float:
        """Time of the next action of a drive or a fault [s]."""
        due_s = min(drive.next_s for drive in self.drives)
        return due_s if self._faults is None else min(due_s, self._faults.next_s)

    @property
    def acts_on_arrival(self) -> bool:
        """True if an RPDO of a drive acts on arrival, and must not wait for the next SYNC."""
        return any(drive.acts_on_arrival for drive in self.drives)

    @property
    def base_wrench(self) -> NDArray[np.float64]:
        """Present wrench of the base on the robot, (6,); see `Plant.base_wrench`."""
        return self._plant.base_wrench

    def track(self, tracker: Tracker, file: TextIO) -> None:
        """Write from now on what a tracker measures, as lines of text.

        Args:
            tracker: The tracker.
            file: The file, which the caller closes.
        """
        tracker.begin(self.time_s, self._plant.position, self._plant.velocity)
        file.write(HEADER)
        self._tracker = tracker, file

    def change_load(self, transfers: tuple[LoadTransfer, ...]) -> None:
        """Change the payload during each motion that a `MotionMarker` announces."""
        self._transfers = transfers
        self._inputs = DigitalInputs(transfers, self._joint_names)

    def watch_base(self, watched: bool) -> None:
        """Start or stop recording the base wrench."""
        self._plant.watch_base(watched)

    def take_base_wrenches(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the result of `Plant.take_base_wrenches`, with times on the rack's time scale."""
        end_s, wrenches = self._plant.take_base_wrenches()
        return end_s + (self.time_s - self._plant.time_s), wrenches

    def receive(self, frame: Frame, now_s: float) -> None:
        """Pass a frame, whose transmission ended at `now_s` [s], to every drive."""
        if not all(drive.only_stores(frame.cob_id) for drive in self.drives):
            self.advance(now_s)
        if self._faults is not None:
            self._faults.observe(frame, now_s)
        if self._transfers and frame.cob_id == SYNC_COB_ID:
            self._begin_motion(now_s)
        for drive in self.drives:
            drive.receive(frame, now_s)

    def advance(self, until_s: float) -> None:
        """Advance drives and plant to `until_s` [s], with all actions that are due by then."""
        while True:
            due_s = max(self.next_s, self.time_s)
            if due_s > until_s:
                break
            self._move_to(due_s)
            if self._faults is not None:
                self._faults.advance(due_s)
            for drive in self.drives:
                drive.advance(due_s)
        self._move_to(until_s)
        self._publish()

    def take_frames(self) -> Sequence[tuple[int, float, Frame]]:
        """Return all frames to send: (number of the drive, earliest time [s], frame)."""
        return [
            (number, time_s, frame)
            for number, drive in enumerate(self.drives)
            for time_s, frame in drive.take_frames()
        ]

    def _begin_motion(self, sync_s: float) -> None:
        """Schedule the changes of the payload if a SYNC belongs to the first row of a motion."""
        row = None if self._snapshots is None else self._snapshots.take_row()
        if row is not None:
            origin_s = sync_s - row * self._cycle_s
            carried = [each for each in self._transfers if not each.missed]
            self._plant.transfer(carried, origin_s - self.time_s + self._plant.time_s)
            self._inputs.begin(origin_s)

    def _move_to(self, end_s: float) -> None:
        """Move the plant in steps of at most `CONTROL_PERIOD_S`; do the drives' due actions."""
        while (left_s := end_s - self.time_s) > 0.0:
            steps = max(1, math.ceil(left_s / CONTROL_PERIOD_S - 1e-6))
            step_end_s = end_s if steps == 1 else self.time_s + CONTROL_PERIOD_S
            self._step(step_end_s)
            if steps > 1 and self.next_s <= self.time_s:
                for drive in self.drives:
                    drive.advance(self.time_s)

    def _step(self, end_s: float) -> None:
        snapshots = self._snapshots
        if snapshots is not None and snapshots.payload != self._payload:
            self._payload = snapshots.payload
            self._plant.attach(self._payloads[self._payload])
        for number, drive in enumerate(self.drives):
            command = drive.axis.command(self.time_s, end_s)
            self._start[number], self._end[number], self._powered[number], limit = command
            self._limit[number] = limit
        factors, braked = self._command_factors, ~self._powered
        if self._faults is not None:
            factors = np.where(self._faults.reversed, -factors, factors)
            braked |= np.array(self._faults.blocked)
        self._plant.advance(
            end_s - self.time_s,
            self._start * factors,
            self._end * factors,
            self._powered,
            braked,
            self._limit * self._torque_limit_nm,
        )
        self.time_s = end_s
        self._measure()
        if self._tracker is not None:
            tracker, file = self._tracker
            for row in tracker.observe(end_s, self._plant.position, self._plant.velocity):
                file.write(",".join(f"{value:.7f}" for value in row) + "\n")
        for drive in self.drives:
            drive.axis.observe(end_s)

    def _measure(self) -> None:
        plant, measured = self._plant, self._measured
        counts = plant.position_counts().tolist()
        if self._faults is not None:
            pairs = zip(counts, measured.counts, self._faults.stuck, strict=True)
            counts = [old if stuck else new for new, old, stuck in pairs]
        measured.counts = counts
        measured.counts_s = (plant.actuator_velocity * self._counts_per_position).tolist()
        measured.permille = plant.torque_permille().tolist()
        if self._transfers:
            measured.inputs = self._inputs.words(self.time_s)

    def _publish(self) -> None:
        if self._snapshots is not None:
            plant = self._plant
            powered = [drive.power.powered for drive in self.drives]
            self._snapshots.write(
                self.time_s,
                plant.position,
                plant.velocity,
                plant.torque,
                powered,
                plant.temperature_k,
            )
