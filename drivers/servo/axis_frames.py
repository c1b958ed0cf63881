"""Positions of an axis's commands and measured values in its CAN frames; joining of split answers.

Most drives receive all commands in one RPDO and send all measured values in one TPDO. A drive with
fixed PDOs uses several PDOs for these signals, and digital inputs have a PDO of their own. A torque
that cannot be in a PDO is read by SDO after every SYNC. `AnswerJoiner` joins the parts of an answer
to one frame, so that `CyclicExchange` treats all drives in the same way.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from config.cell.fixed_pdo import ANSWERS, Signal
from config.cell.servo_profile import ServoProfile
from drivers.canopen.frames import sdo_answer_cob_id, sdo_request_cob_id, tpdo_cob_id
from drivers.canopen.pdo import PdoMapping
from drivers.canopen.sdo import MULTIPLEXER
from drivers.ports.can_link import CanLink
from drivers.ports.can_ports import Arrival
from drivers.servo.drive_watch import DriveWatch
from drivers.servo.requirements import cyclic_pdos, signal_object

ANSWER: Final = struct.Struct("<Hih")
JOINED_ANSWER: Final = struct.Struct("<HihI")
"""Layout of an answer that was joined from several frames: statusword, position, torque, inputs."""

MOST_READS = 1024

_UPLOAD, _EXPEDITED, _UNUSED_SHIFT = 0x40, 0x43, 2
_SDO_BYTES, _VALUE = 8, 4
_INT16: Final = range(-(2**15), 2**15)


@dataclass(frozen=True, slots=True)
class Place:
    """Position of a signal: identifier of its frame, first byte, and number of bytes."""

    cob_id: int
    start: int
    size: int

    @property
    def end(self) -> int:
        """Position of the byte after the signal."""
        return self.start + self.size


@dataclass(frozen=True)
class AxisFrames:
    """The frames of one axis in a cycle.

    Attributes:
        commands: Identifier and data of the frames to the drive; the data contain constant values,
            and zeros at the positions of set-points.
        places: Positions of the signals; that of a torque that is read by SDO is in the SDO answer.
        sdo_object: Index and sub-index of the object that is read by SDO after every SYNC, or None.
        answer_bytes: Lengths of all frames that the drive can send in a cycle, also of those that
            are not used.
    """

    commands: tuple[tuple[int, bytes], ...]
    places: dict[Signal, Place]
    sdo_object: tuple[int, int] | None
    answer_bytes: tuple[int, ...]

    @classmethod
    def of_profile(cls, node_id: int, profile: ServoProfile) -> AxisFrames:
        """Return the frames of a drive that sends and receives all its PDOs in every cycle."""
        pdos = cyclic_pdos(node_id, "full", profile)
        held = _constant_values(profile)
        wanted: dict[tuple[int, int], Signal] = {
            signal_object(profile, "controlword"): "controlword",
            signal_object(profile, "target"): "target",
            signal_object(profile, "statusword"): "statusword",
            signal_object(profile, "position"): "position",
        }
        if profile.sends_inputs:
            wanted[signal_object(profile, "inputs")] = "inputs"
        sdo_object = None
        if profile.torque.asked:
            sdo_object = signal_object(profile, "torque")
        else:
            wanted[signal_object(profile, "torque")] = "torque"
        places: dict[Signal, Place] = {}
        commands = []
        for pdo in pdos:
            data = bytearray(pdo.bits // 8)
            used = False
            for start, item in _starts(pdo):
                signal = wanted.get((item[0], item[1]))
                receives = signal in ("controlword", "target")
                if signal is not None and receives == (pdo.direction == "rpdo"):
                    bits = min(item[2], profile.torque.bits) if signal == "torque" else item[2]
                    places[signal] = Place(pdo.cob_id, start, bits // 8)
                    used = True
                elif (item[0], item[1]) in held:
                    value = held[item[0], item[1]]
                    data[start : start + item[2] // 8] = value.to_bytes(item[2] // 8, "little")
            if used and pdo.direction == "rpdo":
                commands.append((pdo.cob_id, bytes(data)))
        back = [pdo.bits // 8 for pdo in pdos if pdo.direction == "tpdo"]
        if sdo_object is not None:
            size = profile.torque.bits // 8
            places["torque"] = Place(sdo_answer_cob_id(node_id), _VALUE, size)
            back.append(_SDO_BYTES)
        return cls(tuple(commands), places, sdo_object, tuple(back))

    @property
    def sent_bytes(self) -> tuple[int, ...]:
        """Lengths of the frames that are sent to the drive in a cycle."""
        request = () if self.sdo_object is None else (_SDO_BYTES,)
        return (*(len(data) for _, data in self.commands), *request)


def _constant_values(profile: ServoProfile) -> dict[tuple[int, int], int]:
    held = {}
    for pdo in profile.pdos:
        for entry in pdo.objects:
            if entry.holds is not None:
                index, subindex = entry.object.split("h:")
                held[int(index, 16), int(subindex, 16)] = entry.holds
    return held


def _starts(pdo: PdoMapping) -> Iterator[tuple[int, tuple[int, int, int]]]:
    start = 0
    for item in pdo.objects:
        yield start, (item.index, item.subindex, item.bits)
        start += item.bits // 8


class _Parts:
    """Received parts of one axis's answer in one cycle."""

    def __init__(self) -> None:
        self.first: dict[int, Arrival] = {}
        self.again: dict[int, Arrival] = {}
        self.joined = False


