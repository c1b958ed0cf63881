"""`CanServoAxes`: all CiA 402 drives of a robot on one CAN bus, in cyclic synchronous velocity.

The order of calls is that of `drivers.interfaces.ServoAxes`.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from config.cell.cell import CellConfig
from config.errors import DeviceFaultError, DeviceTimeoutError, DriverError, SafetyStop
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from drivers.canopen.heartbeat import HeartbeatProducer, heartbeat_frame
from drivers.canopen.nmt import NmtCommand, NmtState, nmt_frame
from drivers.interfaces import DriveEvent, DriveSetting
from drivers.ports.can_link import CanLink
from drivers.servo.axis_answer import AxisAnswer, answers_of, refuse_fault
from drivers.servo.bring_up import axes_in_joint_order, check_bus_load, refuse_red, wait_for_boot_up
from drivers.servo.cia402 import FOLLOWS_COMMAND, ControlWord, PowerState, next_controlword
from drivers.servo.cyclic_exchange import CyclicExchange
from drivers.servo.drive_watch import DriveWatch, other_senders
from drivers.servo.service import DriveService
from drivers.servo.setup import DriveSetup, SetupResult
from drivers.servo.stop_ramp import LONGEST_STOP_S

COLLECT_FRACTION = 0.6
START_TIMEOUT_S = 2.0
ENABLE_TIMEOUT_S = 4.0
HALT_MARGIN_S = 0.5
DISABLE_S = 0.25
DISABLE_CYCLES = 5
REST_CYCLES = 5

_WITHOUT_POWER = frozenset(
    (PowerState.SWITCH_ON_DISABLED, PowerState.FAULT, PowerState.NOT_READY_TO_SWITCH_ON)
)


class _Phase(IntEnum):
    CLOSED = 0
    CONFIGURED = 1
    STARTED = 2
    ENABLED = 3
    STOPPED = 4


class CanServoAxes:
    """The drives of a cell; see `drivers.interfaces.ServoAxes` for the order of calls.

    Once an axis has left Operation Enabled, or a quick stop was commanded, no velocity is sent any
    more until `bring_up` has been run again: nothing stale can move the robot when power returns.

    Parameters
    ----------
    link
        The open bus. The constructor does not use it.
    cell, robot
        Addresses and limits; the axes are put into the robot's order.

    Attributes
    ----------
    service : DriveService
        What is asked of the drives one by one, outside the cyclic exchange.
    last_heartbeat_s
        When this computer's heartbeat was last sent, on the link's clock [s].

    Raises
    ------
    ConfigError
        Cell and robot do not name the same joints, or the cyclic exchange would take more than 80 %
        of the bus.
    """

    def __init__(self, link: CanLink, cell: CellConfig, robot: RobotDescription) -> None:
        self._link = link
        self._clock = link.clock
        self._cell = cell
        self._robot = robot
        self._axes = axes_in_joint_order(cell, robot)
        check_bus_load(cell)
        self.joint_names = robot.joint_names
        nodes = [axis.node_id for axis in self._axes]
        self._watch = DriveWatch(self.joint_names, nodes, cell.drive_safety)
        coupling = WristCoupling.of_robot(robot)
        self._exchange = CyclicExchange(
            link,
            nodes,
            self._watch,
            coupling,
            trimmed=cell.exchange == "trimmed",
            bitrate=cell.can.bitrate,
        )
        self.received = self._exchange.received
        self.position = self._exchange.position
        self.torque_nm = self._exchange.torque_nm
        self.position_counts = self._exchange.position_counts
        self.torque_raw = self._exchange.torque_raw
        self.statusword = self._exchange.statusword
        self.second_answers = self._exchange.second_answers
        self.contradictions = self._exchange.contradictions
        self.service = DriveService(link, cell, self._axes, self._watch)
        self._setups: tuple[SetupResult, ...] = ()
        self._phase = _Phase.CLOSED
        self.last_heartbeat_s = -math.inf
        self._heartbeats = HeartbeatProducer(cell.drive_safety.master_heartbeat_ms / 1000.0)
        self._heartbeat = heartbeat_frame(cell.drive_safety.master_node_id, NmtState.OPERATIONAL)

    def bring_up(self) -> None:
        """Reset, configure and read back every drive (CiA 301 order); no power, no motion.

        Raises
        ------
        LockedError
            Another master is active on the bus.
        DeviceTimeoutError
            A drive does not boot or does not answer.
        PreflightError
            Something was read back that is not as required; `settings` has all of it.
        TransportError
            The bus is gone.
        """
        self._phase = _Phase.CLOSED
        self._exchange.left_enabled = False
        self._watch.forget()
        self._setups = ()
        wait_for_boot_up(self._link, self._cell, self._axes, self._watch)
        for axis, joint in zip(self._axes, self._robot.joints, strict=True):
            setup = DriveSetup(self._link, axis, joint, self._cell, self._watch.handle)
            self._setups = (*self._setups, setup.run())
        refuse_red(self.settings())
        self._exchange.use_units(setup.units for setup in self._setups if setup.units is not None)
        self._phase = _Phase.CONFIGURED

    def settings(self) -> tuple[DriveSetting, ...]:
        """Return what the last `bring_up` required and read back, also when it failed."""
        return tuple(setting for setup in self._setups for setting in setup.settings)

    def sync(self) -> float:
        """Begin a cycle with SYNC; return its time on the link's clock [s]."""
        return self._exchange.sync()

    def collect(self, deadline_s: float) -> None:
        """Wait for every axis's answer, at most until `deadline_s` [s]; fill the arrays."""
        self._exchange.collect(deadline_s)

    def command(self, velocity: NDArray[np.float64]) -> bool:
        """Send velocities [rad/s or m/s, joint side]; they act at the next SYNC.

        Returns
        -------
        bool
            False when an axis is not in Operation Enabled, or the axes were stopped: then a quick
            stop is sent to all of them in place of the velocities.

        Raises
        ------
        SafetyStop
            A velocity is not finite or does not fit the drive; a quick stop was sent instead.
        TransportError
            The bus does not take the frames.
        """
        if self._exchange.left_enabled or self._phase is not _Phase.ENABLED:
            self.quick_stop()
            return False
        try:
            self._exchange.send_velocities(velocity)
        except (ValueError, OverflowError, struct.error) as error:
            self.quick_stop()
            raise SafetyStop(
                f"a velocity set-point cannot be sent ({velocity.tolist()} rad/s: {error});"
                " the axes were stopped instead"
            ) from error
        return True

    def send_heartbeat(self, now_s: float) -> None:
        """Send this computer's heartbeat when it is due at `now_s` [s]."""
        if self._heartbeats.due(now_s):
            self.last_heartbeat_s = now_s
            self._link.send(self._heartbeat)

    def take_events(self) -> tuple[DriveEvent, ...]:
        """Return what the drives reported since the last call, at most 64 events."""
        return self._watch.take_events()

    @property
    def late_frames(self) -> int:
        """How many TPDOs came after their cycle; they are not used."""
        return self._exchange.late_frames

    @property
    def duplicate_frames(self) -> int:
        """How many TPDOs came twice in a cycle."""
        return self._exchange.duplicate_frames

    @property
    def unexpected_frames(self) -> int:
        """How many frames came with identifiers of nobody."""
        return self._watch.unexpected_frames

    def bus_notes(self) -> tuple[str, ...]:
        """Return who else sends on this bus, as far as it could be seen."""
        return other_senders(self._axes, self._watch, self.second_answers, self.contradictions)

    @property
    def lost_frames(self) -> int:
        """How many frames this computer had to drop, as far as the bus counts them."""
        return self._link.lost_frames

    def start(self) -> None:
        """Start the drives' cyclic exchange and this computer's heartbeat, still without power.

        Raises
        ------
        DeviceTimeoutError
            A drive does not become operational or does not answer SYNC.
        DeviceFaultError
            A drive reports a fault meanwhile.
        """
        self._expect(_Phase.CONFIGURED, "start", "bring_up")
        self._phase = _Phase.STARTED
        now_s = self._clock.now_s()
        self._watch.arm(now_s)
        self.send_heartbeat(now_s)
        self._order(NmtCommand.START)
        until_s = now_s + START_TIMEOUT_S
        waiting = list(self.joint_names)
        while waiting:
            self._step([ControlWord.DISABLE_VOLTAGE] * len(self._axes), until_s, "start", waiting)
            waiting = [
                answer.joint
                for answer, heartbeat in zip(self._answers(), self._watch.heartbeats, strict=True)
                if not answer.received or heartbeat.state != NmtState.OPERATIONAL
            ]
        self._watch.expect_operational()

    def enable(self) -> float:
        """Lead every drive to Operation Enabled, one checked step a cycle, at velocity 0.

        Returns
        -------
        float
            Time of the last SYNC [s]: the next is due one cycle later.

        Raises
        ------
        DeviceTimeoutError
            A drive does not get there, or does not follow its command (6041h bit 12).
        DeviceFaultError
            A drive is in fault or reports one; a fault is never reset here.
        """
        self._expect(_Phase.STARTED, "enable", "start")
        until_s = self._clock.now_s() + ENABLE_TIMEOUT_S
        words = [ControlWord.DISABLE_VOLTAGE] * len(self._axes)
        waiting = list(self.joint_names)
        enabled: set[str] = set()
        while waiting:
            self._step(words, until_s, "be enabled", waiting)
            answers = self._answers()
            refuse_fault(answers, enabled)
            words = [
                next_controlword(answer.state) if answer.received else word
                for answer, word in zip(answers, words, strict=True)
            ]
            waiting = [
                answer.joint
                for answer in answers
                if answer.joint not in enabled
                or not (answer.received and answer.status & FOLLOWS_COMMAND)
            ]
        self._exchange.send_words(words)
        self._exchange.left_enabled = False
        self._phase = _Phase.ENABLED
        return self._exchange.sync_time_s

    def quick_stop(self) -> None:
        """Send a quick stop to every axis by RPDO, acting at the next SYNC; no more motion follows.

        Raises
        ------
        TransportError
            The bus did not take a frame; every axis's was tried.
        """
        if self._phase >= _Phase.STARTED:
            self._phase = _Phase.STOPPED
        self._exchange.send_words([ControlWord.QUICK_STOP] * len(self._axes))

    def halt(self) -> bool:
        """Quick stop, and wait until no drive is powered or none moves any more.

        The wait ends after the time that the fastest axis needs to stop, `LONGEST_STOP_S` at most,
        and 0.5 s.

        Returns
        -------
        bool
            Whether every axis was seen at rest or without power.
        """
        if self._phase < _Phase.STARTED:
            return True
        deceleration = self._cell.drive_safety.quick_stop_deceleration_rad_s2
        fastest = max(joint.limits.velocity for joint in self._robot.joints)
        ramp_s = min(fastest / deceleration, LONGEST_STOP_S)
        until_s = self._clock.now_s() + ramp_s + HALT_MARGIN_S
        words = [ControlWord.QUICK_STOP] * len(self._axes)
        still = [0] * len(self._axes)
        self.quick_stop()
        while self._clock.now_s() < until_s:
            before = self.position_counts.tolist()
            self._cycle(words)
            still = [
                cycles + 1 if received and abs(new - old) <= 1 else 0
                for cycles, received, old, new in zip(
                    still, self.received, before, self.position_counts.tolist(), strict=True
                )
            ]
            if all(
                answer.received and (not answer.state.powered or cycles >= REST_CYCLES)
                for answer, cycles in zip(self._answers(), still, strict=True)
            ):
                return True
        return False

    def disable(self) -> tuple[str, ...]:
        """Disable voltage by RPDO, then NMT pre-operational and reset of the communication.

        The reset ends the drives' watch on this computer, which would end in a fault when its
        heartbeat stops. It is left out where a drive did not confirm: then that watch is needed.

        Returns
        -------
        tuple of str
            The joints whose drive did not confirm in time that it is without power.
        """
        if self._phase is _Phase.CLOSED:
            return ()
        running = self._phase >= _Phase.STARTED
        self._phase = _Phase.CLOSED
        unconfirmed = list(self.joint_names) if running else []
        try:
            words = [ControlWord.DISABLE_VOLTAGE] * len(self._axes)
            cycles = max(DISABLE_CYCLES, math.ceil(DISABLE_S / self._cell.cycle_time_s))
            for _ in range(cycles if running else 0):
                self._cycle(words)
                unconfirmed = [
                    answer.joint
                    for answer in self._answers()
                    if not answer.received or answer.state not in _WITHOUT_POWER
                ]
                if not unconfirmed:
                    break
        finally:
            self._order(NmtCommand.ENTER_PRE_OPERATIONAL)
        if not unconfirmed:
            self._order(NmtCommand.RESET_COMMUNICATION)
        return tuple(unconfirmed)

    def _step(
        self, words: Sequence[int], until_s: float, verb: str, waiting: Sequence[str]
    ) -> None:
        """Run a cycle at velocity 0; refuse faults, and waiting beyond `until_s` [s]."""
        if self._clock.now_s() > until_s:
            states = "; ".join(str(a) for a in self._answers() if a.joint in waiting)
            raise DeviceTimeoutError(
                f"the drives could not {verb} in time: {'; '.join((states, *self.bus_notes()))};"
                " check supply, brakes, enable inputs and emergency stop"
            )
        self._cycle(words)
        if faults := self._watch.faults():
            raise DeviceFaultError("; ".join(event.text for event in faults))

    def _cycle(self, words: Sequence[int]) -> None:
        """Run a whole cycle one cycle time after the last SYNC, with velocity 0."""
        cycle_time_s = self._cell.cycle_time_s
        self._clock.sleep_until(self._exchange.sync_time_s + cycle_time_s)
        now_s = self.sync()
        self.collect(now_s + COLLECT_FRACTION * cycle_time_s)
        self.send_heartbeat(self._clock.now_s())
        self._exchange.send_words(words)

    def _order(self, command: NmtCommand) -> None:
        for axis in self._axes:
            self._link.send(nmt_frame(command, axis.node_id))

    def _answers(self) -> list[AxisAnswer]:
        return answers_of(self.joint_names, self.received, self.statusword)

    def _expect(self, phase: _Phase, verb: str, before: str) -> None:
        if self._phase is not phase:
            raise DriverError(
                f"the drives cannot {verb} now: they are {self._phase.name.lower()};"
                f" run {before} first"
            )
