"""`BusFaults`: applies the faults of a script to the frames of a simulated CAN bus.

Faults change a frame when its sender passes it to the bus, before arbitration. A dropped frame
therefore takes no time on the bus, while a duplicate takes its full time.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Mapping

from config.simulation.faults import (
    AdapterFault,
    FaultScript,
    FrameFault,
    FrameKind,
    StrangeFrames,
    TaskDelay,
)
from drivers.canopen.frames import (
    EMCY_BASE,
    HEARTBEAT_BASE,
    SDO_ANSWER_BASE,
    SDO_REQUEST_BASE,
    SYNC_COB_ID,
    rpdo_cob_id,
    tpdo_cob_id,
)
from mock_hw.bus.arbitration import Source, WireFrame
from mock_hw.host.fault_clock import CycleCount, FaultStart

_UNKNOWN_SENDER: Source = (-1, 0)
_OWN_LANE = 256
"""Added to the number of a controller, so that a delayed frame has a queue of its own and does not
delay the controller's other frames."""

Queued = tuple[Source, WireFrame]


def identifiers(kind: FrameKind, nodes: list[int], master: int) -> frozenset[int] | None:
    """Return the identifiers of a kind of frame; None if the kind is `any`."""
    if kind == "any":
        return None
    if kind == "sync":
        return frozenset((SYNC_COB_ID,))
    if kind == "master_heartbeat":
        return frozenset((HEARTBEAT_BASE + master,))
    base = {
        "answer": tpdo_cob_id(0),
        "command": rpdo_cob_id(0),
        "heartbeat": HEARTBEAT_BASE,
        "emergency": EMCY_BASE,
        "sdo_request": SDO_REQUEST_BASE,
        "sdo_answer": SDO_ANSWER_BASE,
    }[kind]
    return frozenset(base + node for node in nodes)


