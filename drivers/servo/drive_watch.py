"""`DriveWatch`: monitor of the drives' frames outside the cyclic data; it produces events."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from config.cell.cell import DriveAxis
from config.cell.drive_safety import DriveSafety
from config.errors import LockedError
from drivers.canopen.emcy import parse_emcy
from drivers.canopen.frames import (
    HEARTBEAT_BASE,
    LSS_MASTER_COB_ID,
    NMT_COB_ID,
    SDO_REQUEST_BASE,
    SYNC_COB_ID,
    Frame,
    emcy_cob_id,
    heartbeat_cob_id,
    rpdo_cob_id,
    sdo_answer_cob_id,
    sdo_request_cob_id,
)
from drivers.canopen.heartbeat import TOGGLE_BIT, HeartbeatConsumer
from drivers.canopen.nmt import NmtState, state_name
from drivers.device_text import printable
from drivers.interfaces.servo_axes import DriveEvent, EventKind

MOST_EVENTS = 64
MOST_NAMED = 4


class DriveWatch:
    """Monitor of heartbeats, boot-ups, emergencies and unexpected frames.

    The caller passes the frames with their times. Before `arm`, emergencies are stored, boot-ups
    are counted (a drive boots after a reset), and a frame from another master raises an error.
    After `arm`, every frame is checked, and a frame from another master is an event that ends the
    motion.

    Args:
        joint_names, node_ids: The axes, base to flange.
        safety: The heartbeat timeouts of the cell, and the node id of this computer.
        guarded: Node ids of the drives with life guarding, which send no heartbeat.

    Attributes:
        boot_ups: Number of boot-up messages of each axis since `forget` or `expect_no_boot_up`.
        heartbeats: One `HeartbeatConsumer` per axis.
        unexpected_frames: Number of frames since `arm` that no drive of the cell should send.
        dropped_events: Number of events that were discarded because `MOST_EVENTS` events were
            already waiting.
    """

    def __init__(
        self,
        joint_names: Sequence[str],
        node_ids: Sequence[int],
        safety: DriveSafety,
        guarded: Collection[int] = (),
    ) -> None:
        self._joint_names = tuple(joint_names)
        timeout_s = safety.drive_heartbeat_timeout_ms / 1000.0
        self._emcy = {emcy_cob_id(node): axis for axis, node in enumerate(node_ids)}
        self._heartbeat = {heartbeat_cob_id(node): axis for axis, node in enumerate(node_ids)}
        self._answers = frozenset(sdo_answer_cob_id(node) for node in node_ids)
        self._masters_own = {
            SYNC_COB_ID: "SYNC",
            LSS_MASTER_COB_ID: "layer settings (LSS)",
            NMT_COB_ID: "NMT commands",
            heartbeat_cob_id(safety.master_node_id): f"node {safety.master_node_id}'s heartbeat",
        }
        for node in node_ids:
            self._masters_own[sdo_request_cob_id(node)] = f"SDO requests to node {node}"
            for number in (1, 2):
                self._masters_own[rpdo_cob_id(node, number)] = f"commands to node {node}"
        self.heartbeats = tuple(
            HeartbeatConsumer(timeout_s, guarded=node in guarded) for node in node_ids
        )
        self.boot_ups = [0] * len(node_ids)
        self.unexpected_frames = 0
        self.dropped_events = 0
        self._seen: set[int] = set()
        self._armed = False
        self._operational = False
        self._events: list[DriveEvent] = []

    def forget(self) -> None:
        """Return to the state before `arm`, without events; call it before the drives are reset."""
        self._events.clear()
        self._seen.clear()
        self._armed = self._operational = False
        self.boot_ups = [0] * len(self.boot_ups)

    def expect_no_boot_up(self, axis: int) -> None:
        """Count an axis's boot-ups from 0.

        From now on, each boot-up means that its configuration is lost.
        """
        self.boot_ups[axis] = 0

    def arm(self, now_s: float) -> None:
        """Monitor the heartbeats and report boot-ups from `now_s` [s] on."""
        self._events.clear()
        self._armed = True
        for consumer in self.heartbeats:
            consumer.start(now_s)

    def expect_operational(self) -> None:
        """From now on, report every drive that is not in the NMT state Operational."""
        self._operational = True

    def foreign_master(self, cob_id: int) -> str | None:
        """Return a description of a frame that only a master sends; None for any other frame."""
        own = self._masters_own.get(cob_id)
        if own is None and SDO_REQUEST_BASE < cob_id < HEARTBEAT_BASE - 0x80:
            return f"SDO requests to node {cob_id - SDO_REQUEST_BASE}"
        return own

    def handle_emergency(self, frame: Frame, now_s: float) -> None:
        """Process a frame if it is a drive's emergency message."""
        if (axis := self._emcy.get(frame.cob_id)) is not None:
            self._emergency_arrived(axis, frame.data, now_s)

    def handle(self, frame: Frame, now_s: float) -> None:
        """Process a frame that is not a TPDO of this cell.

        Raises:
            LockedError: Another master was detected before `arm`.
        """
        cob_id, data = frame
        axis = self._heartbeat.get(cob_id)
        if axis is not None:
            self._heartbeat_arrived(axis, data, now_s)
        elif (axis := self._emcy.get(cob_id)) is not None:
            self._emergency_arrived(axis, data, now_s)
        elif cob_id in self._answers:
            return
        elif self._armed:
            self._report_unexpected(cob_id, now_s)
        else:
            self.refuse_foreign_master(cob_id)

    def refuse_foreign_master(self, cob_id: int) -> None:
        """Raise `LockedError` if only another master can have sent a frame."""
        foreign = self.foreign_master(cob_id)
        if foreign is not None:
            raise LockedError(
                f"another master is active on the CAN bus: it sends {foreign}; stop it first",
                code="RID-CAN-FOREIGN-MASTER",
            )

    def wrong_length(self, axis: int, data_bytes: int, now_s: float, mapped: int = 8) -> None:
        """Report a TPDO whose length differs from its mapping; the caller does not use its data."""
        self._note(
            EventKind.WRONG_LENGTH,
            axis,
            now_s,
            f"sent a TPDO of {data_bytes} bytes, but {mapped} are mapped; the frame was not used",
            data_bytes,
        )

    def check(self, now_s: float, reaction_s: float) -> None:
        """Report drives whose heartbeat timeout ends before a quick stop can be on the bus.

        Args:
            now_s: Time up to which all received frames have been processed [s].
            reaction_s: Time that a command to the drives needs until it is on the bus [s].
        """
        if not self._armed:
            return
        for axis, consumer in enumerate(self.heartbeats):
            if consumer.has_expired(now_s + reaction_s):
                self._note(EventKind.HEARTBEAT_LOST, axis, now_s, "stopped sending its heartbeat")

    @property
    def unexpected_identifiers(self) -> str:
        """Identifiers that no drive of the cell should send, as text; at most `MOST_NAMED`."""
        named = ", ".join(f"{cob_id:03X}h" for cob_id in sorted(self._seen)[:MOST_NAMED])
        return named + (", …" if len(self._seen) > MOST_NAMED else "")

    def take_events(self) -> tuple[DriveEvent, ...]:
        """Return and clear the events."""
        if not self._events:
            return ()
        events = tuple(self._events)
        self._events.clear()
        return events

    def faults(self) -> tuple[DriveEvent, ...]:
        """Return the stored events after which motion must not continue, without removing them."""
        return tuple(event for event in self._events if event.kind.is_fault)

    def _heartbeat_arrived(self, axis: int, data: bytes, now_s: float) -> None:
        if len(data) != 1:
            self._note(
                EventKind.WRONG_LENGTH,
                axis,
                now_s,
                f"sent a heartbeat of {len(data)} bytes instead of 1",
                len(data),
            )
            return
        state = data[0] & 0x7F
        self.heartbeats[axis].note_heartbeat(state, now_s, data[0] & TOGGLE_BIT)
        if state == NmtState.INITIALISING:
            self.boot_ups[axis] += 1
            if self._armed:
                self._note(
                    EventKind.BOOT_UP,
                    axis,
                    now_s,
                    "booted: it was reset or lost its supply, and has lost its configuration",
                )
        elif self._operational and state != NmtState.OPERATIONAL:
            text = f"left the cyclic exchange: its NMT state is {state_name(state)}"
            self._note(EventKind.NOT_OPERATIONAL, axis, now_s, text, state)

    def _emergency_arrived(self, axis: int, data: bytes, now_s: float) -> None:
        code, words = _emergency(bytes(data))
        kind = EventKind.EMERGENCY if code else EventKind.EMERGENCY_CLEARED
        self._note(kind, axis, now_s, words, code)

    def _report_unexpected(self, cob_id: int, now_s: float) -> None:
        foreign = self.foreign_master(cob_id)
        self.unexpected_frames += 1
        # a master uses few identifiers, so they are stored even if `_seen` is full
        full = foreign is None and len(self._seen) >= MOST_EVENTS
        if full or cob_id in self._seen:
            return
        if foreign is not None:
            kind = EventKind.FOREIGN_MASTER
            text = f"another master is active on this bus: it sends {foreign}"
        else:
            kind = EventKind.UNEXPECTED_FRAME
            text = f"received a frame with identifier {cob_id:03X}h, which no drive should send"
        kept = self._append(DriveEvent(kind, "", now_s, text, cob_id))
        if kept or foreign is None:  # an event about a master that was not stored comes again
            self._seen.add(cob_id)

    def _note(self, kind: EventKind, axis: int, now_s: float, text: str, code: int = 0) -> None:
        joint = self._joint_names[axis]
        self._append(DriveEvent(kind, joint, now_s, f"{joint}: the drive {text}", code))

    def _append(self, event: DriveEvent) -> bool:
        """Store an event if there is room; return True if it was stored."""
        room = len(self._events) < MOST_EVENTS
        if room:
            self._events.append(event)
        else:
            self.dropped_events += 1
        return room