class AnswerJoiner:
    """Bus for `CyclicExchange` that joins the parts of an axis's answer when all have arrived.

    The time of a joined answer is the arrival time of its oldest part. If a part arrives twice, the
    repeated part forms a second answer with the other parts. Parts that arrived before the last
    SYNC are never joined with later parts.

    Args:
        link: The bus.
        node_ids: The drives, base to flange.
        frames: The drives' frames.
        watch: Monitor that gets reports of parts that are too short.
    """

    def __init__(
        self,
        link: CanLink,
        node_ids: Sequence[int],
        frames: Sequence[AxisFrames],
        watch: DriveWatch,
    ) -> None:
        self._link = link
        self._watch = watch
        self._sync_s = 0.0
        self._answer_ids = [tpdo_cob_id(node) for node in node_ids]
        self._places = [
            [each.places[name] for name in ANSWERS if name in each.places] for each in frames
        ]
        self._axis_of: dict[int, int] = {}
        self._ends: dict[int, int] = {}
        for axis, places in enumerate(self._places):
            for place in places:
                self._axis_of[place.cob_id] = axis
                self._ends[place.cob_id] = max(self._ends.get(place.cob_id, 0), place.end)
        self._wanted = [{place.cob_id for place in places} for places in self._places]
        self._requested = {
            sdo_answer_cob_id(node): MULTIPLEXER.pack(0, *each.sdo_object, bytes(4))[1:_VALUE]
            for node, each in zip(node_ids, frames, strict=True)
            if each.sdo_object is not None
        }
        self.requests = [
            (sdo_request_cob_id(node), MULTIPLEXER.pack(_UPLOAD, *each.sdo_object, bytes(4)))
            for node, each in zip(node_ids, frames, strict=True)
            if each.sdo_object is not None
        ]
        self._now = [_Parts() for _ in node_ids]
        self._before = [_Parts() for _ in node_ids]

    def begin(self, sync_s: float) -> None:
        """Begin a cycle: parts that arrive after `sync_s`, the time of SYNC [s], belong to it."""
        self._sync_s = sync_s
        self._before, self._now = self._now, [_Parts() for _ in self._now]

    def receive_all(self, until_s: float) -> Sequence[Arrival]:
        """Return joined answers and all other frames, oldest first; see `CanLink.receive_all`."""
        for _ in range(MOST_READS):
            arrived = self._link.receive_all(until_s)
            if not arrived:
                return ()
            answers = [answer for arrival in arrived for answer in self._take(arrival)]
            if answers:
                return answers
        return ()

    def _take(self, arrival: Arrival) -> Iterator[Arrival]:
        axis = self._axis_of.get(arrival.cob_id)
        if axis is None or not self._is_meant(arrival):
            yield arrival
            return
        needed = self._ends[arrival.cob_id]
        if len(arrival.data) < needed:
            self._watch.wrong_length(axis, len(arrival.data), arrival.time_s, needed)
            return
        parts = (self._before if arrival.time_s < self._sync_s else self._now)[axis]
        if arrival.cob_id not in parts.first:
            parts.first[arrival.cob_id] = arrival
            if parts.first.keys() == self._wanted[axis]:
                parts.joined = True
                yield from self._join(axis, parts.first)
                for cob_id, again in parts.again.items():
                    yield from self._join(axis, parts.first | {cob_id: again})
        elif parts.joined:
            yield from self._join(axis, parts.first | {arrival.cob_id: arrival})
        else:
            parts.again[arrival.cob_id] = arrival

    def _is_meant(self, arrival: Arrival) -> bool:
        """Return False for an SDO answer that does not contain the requested object."""
        wanted = self._requested.get(arrival.cob_id)
        if wanted is None:
            return True
        data = arrival.data
        expedited = len(data) == _SDO_BYTES and data[0] & 0xF3 == _EXPEDITED
        size = 4 - (data[0] >> _UNUSED_SHIFT & 0x03) if expedited else 0
        return data[1:_VALUE] == wanted and _VALUE + size >= self._ends[arrival.cob_id]

    def _join(self, axis: int, parts: dict[int, Arrival]) -> Iterator[Arrival]:
        """Yield the joined answer; yield nothing if the torque does not fit into 16 bits.

        Without it, the axis counts as not having answered in this cycle.
        """
        status, position, torque, *inputs = [
            int.from_bytes(
                parts[place.cob_id].data[place.start : place.end], "little", signed=number in (1, 2)
            )
            for number, place in enumerate(self._places[axis])
        ]
        if torque in _INT16:
            oldest_s = min(part.time_s for part in parts.values())
            data = JOINED_ANSWER.pack(status, position, torque, *(inputs or [0]))
            yield Arrival(self._answer_ids[axis], data, oldest_s)
