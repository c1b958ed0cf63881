"""`SimulatedDrive`: a CiA 402 servo drive on a CANopen bus, as a function of frames and time.

The drive has no bus, no clock and no robot. The caller passes frames and times in, and collects the
frames that the drive sends. It reads the measured values of its axis through an `AxisPort`.
"""

from __future__ import annotations

import math

from drivers.canopen.emcy import Emergency, emcy_frame
from drivers.canopen.frames import (
    HEARTBEAT_BASE,
    NMT_COB_ID,
    SYNC_COB_ID,
    Frame,
    sdo_request_cob_id,
)
from drivers.canopen.heartbeat import guard_request, heartbeat_frame
from drivers.canopen.nmt import NmtCommand, NmtState, next_nmt_state, parse_nmt
from drivers.canopen.sdo_server import SdoServer
from drivers.servo.cia402 import ControlWord, PowerState
from drivers.servo.requirements import signal_object
from mock_hw.drive import objects as od
from mock_hw.drive.axis import AxisPort, DrivenAxis
from mock_hw.drive.errors import (
    FOLLOWING_ERROR,
    HEARTBEAT_LOST,
    PDO_LENGTH,
    RPDO_TIMEOUT,
    SYNC_LOST,
    ErrorLog,
)
from mock_hw.drive.master_watch import MasterWatch
from mock_hw.drive.object_dictionary import Key, ObjectDictionary
from mock_hw.drive.pdos import DrivePdo, PdoTable
from mock_hw.drive.power_stage import DriveClock, PowerStage

BOOT_S = 0.020
"""Time from power-on or reset to the boot-up message [s]."""

SYNC_ANSWER_S = 100e-6
SDO_ANSWER_S = 300e-6

_TARGETS = frozenset((od.TARGET_VELOCITY, *od.TARGET_OF.values()))
_SYNC_PATIENCE = 1.5  # in periods (1006h), as in CANopenNode


