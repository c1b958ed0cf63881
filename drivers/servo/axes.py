"""`CanServoAxes`: all CiA 402 drives of a robot on one CAN bus, commanded by velocity.

It implements the interface in `drivers.interfaces.servo_axes`. The drives are in cyclic synchronous
velocity unless their profile names another mode; a drive in a position mode receives positions
computed from the velocities.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from config.cell.cell import CellConfig
from config.errors import DriverError, SafetyStop
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling, motor_ranges
from drivers.canopen.heartbeat import HeartbeatProducer, guard_request, heartbeat_frame
from drivers.canopen.nmt import NmtCommand, NmtState, nmt_frame
from drivers.interfaces.servo_axes import DriveEvent, DriveSetting
from drivers.ports.can_link import CanLink
from drivers.servo.bring_up import (
    axes_in_joint_order,
    check_bus_load,
    refuse_red,
    refuse_restarted,
    wait_for_boot_up,
)
from drivers.servo.cia402 import ControlWord
from drivers.servo.cyclic_exchange import CyclicExchange
from drivers.servo.drive_watch import DriveWatch
from drivers.servo.power_sequence import PowerSequence
from drivers.servo.service import DriveService
from drivers.servo.setup import DriveSetup, SetupResult
from drivers.settings.write_log import WriteLog

ANSWERS_FRACTION = 0.6
"""Fraction of the cycle time during which answers are awaited; in the rest, the next set-points are
computed and sent."""


class _Phase(IntEnum):
    CLOSED = 0
    CONFIGURED = 1
    STARTED = 2
    ENABLED = 3
    STOPPED = 4


class CanServoAxes:
    """The drives of a cell; see `drivers.interfaces.servo_axes.ServoAxes` for the order of calls.

    Once an axis has left Operation Enabled, or a quick stop was commanded, no velocity is sent
    until `bring_up` has been run again. An old command can therefore not move the robot when power
    returns.

    Args:
        link: The open bus. The constructor does not use it.
        cell, robot: Descriptions of cell and robot; the axes have the order of the robot's joints.
        write_log: Log of the values that are written by SDO, with the previous values.
        stopped: Returns True once a stop was ordered; `start` and `enable` then raise `SafetyStop`.

    Attributes:
        joint_names, answers, answers_within_s: As in `ServoAxes`.
        service: Requests to single drives, outside the cyclic exchange.
        cyclic: Exchange of the frames of every cycle; it counts faulty frames.
        watch: Monitor of all frames that are not cyclic, from drives and from other senders.
        last_heartbeat_s: Time of this computer's last heartbeat, on the link's clock [s].
        without_power: True if the drives were disabled last, and every drive that had power
            confirmed that it is off.

    Raises:
        ConfigError: Cell and robot do not name the same joints, or the cyclic exchange would take
            more than 80 % of the bus.
    """

    without_power = False

    def __init__(
        self,
        link: CanLink,
        cell: CellConfig,
        robot: RobotDescription,
        write_log: WriteLog | None = None,
        *,
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        self._link = link
        self._clock = link.clock
        self._cell = cell
        self._robot = robot
        self._write_log = write_log
        self._axes = axes_in_joint_order(cell, robot)
        check_bus_load(cell)
        self.joint_names = robot.joint_names
        nodes = [axis.node_id for axis in self._axes]
        guarded = [
            axis.node_id for axis in self._axes if cell.servo_of(axis).watch == "life_guarding"
        ]
        self.watch = DriveWatch(self.joint_names, nodes, cell.drive_safety, guarded)
        self.cyclic = CyclicExchange(
            link,
            nodes,
            self.watch,
            WristCoupling.of_robot(robot),
            trimmed=cell.exchange == "trimmed",
            bitrate=cell.can.bitrate,
            profiles=[cell.servo_of(axis) for axis in self._axes],
            cycle_time_s=cell.cycle_time_s,
        )
        self.answers = self.cyclic.answers
        self.service = DriveService(link, cell, self._axes, self.watch, write_log)
        self.answers_within_s = ANSWERS_FRACTION * cell.cycle_time_s
        self._power = PowerSequence(
            self._axes, cell, robot, link.clock, self.cyclic, self.watch, self._run_cycle, stopped
        )
        self._setups: tuple[SetupResult, ...] = ()
        self._phase = _Phase.CLOSED
        self.last_heartbeat_s = -math.inf
        self._heartbeats = HeartbeatProducer(cell.drive_safety.master_heartbeat_ms / 1000.0)
        self._heartbeat = heartbeat_frame(cell.drive_safety.master_node_id, NmtState.OPERATIONAL)
        self._guarding = [guard_request(node) for node in guarded]

    def bring_up(self) -> None:
        """Reset, configure and read back every drive in the order of CiA 301, without power.

        Raises:
            LockedError: Another master is active on the bus.
            DeviceTimeoutError: A drive does not boot or does not answer.
            DeviceFaultError: A drive restarted during its setup.
            ProtocolError: Two devices boot with the same node id.
            PreflightError: A value that was read back is not as required; `settings` has all
                values.
            TransportError: The bus is lost.
        """
        self._phase = _Phase.CLOSED
        self.cyclic.left_enabled = False
        self.watch.forget()
        self._setups = ()
        self.service.claim_bus()
        self.service.log_before_reset()
        wait_for_boot_up(self._link, self._axes, self.watch)
        each = zip(self._axes, self._robot.joints, motor_ranges(self._robot), strict=True)
        for number, (axis, joint, reach) in enumerate(each):
            self.watch.expect_no_boot_up(number)
            setup = DriveSetup(
                self._link, axis, joint, self._cell, reach, self.watch.handle, self._write_log
            )
            self._setups = (*self._setups, setup.run())
        refuse_restarted(self._axes, self.watch)
        refuse_red(self.settings())
        self.cyclic.use_units(setup.units for setup in self._setups if setup.units is not None)
        self._phase = _Phase.CONFIGURED

    def settings(self) -> tuple[DriveSetting, ...]:
        """Return the required and actual values of the last `bring_up`, even if it failed."""
        return tuple(setting for setup in self._setups for setting in setup.settings)

    @property
    def undefined_reactions(self) -> tuple[str, ...]:
        """Joints whose drive may react in an undefined way if this computer fails.

        The drive uses life guarding, or lacks an object that defines a reaction.
        """
        return tuple(setup.joint for setup in self._setups if setup.undefined_reactions)

    def exchange(self) -> float:
        """Begin a cycle with SYNC and receive the answers; return the time of SYNC [s]."""
        sync_s = self.cyclic.sync()
        self.cyclic.collect(sync_s + self.answers_within_s)
        return sync_s

    def command(self, velocity: NDArray[np.float64]) -> bool:
        """Send velocities [rad/s or m/s, joint side]; they act at the next SYNC.

        Returns:
            True if the velocities were sent. False if an axis is not in Operation Enabled, or the
                axes were stopped before: a quick stop is then sent to all axes instead.

        Raises:
            SafetyStop: A velocity is not finite or too large for the drive's object; a quick stop
                was sent instead.
            TransportError: The bus does not accept the frames.
        """
        if self.cyclic.left_enabled or self._phase is not _Phase.ENABLED:
            self.quick_stop()
            return False
        try:
            self.cyclic.send_velocities(velocity)
        except (ValueError, OverflowError, struct.error) as error:
            self.quick_stop()
            raise SafetyStop(
                f"a velocity set-point cannot be sent ({velocity.tolist()} rad/s or m/s: {error});"
                " the axes were stopped instead",
                code="RID-INTERNAL-ERROR",
            ) from error
        return True

    def send_heartbeat(self, now_s: float, *, asking: bool = True) -> None:
        """Send this computer's heartbeat if it is due at `now_s` [s].

        Drives with life guarding also get a request for their state. With `asking` False no request
        is sent, so that this computer and these drives detect a lost connection.
        """
        if self._heartbeats.due(now_s):
            self.last_heartbeat_s = now_s
            self._link.send_frames((self._heartbeat, *(self._guarding if asking else ())))

    def take_events(self) -> tuple[DriveEvent, ...]:
        """Return the drives' reports since the last call, at most 64 events."""
        return self.watch.take_events()

    def bus_notes(self) -> tuple[str, ...]:
        """Return remarks about other senders that were detected on this bus."""
        return self._power.bus_notes()

    def start(self) -> None:
        """Start the drives' cyclic exchange and this computer's heartbeat, still without power.

        Raises:
            DeviceTimeoutError: A drive does not become operational or does not answer SYNC.
            DeviceFaultError: A drive has restarted since its setup, or reports a fault.
            SafetyStop: A stop was ordered.
        """
        self._require_phase(_Phase.CONFIGURED, "start", "bring_up")
        refuse_restarted(self._axes, self.watch)
        self._phase = _Phase.STARTED
        now_s = self._clock.now_s()
        self.watch.arm(now_s)
        self.send_heartbeat(now_s)
        self._send_words(NmtCommand.START)
        self._power.wait_until_operational()
        self.watch.expect_operational()

    def keep_alive(self, now_s: float) -> None:
        """Send this computer's heartbeat if it is due at `now_s` [s], and with it Disable Voltage.

        The command prevents a second timeout of the drives: they also monitor the arrival of
        commands, with the timeout of the heartbeat (1400h:05).
        """
        self._require_phase(_Phase.STARTED, "be kept alive", "start")
        self.send_heartbeat(now_s)
        if self.last_heartbeat_s == now_s:
            self.cyclic.send_words([ControlWord.DISABLE_VOLTAGE] * len(self._axes))

    def enable(self) -> float:
        """Switch every drive to Operation Enabled, one checked step per cycle, at velocity 0.

        Returns:
            Time of the last SYNC [s]; the next is due one cycle later.

        Raises:
            DeviceTimeoutError: A drive does not reach Operation Enabled, or does not report that it
                follows its command (6041h bit 12).
            DeviceFaultError: A drive is in fault, or reports an error; this method never resets a
                fault.
            SafetyStop: A stop was ordered; the switching of all drives ends.
        """
        self._require_phase(_Phase.STARTED, "enable", "start")
        self._power.enable()
        self.cyclic.left_enabled = False
        self._phase = _Phase.ENABLED
        return self.cyclic.sync_time_s

    def quick_stop(self) -> None:
        """Send a quick stop to every axis by RPDO; it acts at the next SYNC and ends the motion.

        Raises:
            TransportError: The bus did not accept a frame; the frames of all other axes were still
                sent.
        """
        if self._phase >= _Phase.STARTED:
            self._phase = _Phase.STOPPED
        self.cyclic.send_words([ControlWord.QUICK_STOP] * len(self._axes))

    def halt(self) -> bool:
        """Command a quick stop; wait a limited time until every axis is at rest or without power.

        Returns:
            True if every axis has reported that it is at rest or without power.
        """
        if self._phase < _Phase.STARTED:
            return True
        self.quick_stop()
        return self._power.rest()

    def disable(self) -> tuple[str, ...]:
        """Disable voltage by RPDO, enter NMT pre-operational, then reset the communication.

        The reset ends the drives' monitoring of this computer; without it they would enter a fault
        when this computer's heartbeat stops. If a drive did not confirm that its power is off,
        there is no reset, because the monitoring is then still needed.

        Returns:
            The joints whose drive did not confirm in time that its power is off.
        """
        if self._phase is _Phase.CLOSED:
            return ()
        running = self._phase >= _Phase.STARTED
        self._phase = _Phase.CLOSED
        self.without_power = False
        try:
            unconfirmed = self._power.disable_voltage() if running else []
        finally:
            self._send_words(NmtCommand.ENTER_PRE_OPERATIONAL)
        self.without_power = not unconfirmed
        if self.without_power:
            self._send_words(NmtCommand.RESET_COMMUNICATION)
        return tuple(unconfirmed)

    def _run_cycle(self, words: Sequence[int]) -> None:
        """Run a cycle with velocity 0, one cycle time after the last SYNC."""
        self._clock.sleep_until(self.cyclic.sync_time_s + self._cell.cycle_time_s)
        self.exchange()
        self.send_heartbeat(self._clock.now_s())
        self.cyclic.send_words(words)

    def _send_words(self, command: NmtCommand) -> None:
        for axis in self._axes:
            self._link.send(nmt_frame(command, axis.node_id))

    def _require_phase(self, phase: _Phase, verb: str, before: str) -> None:
        if self._phase is not phase:
            raise DriverError(
                f"the drives cannot {verb} now: they are {self._phase.name.lower()};"
                f" run {before} first",
                code="RID-INTERNAL-ERROR",
            )