def other_senders(
    axes: Sequence[DriveAxis],
    watch: DriveWatch,
    second_answers: NDArray[np.int64],
    contradictions: NDArray[np.int64],
) -> tuple[str, ...]:
    """Return sentences about identifiers that two devices use, and about unexpected ones.

    Args:
        axes: The drives.
        watch: Monitor that counts frames with unexpected identifiers.
        second_answers, contradictions: Shape (axes,). Number of cycles in which two answers came
            with each drive's identifier, and of those in which the two differed.
    """
    notes = [
        f"{axis.joint}: node {axis.node_id} answered twice in {cycles} cycle{'s' * (cycles != 1)},"
        f" {differing} with different data: two devices send with its identifier, or a"
        " gateway repeats it"
        for axis, cycles, differing in zip(
            axes, second_answers.tolist(), contradictions.tolist(), strict=True
        )
        if cycles
    ]
    if watch.unexpected_frames:
        notes.append(
            f"{watch.unexpected_frames} frames came with identifiers that no drive of the cell"
            f" should send ({watch.unexpected_identifiers}): another device or program sends on"
            " this bus"
        )
    return tuple(notes)


# a drive that floods the bus sends the same few messages again and again
@lru_cache(maxsize=MOST_EVENTS)
def _emergency(data: bytes) -> tuple[int, str]:
    """Return error code and description of an emergency message."""
    emergency = parse_emcy(data)
    return emergency.code, f"reported: {printable(str(emergency), 160)}"