class _FrameFaultRunner:
    """Applies one `FrameFault`."""

    def __init__(
        self, fault: FrameFault, ids: frozenset[int] | None, seed: str, start_s: float
    ) -> None:
        self.begin = FaultStart(fault, start_s)
        self._fault = fault
        self._ids = ids
        self._random = random.Random(seed)
        self._seen = 0
        self._left = fault.most
        self._held: dict[int, Queued] = {}

    def apply(self, queued: Queued) -> list[Queued]:
        """Return the frames that replace a frame because of this fault."""
        _, frame = queued
        if self._ids is not None and frame.can_id not in self._ids:
            return [queued]
        self._seen += 1
        before = self._held.pop(frame.can_id, None)
        if before is not None:
            return [queued, before]
        fault = self._fault
        if self._left == 0 or self._seen < (fault.at_frame or 0):
            return [queued]
        if fault.probability < 1.0 and self._random.random() >= fault.probability:
            return [queued]
        if self._left is not None:
            self._left -= 1
        return self._apply_once(queued)

    def _apply_once(self, queued: Queued) -> list[Queued]:
        source, frame = queued
        fault = self._fault
        if fault.kind == "drop":
            return []
        if fault.kind == "duplicate":
            return [queued, queued]
        if fault.kind == "spoof":
            return [(_UNKNOWN_SENDER, _spoofed_answer(frame, fault)), queued]
        if fault.kind == "reorder":
            self._held[frame.can_id] = queued
            return []
        if fault.kind == "delay":
            assert fault.delay_s is not None
            late = frame._replace(time_ns=frame.time_ns + round(fault.delay_s * 1e9))
            return [((source[0], _OWN_LANE + source[1]), late)]
        if fault.kind == "wrong_length":
            assert fault.length is not None
            return [(source, frame._replace(length=fault.length))]
        bits = 8 * frame.length
        if not bits:
            return [queued]
        bit = self._random.randrange(bits) if fault.bit is None else fault.bit % bits
        flipped = bytearray(frame.data)
        flipped[bit // 8] ^= 1 << bit % 8
        return [(source, frame._replace(data=bytes(flipped)))]


def _spoofed_answer(frame: WireFrame, fault: FrameFault) -> WireFrame:
    """Return a drive's answer (full or trimmed) with changed position and torque."""
    answer = struct.Struct("<Hih" if frame.length == 8 else "<ih")
    *status, position, torque = answer.unpack(frame.data[: frame.length])
    position = (position + fault.position_counts + 2**31) % 2**32 - 2**31
    torque = (torque + fault.torque_permille + 2**15) % 2**16 - 2**15
    data = answer.pack(*status, position, torque).ljust(len(frame.data), b"\0")
    return frame._replace(data=data)


class BusFaults:
    """Applies the `bus` part of a fault script to one bus.

    Args:
        script: The faults.
        nodes: Node ids of the drives, by joint.
        master: Node id of the computer.
        places: Places of the controlwords, from `controlword_places`.
        start_ns: Present time of the bus [ns].

    Attributes:
        bus_off: Set to True when the adapter goes bus-off; the caller resets it after its reaction.
        unplugged: Set to True when the adapter is unplugged; the caller resets it after its
            reaction.
        cut_off_until_ns: Time until which the adapter receives nothing [ns].
        unplugged_until_ns: Time until which the adapter is unplugged [ns].
    """

    def __init__(
        self,
        script: FaultScript,
        nodes: Mapping[str, int],
        master: int,
        places: Mapping[int, int],
        start_ns: int = 0,
    ) -> None:
        start_s = start_ns * 1e-9
        self._cycles = CycleCount(places)
        self._runners: list[_FrameFaultRunner] = []
        self._others: list[tuple[FaultStart, StrangeFrames | AdapterFault | TaskDelay]] = []
        self._random = random.Random(script.seed)
        for number, fault in enumerate(script.bus):
            if isinstance(fault, FrameFault):
                own = [nodes[fault.joint]] if fault.joint is not None else [*nodes.values()]
                ids = identifiers(fault.frames, own, master)
                self._runners.append(
                    _FrameFaultRunner(fault, ids, f"{script.seed} {number}", start_s)
                )
            else:
                self._others.append((FaultStart(fault, start_s), fault))
        self._active: list[_FrameFaultRunner] = []
        self._waiting: list[Queued] = []
        self._room = 0
        self._mute_until_ns = 0
        self._holds: list[TaskDelay] = []
        self._held_up = 0
        self.bus_off = False
        self.unplugged = False
        self.cut_off_until_ns = 0
        self.unplugged_until_ns = 0

    def take(
        self, source: Source, frame: WireFrame, now_ns: int, *, from_master: bool
    ) -> list[Queued]:
        """Return the frames that replace a frame, and frames that other faults add now."""
        frame = frame._replace(time_ns=max(frame.time_ns, now_ns))
        self._cycles.observe(frame.can_id, frame.data[: frame.length])
        extra = self._begin(now_ns)
        if self._waiting and now_ns >= self._mute_until_ns:
            extra += [(late, old._replace(time_ns=now_ns)) for late, old in self._waiting]
            self._waiting.clear()
        if from_master and now_ns < self._mute_until_ns:
            if len(self._waiting) < self._room:
                self._waiting.append((source, frame))
            return extra
        queued = [(source, frame)]
        for runner in self._active:
            queued = [after for each in queued for after in runner.apply(each)]
        return extra + queued

    def hold_up_ns(self) -> int:
        """Return the time by which a fault delays the computer's next wake-up [ns]."""
        if not self._holds:
            return 0
        hold = self._holds[0]
        self._held_up += 1
        if self._held_up >= hold.count:
            self._holds.pop(0)
            self._held_up = 0
        return round(hold.duration_s * 1e9)

    def _begin(self, now_ns: int) -> list[Queued]:
        cycle, now_s = self._cycles.cycle, now_ns * 1e-9
        for runner in self._runners:
            if runner.begin.starts_now(cycle, now_s):
                self._active.append(runner)
        strange: list[Queued] = []
        for begin, fault in self._others:
            if not begin.starts_now(cycle, now_s):
                continue
            if isinstance(fault, StrangeFrames):
                strange += self._strange_frames(fault, now_ns)
            elif isinstance(fault, TaskDelay):
                self._holds.append(fault)
            else:
                self._disturb(fault, now_ns)
        return strange

    def _strange_frames(self, fault: StrangeFrames, now_ns: int) -> list[Queued]:
        return [
            (
                _UNKNOWN_SENDER,
                WireFrame(
                    now_ns + round(number * fault.period_s * 1e9),
                    fault.identifier,
                    fault.length,
                    0,
                    self._random.randbytes(8),
                ),
            )
            for number in range(fault.count)
        ]

    def _disturb(self, fault: AdapterFault, now_ns: int) -> None:
        until_ns = now_ns + round(fault.duration_s * 1e9)
        if fault.kind == "unplugged":
            self.unplugged = True
            self.unplugged_until_ns = until_ns
            return
        self.bus_off = self.bus_off or fault.kind == "bus_off"
        self.cut_off_until_ns = self._mute_until_ns = until_ns
        self._room = fault.queue if fault.kind == "no_acknowledge" else 0