class SimulatedDrive:
    """A simulated servo drive, which is a `SimulatedDevice`.

    The caller calls `advance` at `next_s`, `receive` for every frame on the bus, and `axis.observe`
    after every motion of the axis, in the order of their times. The caller also sends the frames
    that `take_frames` returns.

    Args:
        identity: Address and fixed properties of the drive.
        port: Measured values of the drive's axis.
        now_s: Switch-on time [s].

    Attributes:
        objects: Object dictionary.
        power: Power stage: the CiA 402 state machine.
        axis: Commands to the motor, and measured values of the axis.
        nmt: NMT state.
        clock: Clock by which the drive measures its periods, timeouts and ramps.
        beats: True if the drive sends its heartbeat; a simulated fault sets it to False.
        watches: True if the drive reacts to the loss of its master; a simulated fault sets it to
            False.
        ignores_quick_stop: True if a fault makes the drive ignore RPDOs that command a quick stop.
    """

    def __init__(self, identity: od.SimulatedIdentity, port: AxisPort, now_s: float = 0.0) -> None:
        self.node_id = identity.node_id
        self._now_s = now_s
        self.clock = DriveClock()
        self.objects = ObjectDictionary(od.drive_entries(identity), od.mirrors(identity.profile))
        units = identity.units
        ramps = units.velocity_units_per_rad_s / units.acceleration_units_per_rad_s2
        self.power = PowerStage(self.objects, self.clock, ramps)
        self.axis = DrivenAxis(self.objects, self.power, port, identity, now_s, self.clock)
        self.nmt = NmtState.INITIALISING
        self._sdo_cob_id = sdo_request_cob_id(identity.node_id)
        self._sdo = SdoServer(identity.node_id, self._read, self._write)
        self._pdos = PdoTable(self.objects, self.clock)
        self._errors = ErrorLog(self.objects)
        self._outbox: list[tuple[float, Frame]] = []
        self._boot_s = now_s + BOOT_S
        self._beat_s = math.inf
        self._sync_deadline_s = math.inf
        self._master = MasterWatch(self.objects, self.clock, identity)
        self._guard_cob_id = guard_request(identity.node_id).cob_id
        self._targets = _TARGETS | {signal_object(identity.profile, "target")}
        self.beats = True
        self.watches = True
        self.ignores_quick_stop = False

    # ---- time -----------------------------------------------------------------------------

    @property
    def next_s(self) -> float:
        """Time of the drive's next action, if no frame arrives [s]."""
        due_s = min(
            self._boot_s,
            self._beat_s,
            self.power.next_s,
            self.axis.following.due_s,
            self._sync_deadline_s,
            self._master.next_s,
        )
        for pdo in self._pdos.timed:
            due_s = min(due_s, pdo.deadline_s)
        return due_s

    def advance(self, until_s: float) -> None:
        """Do all actions that are due by `until_s` [s]; send PDOs whose objects changed."""
        self._do_due_actions(until_s)
        self._now_s = until_s
        self._send_changes()
        self._do_due_actions(until_s)

    def _do_due_actions(self, until_s: float) -> None:
        while (due_s := self.next_s) <= until_s:
            self._do_actions(max(due_s, self._now_s))

    def _do_actions(self, now_s: float) -> None:
        self._now_s = now_s
        if now_s >= self._boot_s:
            self._finish_boot()
        if now_s >= self._beat_s:
            self._beat_s += self.clock.true_duration_s(self.objects[od.HEARTBEAT_PRODUCER] * 1e-3)
            if self.beats:
                self._send(heartbeat_frame(self.node_id, self.nmt))
        self.power.advance(now_s)
        for _ in range(self._master.count_silent(now_s)):
            self._lose_master(HEARTBEAT_LOST)
        if now_s >= self.axis.following.due_s:
            self.axis.following.due_s = math.inf
            self._fault(FOLLOWING_ERROR)
        if now_s >= self._sync_deadline_s:
            self._sync_deadline_s = math.inf
            self._fault(SYNC_LOST)
        for pdo in self._pdos.timed:
            if now_s >= pdo.deadline_s:
                pdo.deadline_s = math.inf
                if pdo.receives:
                    self._lose_master(RPDO_TIMEOUT)
                else:
                    self.axis.refresh()
                    self._send(pdo.frame(pdo.pack(self.objects), now_s))
        self._send_changes()

    # ---- frames ---------------------------------------------------------------------------

    @property
    def acts_on_arrival(self) -> bool:
        """True if an RPDO acts on arrival, so that its frames must not wait for the next SYNC."""
        return self._pdos.acts_on_arrival

    def only_stores(self, cob_id: int) -> bool:
        """Return True if `receive` only stores such a frame, independent of the axis's state."""
        pdo = self._pdos.received.get(cob_id)
        if pdo is not None:
            return pdo.synchronous
        return cob_id not in (NMT_COB_ID, SYNC_COB_ID, self._sdo_cob_id, self._guard_cob_id)

    def receive(self, frame: Frame, now_s: float) -> None:
        """Process a frame whose transmission ended at `now_s` [s]."""
        if self.nmt is NmtState.INITIALISING:
            return
        self._now_s = now_s
        cob_id = frame.cob_id
        if cob_id == NMT_COB_ID:
            command = parse_nmt(frame, self.node_id)
            if command is not None:
                self._execute_nmt(command)
        elif cob_id == self._guard_cob_id:
            self._answer_guarding()
        elif cob_id > HEARTBEAT_BASE:
            if self._master.receive_heartbeat(cob_id - HEARTBEAT_BASE, now_s):
                self._send_emergency(self._errors.leave(HEARTBEAT_LOST))
        elif cob_id == self._sdo_cob_id and self.nmt is not NmtState.STOPPED:
            self.axis.refresh()
            for answer in self._sdo.handle(frame, now_s):
                self._send(answer, SDO_ANSWER_S)
        elif self.nmt is NmtState.OPERATIONAL:
            if cob_id == SYNC_COB_ID:
                self._synchronise()
            elif (pdo := self._pdos.received.get(cob_id)) is not None:
                self._receive_pdo(pdo, frame.data)
        self._send_changes()

    def take_frames(self) -> list[tuple[float, Frame]]:
        """Return and clear the frames to send, each with its earliest transmission time [s]."""
        frames, self._outbox = self._outbox, []
        return frames

    def _send(self, frame: Frame, delay_s: float = 0.0) -> None:
        self._outbox.append((self._now_s + delay_s, frame))

    # ---- network management ---------------------------------------------------------------

    def _finish_boot(self) -> None:
        self._boot_s = math.inf
        self._send(heartbeat_frame(self.node_id, NmtState.INITIALISING))
        self.nmt = NmtState.PRE_OPERATIONAL
        self.power.boot()

    def _execute_nmt(self, command: NmtCommand) -> None:
        before, self.nmt = self.nmt, next_nmt_state(self.nmt, command)
        if self.nmt is NmtState.INITIALISING:
            self._reset(communication_only=command is NmtCommand.RESET_COMMUNICATION)
        elif self.nmt is not before:
            self._arm_pdos()
            if self.nmt is NmtState.STOPPED:
                self._sdo.reset()
            if before is NmtState.OPERATIONAL:
                self.power.abort_connection(self._now_s)

    def _reset(self, *, communication_only: bool) -> None:
        """Reset the drive, or only its communication; in that case a fault remains."""
        faulty = self.power.state in (PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE)
        kept = communication_only and faulty
        self.power.enter_state(PowerState.FAULT if kept else PowerState.NOT_READY_TO_SWITCH_ON)
        self.objects.reset(communication_only=communication_only)
        if kept:
            self._errors.restore()
        else:
            self._errors.reset()
        self._sdo.reset()
        self._arm_pdos()
        self._outbox.clear()
        self._master.forget()
        self._beat_s = math.inf
        self._boot_s = self._now_s + self.clock.true_duration_s(BOOT_S)

    def _answer_guarding(self) -> None:
        answer = self._master.answer(self.nmt, self._now_s)
        if answer is not None:
            self._send_emergency(self._errors.leave(HEARTBEAT_LOST))
            if self.beats:
                self._send(answer)

    # ---- effects of faults -------------------------------------------------------------------

    def lose_supply(self, now_s: float) -> None:
        """Simulate the loss of the supply: the drive is off until `restore_supply`."""
        self._now_s = now_s
        self.nmt = NmtState.INITIALISING
        self._reset(communication_only=False)
        self._boot_s = math.inf

    def restore_supply(self, now_s: float) -> None:
        """Restore the supply, so that the drive boots."""
        self._now_s = now_s
        self._boot_s = now_s + self.clock.true_duration_s(BOOT_S)

    def fail(self, code: int, now_s: float) -> None:
        """Simulate an internal fault; the drive reacts according to 605Eh."""
        self._now_s = now_s
        self._fault(code)

    def report(self, code: int, now_s: float) -> None:
        """Send an emergency message without any other reaction, if the drive's state allows it."""
        if self.nmt in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            self._now_s = now_s
            self._send(emcy_frame(self.node_id, Emergency(code, self.objects[od.ERROR_REGISTER])))

    # ---- errors ---------------------------------------------------------------------------

    def _send_emergency(self, emergency: Emergency | None) -> None:
        if emergency is not None and self.nmt is not NmtState.STOPPED:
            self._send(emcy_frame(self.node_id, emergency))

    def _fault(self, code: int) -> None:
        self._send_emergency(self._errors.enter(code))
        self.power.fault(self._now_s)

    def _lose_master(self, code: int) -> None:
        """React to a lost master by 6007h; leave NMT Operational if 1029h requires it."""
        if not self.watches:
            return
        self._send_emergency(self._errors.enter(code))
        self.power.abort_connection(self._now_s)
        reaction = self.objects[od.COMMUNICATION_ERROR]
        if reaction == 2:
            self.nmt = NmtState.STOPPED
        elif reaction == 0 and self.nmt is NmtState.OPERATIONAL:
            self.nmt = NmtState.PRE_OPERATIONAL
        self._arm_pdos()

    # ---- process data ---------------------------------------------------------------------

    def _arm_pdos(self) -> None:
        self._pdos.rebuild(in_use=self.nmt is NmtState.OPERATIONAL, now_s=self._now_s)
        self._sync_deadline_s = math.inf

    def _synchronise(self) -> None:
        """Send the synchronous TPDOs, then apply the RPDOs received since the last SYNC."""
        patience_s = self.clock.true_duration_s(
            _SYNC_PATIENCE * (self.objects[od.SYNC_PERIOD_US] * 1e-6)
        )
        self._sync_deadline_s = self._now_s + patience_s if patience_s else math.inf
        self.axis.refresh()
        for pdo in self._pdos.transmitted:
            if pdo.synchronous:
                data = pdo.pack(self.objects)
                if pdo.due_at_sync(data):
                    self._send(pdo.frame(data, self._now_s), SYNC_ANSWER_S)
        for pdo in self._pdos.received.values():
            if pdo.kept is not None:
                kept, pdo.kept = pdo.kept, None
                self._write_values(pdo.keys, kept)

    def _receive_pdo(self, pdo: DrivePdo, data: bytes) -> None:
        """Process an RPDO; data beyond the mapped length are ignored (CiA 301, 7.2.2.1)."""
        pdo.arm(self._now_s)
        if len(data) < pdo.layout.size:
            self._send_emergency(self._errors.enter(PDO_LENGTH))
            return
        self._send_emergency(self._errors.leave(PDO_LENGTH))
        self._send_emergency(self._errors.leave(RPDO_TIMEOUT))
        values = pdo.layout.unpack_from(data)
        if self.ignores_quick_stop and _is_quick_stop(pdo.keys, values):
            return
        if pdo.synchronous:
            pdo.kept = values
        else:
            self._write_values(pdo.keys, values)

    def _write_values(self, keys: tuple[Key, ...], values: tuple[int, ...]) -> None:
        objects = self.objects
        for key, value in zip(keys, values, strict=True):
            allowed = objects.entry(*key).allowed
            if allowed is None or value in allowed:
                objects[key] = value
        if od.CONTROLWORD in keys:
            self._command()
        if not self._targets.isdisjoint(keys):
            self.power.take_target(self._now_s)

    def _send_changes(self) -> None:
        """Schedule event-driven TPDOs whose objects have changed."""
        if self._pdos.event_driven:
            self.axis.refresh()
            for pdo in self._pdos.event_driven:
                if pdo.pack(self.objects) != pdo.last_data:
                    pdo.deadline_s = min(pdo.deadline_s, pdo.allowed_s(self._now_s))

    # ---- objects --------------------------------------------------------------------------

    def _command(self) -> None:
        before = self.power.state
        self.power.command(self.objects[od.CONTROLWORD], self._now_s)
        if before is PowerState.FAULT and self.power.state is not PowerState.FAULT:
            self._send_emergency(self._errors.reset())

    def _read(self, index: int, subindex: int) -> bytes:
        return self.objects.read(index, subindex)

    def _write(self, index: int, subindex: int, data: bytes) -> None:
        value = self.objects.decode(index, subindex, data)
        self._pdos.check_write(index, subindex, value)
        key = (index, subindex)
        self.objects[key] = od.STORES_ON_COMMAND if key == od.STORE else value
        if key == od.CONTROLWORD:
            self._command()
        elif key == od.STORE:
            self.objects.store()
        elif key in self._targets:
            self.power.take_target(self._now_s)
        elif key == od.HEARTBEAT_PRODUCER:
            self._beat_s = self._now_s if value else math.inf
        elif key == (od.ERROR_HISTORY, 0):
            self._errors.clear_history()
        elif index == od.HEARTBEAT_CONSUMER:
            self._master.read_entries()
        elif 0x1400 <= index < 0x1C00:
            self._arm_pdos()


def _is_quick_stop(keys: tuple[Key, ...], values: tuple[int, ...]) -> bool:
    words = [value for key, value in zip(keys, values, strict=True) if key == od.CONTROLWORD]
    return any(word & 0x06 == ControlWord.QUICK_STOP for word in words)
