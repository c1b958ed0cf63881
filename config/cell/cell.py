"""`CellConfig`: the devices of a cell, their buses, addresses and limits."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from config.cell.cycle_time import CycleTimeMs, interpolation_period, nearest_periods
from config.cell.drive_safety import Deceleration, DriveSafety, FollowingError
from config.cell.monitor import MonitorConfig
from config.cell.plate import PlateConfig
from config.cell.servo_profile import ServoProfile, Unsigned32, VelocityUnit
from config.cell.torque_filter import ButterworthFilter
from config.errors import ConfigError
from config.model import ConfigModel
from config.plausible import PhysicalFile, Plausible
from config.quantities import MOST_JOINTS, Direction, NonNegative, Positive
from config.robot.bodies import Workspace

LONGEST_SILENCE_MS = 100
LARGEST_CYCLE_GAIN = 0.5
"""Largest product of position gain and cycle time.

An integrating loop with a delay of one cycle is unstable from 1 on.
"""
LoopFrequency = Annotated[Positive, Plausible(1e-3, 5e3, "Hz")]
Servo = Annotated[str, Field(min_length=1)] | ServoProfile


class CanBusConfig(ConfigModel):
    """A CAN bus, named as in python-can.

    Attributes:
        interface: Any interface that python-can supports, such as `socketcan` or `pcan`.
        channel: The interface's channel, such as `can0`.
        bitrate: Bit rate [bit/s].
    """

    interface: str
    channel: str
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)] = 1_000_000

    @property
    def is_simulated(self) -> bool:
        """True if rid-daq simulates the bus too, not only the devices."""
        return self.interface == "rid_sim"


class DeviceIdentity(ConfigModel):
    """Expected content of a drive's 1018h; values that are left out are not compared.

    Attributes:
        vendor: Vendor id, 1018h:01.
        product: Product code, 1018h:02.
        revision: Revision number, 1018h:03. Only its upper 16 bits are compared: the lower ones
            change without a change of the drive's behaviour.
    """

    vendor: Unsigned32 | None = None
    product: Unsigned32 | None = None
    revision: Unsigned32 | None = None


class DriveAxis(ConfigModel):
    """One CiA 402 drive and the joint that it moves.

    Attributes:
        joint: The joint's name in the robot file.
        node_id: CANopen node id of the drive.
        direction: -1 if positive drive counts turn the joint backwards.
        servo: The drive's profile, in the same form as in the cell, if it differs from the cell's.
        velocity_unit: Unit of the drive's velocities, if it differs from the profile's.
        position_zero_counts: 6064h at joint position zero.
        eds: Path of the drive's electronic data sheet (EDS or DCF), relative to the cell file. It
            must contain all objects that are used, and the drive must be the device that it
            describes.
        identity: The expected device, if there is no EDS or if it must differ from the EDS.
        quick_stop_deceleration_rad_s2: Deceleration of this axis in a quick stop, 6085h, if it
            differs from that in `drive_safety`: the axes of a wrist can stop faster than the base.
    """

    joint: str
    node_id: Annotated[int, Field(ge=1, le=126)]
    direction: Direction = 1
    servo: Servo | None = None
    velocity_unit: VelocityUnit | None = None
    position_zero_counts: Annotated[int, Field(ge=-(2**31), lt=2**31)] = 0
    eds: str | None = Field(default=None, min_length=1)
    identity: DeviceIdentity | None = None
    quick_stop_deceleration_rad_s2: Deceleration | None = None


class Supervision(ConfigModel):
    """Rules by which the cyclic task stops the motion.

    Attributes:
        missed_frames_limit: Number of consecutive cycles in which a drive's answer is missing.
        late_cycles_limit: Number of consecutive cycles in which the task wakes up late.
        late_by_cycles_limit: Delay of a single wake-up, in cycles.
        late_answers_limit: Number of cycles, of the last 100, in which a drive's answer came after
            its cycle.
        second_answers_limit: Number of cycles, of the last 100, in which a drive's identifier
            answered more than once. Different answers in one cycle are not used and also count as
            missing.
        following_error_min_rad: Allowed following error at standstill. A joint may also be beyond
            its position limit by this value, but at most by a twentieth of its range.
        following_error_per_velocity_s: Increase of the allowed following error per commanded speed
            (a line, as LinuxCNC's FERROR and MIN_FERROR).
        stuck_encoder_cycles: An encoder is stuck if its position hardly changes for this number of
            cycles while the commanded speed is above `stuck_encoder_velocity_rad_s`.
        stuck_encoder_velocity_rad_s: Lowest commanded speed for this check, without the part that
            comes from pre-compensation.
        stuck_encoder_torque_fraction: At a slower command an encoder counts as stuck only if, since
            standstill, the torque has also changed by more than this fraction of the joint's limit:
            such a torque would have overcome stiction. After a joint has stopped, torques are
            ignored for `stuck_encoder_cycles`, because the braking torque is measured late.
        limit_margin_fraction: Allowed excess of speed and torque over the joints' limits, as a
            fraction of these limits.
    """

    missed_frames_limit: Annotated[int, Field(ge=1)] = 3
    late_cycles_limit: Annotated[int, Field(ge=1)] = 3
    late_by_cycles_limit: Annotated[float, Field(gt=0.0)] = 2.0
    late_answers_limit: Annotated[int, Field(ge=1, le=100)] = 3
    second_answers_limit: Annotated[int, Field(ge=1, le=100)] = 20
    following_error_min_rad: FollowingError = 0.02
    following_error_per_velocity_s: Annotated[NonNegative, Plausible(1e-4, 2.0, "s")] = 0.1
    stuck_encoder_cycles: Annotated[int, Field(ge=2)] = 5
    stuck_encoder_velocity_rad_s: Annotated[Positive, Plausible(1e-4, 5.0, "rad/s or m/s")] = 0.05
    stuck_encoder_torque_fraction: Annotated[float, Field(gt=0.0, le=2.0)] = 0.35
    limit_margin_fraction: Annotated[float, Field(ge=0.0, le=0.5)] = 0.1


class CellConfig(PhysicalFile):
    """A cell: a robot, its drives, their bus, its force plate, the cycle, and the limits.

    Attributes:
        name: Name of the cell.
        robot: The robot file: a bundled name, or a path relative to the cell file.
        plant: The plant file of a simulated cell, in the same form.
        simulated: True for a simulated cell; a command that needs the simulated hardware starts it.
        cycle_time_ms: Period of SYNC and of the set-points, in whole microseconds [ms]. A drive
            whose cycle time is written (60C2h) supports steps of 0.1 ms up to 25.5 ms.
        can: CAN bus of the drives.
        servo: The drives' profile: a bundled name, a path relative to the cell file, or its keys,
            including data that the drives do not report. Without it, drives are assumed to follow
            CiA 402.
        axes: The drives, one per joint, base to flange.
        position_gain_per_s: Gain of the position loop that this computer closes [1/s].
        drive_safety: Safety settings of the drives, such as heartbeats and quick stop.
        exchange: Data per axis and cycle. `full`: 6 bytes to the drive and 8 from it. `trimmed`: 4
            to the drive (velocity) and 6 from it (position and torque), so that a fourth axis fits
            into 1 ms at 1 Mbit/s. Controlword and statusword then have their own frames, which are
            sent when they change and a few times a second.
        supervision: Limits beyond which the motion is stopped.
        torque_filter: The analog anti-alias filter in front of the drives' torque converters.
        velocity_loop_band_hz: Lowest and highest frequency at which multisines measure the drives'
            velocity loops.
        validation_limits_percent: Largest relative torque error of each joint that passes
            `validate`.
        home: Pose to which `jog --home` moves, one position per joint.
        workspace: Space in which the robot may move.
        plate: Force plate under the robot.
        monitor: A second connection to the drives (Modbus), for temperatures and nominal data.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][\w.-]{0,63}$")
    robot: str
    simulated: bool = False
    plant: str | None = None
    cycle_time_ms: CycleTimeMs
    can: CanBusConfig
    servo: Servo = ServoProfile()
    axes: tuple[DriveAxis, ...] = Field(min_length=1, max_length=MOST_JOINTS)
    position_gain_per_s: Annotated[float, Field(gt=0.0, le=200.0), Plausible(0.3, 200.0, "1/s")]
    drive_safety: DriveSafety
    exchange: Literal["full", "trimmed"] = "full"
    supervision: Supervision = Supervision()
    torque_filter: ButterworthFilter | None = None
    velocity_loop_band_hz: tuple[LoopFrequency, LoopFrequency] | None = None
    validation_limits_percent: (
        tuple[Annotated[Positive, Plausible(0.1, 100.0, "%")], ...] | None
    ) = None
    home: tuple[Annotated[float, Plausible(0.0, 50.0, "rad or m")], ...] | None = None
    workspace: Workspace = Workspace()
    plate: PlateConfig | None = None
    monitor: MonitorConfig | None = None

    @model_validator(mode="after")
    def _check_consistency(self) -> CellConfig:
        nodes = [axis.node_id for axis in self.axes]
        if repeated := [node for node in nodes if nodes.count(node) > 1]:
            raise ValueError(
                f"two axes have the node_id {repeated[0]}: give each axis the node_id of its own"
                " drive. A drive with several axes at one node_id (objects from 6800h) is not"
                " supported"
            )
        if self.drive_safety.master_node_id in nodes:
            raise ValueError(
                f"an axis has node_id {self.drive_safety.master_node_id}, which is the master's;"
                " give it another"
            )
        joints = [axis.joint for axis in self.axes]
        if len(set(joints)) != len(joints):
            raise ValueError("two axes move the same joint; list each joint once")
        if self.simulated and self.plant is None:
            raise ValueError("a simulated cell needs plant; name a plant file")
        self._check_band()
        self._check_position_gain()
        limits = self.validation_limits_percent
        if limits is not None and len(limits) != len(self.axes):
            raise ValueError(
                f"validation_limits_percent has {len(limits)} values for {len(self.axes)} axes;"
                " give one per axis"
            )
        if self.home is not None and len(self.home) != len(self.axes):
            raise ValueError(
                f"home has {len(self.home)} positions for {len(self.axes)} axes; give one per axis"
            )
        if self.monitor is not None and len(self.monitor.units) != len(self.axes):
            raise ValueError(
                f"monitor.units has {len(self.monitor.units)} addresses for {len(self.axes)} axes;"
                " give one per axis"
            )
        self._check_heartbeats()
        unknown = set(self.drive_safety.allow_drive_without_watchdog) - set(nodes)
        if unknown:
            raise ValueError(
                f"allow_drive_without_watchdog names unknown nodes {sorted(unknown)}; name nodes of"
                " the axes"
            )
        return self

    def _check_heartbeats(self) -> None:
        if self.simulated:
            return
        safety = self.drive_safety
        for name, timeout_ms in (
            ("master_heartbeat_timeout_ms", safety.master_heartbeat_timeout_ms),
            ("drive_heartbeat_timeout_ms", safety.drive_heartbeat_timeout_ms),
        ):
            if timeout_ms > LONGEST_SILENCE_MS:
                raise ValueError(
                    f"drive_safety.{name} is {timeout_ms} ms: the robot would continue to move for"
                    f" this time after a failure; give at most {LONGEST_SILENCE_MS} ms on a cell"
                    " that is not simulated"
                )

    def _check_band(self) -> None:
        if self.velocity_loop_band_hz is None:
            return
        lowest, highest = self.velocity_loop_band_hz
        half = 500.0 / self.cycle_time_ms
        if not lowest < highest < half:
            raise ValueError(
                f"velocity_loop_band_hz is [{lowest:g}, {highest:g}]: the first must be smaller,"
                f" and the second below half the cycle frequency, {half:g} Hz"
            )

    def _check_position_gain(self) -> None:
        """Refuse a position gain that does not fit the cycle time."""
        gain = self.position_gain_per_s * self.cycle_time_s
        if gain > LARGEST_CYCLE_GAIN:
            raise ValueError(
                f"position_gain_per_s {self.position_gain_per_s:g} 1/s corrects"
                f" {100.0 * gain:.0f} % of an error within a cycle of {self.cycle_time_ms:g} ms, so"
                " the position loop is near or beyond its stability limit; give at most"
                f" {LARGEST_CYCLE_GAIN / self.cycle_time_s:g} 1/s, or shorten cycle_time_ms"
            )

    def safety_of(self, axis: DriveAxis) -> DriveSafety:
        """Return the safety settings of an axis's drive: the cell's, with the axis's own keys."""
        own = axis.quick_stop_deceleration_rad_s2
        if own is None:
            return self.drive_safety
        return self.drive_safety.model_copy(update={"quick_stop_deceleration_rad_s2": own})

    def servo_of(self, axis: DriveAxis) -> ServoProfile:
        """Return the profile of an axis's drive: the cell's profile, with the axis's own keys.

        Raises:
            ConfigError: The profile was not read, because the cell was not loaded by `config.load`;
                or it does not support the trimmed exchange, the digital inputs or the velocity unit
                that cell or axis require.
        """
        chosen = self.servo if axis.servo is None else axis.servo
        if isinstance(chosen, str) or chosen.base is not None:
            raise ConfigError(
                f"cell {self.name}: its servo profile was not read; load the cell with load_cell",
                code="RID-INTERNAL-ERROR",
            )
        if chosen.spread and self.exchange == "trimmed":
            raise ConfigError(
                f"cell {self.name}: exchange: trimmed needs drives with mappable PDOs, but the"
                f" drive of {axis.joint} has fixed PDOs, or its torque is read by SDO, or it"
                " sends its digital inputs; remove the key",
                code="RID-CELL-VALUE",
            )
        if chosen.digital_inputs and not chosen.sends_inputs:
            raise ConfigError(
                f"cell {self.name}: digital_inputs of the drive of {axis.joint} needs mappable"
                " PDOs, but its PDOs are fixed and do not carry the signal inputs; remove the key",
                code="RID-CELL-VALUE",
            )
        if axis.velocity_unit is None:
            return chosen
        if chosen.by_position:
            raise ConfigError(
                f"cell {self.name}: velocity_unit does not apply to the drive of {axis.joint},"
                f" whose mode is {chosen.mode}; remove the key from its axis",
                code="RID-CELL-VALUE",
            )
        return chosen.model_copy(update={"velocity_unit": axis.velocity_unit})

    def check_cycle_time(self) -> None:
        """Refuse a cycle time that cannot be written to a drive.

        Raises:
            ConfigError: A drive needs its cycle time in 60C2h, which cannot hold this one (its
                mantissa has eight bits).
        """
        if interpolation_period(self.cycle_time_ms) is not None:
            return
        for axis in self.axes:
            profile = self.servo_of(axis)
            if profile.cycle_time_written and not profile.by_ramp:
                shorter, longer = nearest_periods(self.cycle_time_ms)
                raise ConfigError(
                    f"cycle_time_ms: {self.cycle_time_ms} ms cannot be written to 60C2h of the"
                    f" drive of {axis.joint}, which has eight bits and a power of ten: use"
                    f" {shorter} or {longer} ms, or cycle_time_written: false in the axis's servo"
                    " if the drive does not need it",
                    code="RID-CELL-VALUE",
                )

    @property
    def cycle_time_s(self) -> float:
        """The control and SYNC period [s]."""
        return self.cycle_time_ms / 1000.0
