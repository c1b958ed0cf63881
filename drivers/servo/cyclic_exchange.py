"""`CyclicExchange`: SYNC, the drives' answers and their set-points, every cycle, at little cost.

Cycle k: SYNC, at which every drive takes up the set-point of cycle k-1 and answers with statusword,
position and torque (TPDO 1); then the next set-point (RPDO 1), which acts at SYNC k+1. Where it is
trimmed, controlword and statusword are frames of their own (RPDO 2, TPDO 2), sent when they change.
Where a drive's PDOs are fixed, or its torque is asked for, its answer is joined of several frames.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from config.cell.servo_profile import ServoProfile
from config.errors import TransportError
from config.robot.wrist_coupling import WristCoupling
from drivers.canopen.frames import SYNC, Frame, tpdo_cob_id
from drivers.interfaces.servo_axes import Answers
from drivers.ports.can_link import CanLink
from drivers.ports.can_ports import Arrival
from drivers.servo.axis_frames import ANSWER as _ANSWER
from drivers.servo.axis_frames import AnswerJoiner, AxisFrames
from drivers.servo.cia402 import AxisUnits, PowerState, enabling_word, state_of
from drivers.servo.command_frames import Frames, FullCommands, SpreadCommands, TrimmedCommands
from drivers.servo.drive_watch import DriveWatch
from drivers.servo.position_counter import BITS_32, PositionTargets

_TRIMMED_ANSWER = struct.Struct("<ih")
_STATUS = struct.Struct("<H")
_BARE_BITS = 47  # of a frame without data, intermission included, no stuff bit

MOST_FRAMES = 1024
LATE_CYCLES = 4
WATCHED_CYCLES = 10
"""For how many cycles `collect` waits for second answers once one came."""

LATER, EARLIER = 0.1, 0.02
"""How fast `collect` learns that answers come later, or earlier, than it had expected."""

MOST_BURSTS = 1.5
READING_S = 25e-6
"""How long a frame takes from its time stamp until it can be read [s]."""

TELLING_S, TELLING_BURSTS = 300e-6, 1.2
"""How long a quick stop takes from the last answer until it is on the bus: for this computer [s],
and for the bus, in bursts of answers."""


class CyclicExchange:
    """The cyclic frames of all axes: messages and arrays are made once and used again.

    Args:
        link: The bus; the constructor does not use it.
        node_ids: The drives, base to flange.
        watch: Takes every frame that is not a TPDO of these drives.
        coupling: What the motors do to the joints, where a wrist is coupled.
        trimmed: Whether the cell's exchange is the trimmed one.
        profiles: What each drive is told, and how; CiA 402's where it is left out.
        cycle_time_s: How long a set-point acts [s]; of matter to drives that follow positions.
        bitrate: Of the bus [bit/s]. In real time `collect` sleeps until all answers should have
            come, instead of waking up for each; when that is, is learnt from their time stamps. 0
            to look at once.

    Attributes:
        answers: What `collect` took last; counts, torque and status word are 6064h, 6077h and
            6041h. An answer too many is a late one where its drive did not answer in one of the
            `LATE_CYCLES` cycles before, otherwise a second one. What comes after `collect` has
            returned belongs to the cycle before, whose first answer was used; the next
            `WATCHED_CYCLES` cycles wait for both.
        duplicate_frames: How many second answers came; they are not used.
        contradictions: Shape (n,). In how many cycles an identifier's answers differed: then
            neither is used.
        left_enabled: Whether an answer has shown another state than Operation Enabled; set here,
            cleared by the owner.
        sync_time_s: Time of the last SYNC [s].
    """

    def __init__(
        self,
        link: CanLink,
        node_ids: Sequence[int],
        watch: DriveWatch,
        coupling: WristCoupling | None = None,
        *,
        trimmed: bool = False,
        bitrate: int = 0,
        profiles: Sequence[ServoProfile] = (),
        cycle_time_s: float = 0.0,
    ) -> None:
        count = len(node_ids)
        self._link = link
        self._watch = watch
        self.answers = Answers.before_any(count)
        self._coupling = coupling
        position = self.answers.position
        self._motor_position = position if coupling is None else np.zeros(count)
        self.duplicate_frames = 0
        self.contradictions: NDArray[np.int64] = np.zeros(count, dtype=np.int64)
        self.left_enabled = False
        self.sync_time_s = -math.inf
        self._cycle = 0
        self._missed_in = [-LATE_CYCLES - 1] * count  # the last cycle without an answer
        self._data = [b""] * count  # of the last answers that came first in their cycle
        self._status = [-1] * count  # the last status word of each; -1: none was seen
        self._answered_in = [-1] * count  # which was this
        self._doubled_in = [-1] * count  # the last cycle with a second answer
        self._contradicted_in = [-1] * count
        self._watched_until = -1
        self._slots = {tpdo_cob_id(node): axis for axis, node in enumerate(node_ids)}
        self._zero_counts = [0] * count
        self.counters = [BITS_32] * count
        self._middle_counts = [0] * count
        self._counts_per_rad = [1.0] * count
        self._units_per_rad_s = [1.0] * count
        self._nm_per_unit = [1.0] * count
        profiles = profiles or [ServoProfile() for _ in node_ids]
        enables = [enabling_word(profile.mode) for profile in profiles]
        self._receive_all = link.receive_all
        self._joiner: AnswerJoiner | None = None
        self._commands: FullCommands | TrimmedCommands | SpreadCommands
        spread: list[AxisFrames] = []
        if any(profile.spread for profile in profiles):
            nodes = zip(node_ids, profiles, strict=True)
            spread = [AxisFrames.of_profile(node, profile) for node, profile in nodes]
            self._joiner = AnswerJoiner(link, node_ids, spread, watch)
            self._receive_all = self._joiner.receive_all
            self._commands = SpreadCommands(spread, enables)
        else:
            self._commands = (TrimmedCommands if trimmed else FullCommands)(node_ids, enables)
        self._rest = [0] * count
        self._positions: PositionTargets | None = None
        if any(profile.by_position for profile in profiles):
            self._positions = PositionTargets(
                [profile.by_position for profile in profiles], cycle_time_s
            )
        self._trimmed = trimmed
        self._answer_bytes = _TRIMMED_ANSWER.size if trimmed else _ANSWER.size
        self._status_slots = {
            tpdo_cob_id(node, 2): axis for axis, node in enumerate(node_ids) if trimmed
        }
        sizes = [size for each in spread for size in each.answer_bytes]
        sizes = sizes or [self._answer_bytes] * count
        bits = (len(sizes) + 1) * _BARE_BITS + 8 * sum(sizes)
        self._burst_s = bits / bitrate if bitrate and not link.simulated else 0.0
        self._expected_s = self._burst_s
        self._telling_s = TELLING_S + (TELLING_BURSTS * bits / bitrate if bitrate else 0.0)
        self._stamped = link.simulated or link.time_stamped

    def use_units(self, units: Iterable[AxisUnits]) -> None:
        """Take the drives' units, base to flange."""
        for axis, unit in enumerate(units):
            self._zero_counts[axis] = unit.zero_counts
            self.counters[axis] = unit.counter
            self._middle_counts[axis] = unit.zero_counts + unit.middle_counts
            self._counts_per_rad[axis] = unit.counts_per_rad
            self._units_per_rad_s[axis] = unit.velocity_units_per_rad_s
            self._nm_per_unit[axis] = unit.nm_per_torque_unit
        self._commands.forget()
        self._status = [-1] * len(self._status)
        for array in (self.answers.statusword, self.answers.enabled, self.answers.fault):
            array.fill(0)

    def sync(self) -> float:
        """Send SYNC; return its time on the link's clock [s].

        Where frames bear no stamps that tell, what still waits from the cycle before is read first,
        so that it is not taken for an answer to this SYNC.
        """
        for axis, answered_in in enumerate(self._answered_in):
            if answered_in != self._cycle:
                self._missed_in[axis] = self._cycle
        if not self._stamped:
            self._read_waiting()
        self._cycle += 1
        self.sync_time_s = self._link.clock.now_s()
        if self._joiner is None:
            self._link.send_frames((SYNC,))
        else:
            self._joiner.begin(self.sync_time_s)
            self._link.send_frames((SYNC, *self._joiner.questions))
        return self.sync_time_s

    def _read_waiting(self) -> None:
        taken = 0
        while taken < MOST_FRAMES and (arrived := self._receive_all(-math.inf)):
            taken += len(arrived)
            for arrival in arrived:
                axis = self._slots.get(arrival.cob_id)
                if axis is not None:
                    self._take_surplus(axis, arrival.data, self._cycle)
                else:
                    self._other_frame(arrival)

    def _take_surplus(self, axis: int, data: bytes, cycle: int) -> None:
        """Take an answer too many: that of an earlier cycle that lacks one, or a second one."""
        if self._cycle - self._missed_in[axis] <= LATE_CYCLES:
            self._missed_in[axis] = -LATE_CYCLES - 1
            self.answers.late_frames += 1
            return
        self.duplicate_frames += 1
        self._watched_until = self._cycle + WATCHED_CYCLES
        if self._doubled_in[axis] != cycle:
            self._doubled_in[axis] = cycle
            self.answers.second_answers[axis] += 1
        if self._answered_in[axis] == cycle and data != self._data[axis]:
            self._contradict(axis, data, cycle)

    def _contradict(self, axis: int, data: bytes, cycle: int) -> None:
        """Note that two differ; one that shows a drive without power may be the true one."""
        if self._contradicted_in[axis] != cycle:
            self._contradicted_in[axis] = cycle
            self.contradictions[axis] += 1
        if not self._trimmed:
            for each in (data, self._data[axis]):
                if len(each) == _ANSWER.size:  # what is read before SYNC was not looked at yet
                    state = state_of(_STATUS.unpack_from(each)[0])
                    self.left_enabled |= state is not PowerState.OPERATION_ENABLED

    def collect(self, deadline_s: float) -> None:
        """Wait for every axis's answer, at most until `deadline_s` [s]; fill the arrays.

        An axis whose answer does not come, or comes twice and says two things, keeps its last
        values and has `received` False. A drive's heartbeat counts as lost if its time-out will
        have ended by the time that a quick stop which is sent now is on the bus.
        """
        received = self.answers.received
        received.fill(False)
        link = self._link
        if self._burst_s:
            expected_s = self.sync_time_s + self._expected_s + READING_S
            link.clock.sleep_until(min(expected_s, deadline_s))
        missing, taken, read_s, last_s = len(received), 0, self.sync_time_s, 0.0
        slots, sync_s, size = self._slots, self.sync_time_s, self._answer_bytes
        cycle, answered_in, answers = self._cycle, self._answered_in, self._data
        while (
            (missing or cycle <= self._watched_until)
            and taken < MOST_FRAMES
            and (arrived := self._receive_all(deadline_s))
        ):
            taken += len(arrived)
            read_s = arrived[-1].time_s
            for arrival in arrived:
                cob_id, data, time_s = arrival
                axis = slots.get(cob_id)
                if axis is None:
                    self._other_frame(arrival)
                elif len(data) != size:
                    self._watch.wrong_length(axis, len(data), time_s, size)
                elif time_s < sync_s:
                    self._take_surplus(axis, data, cycle - 1)
                elif answered_in[axis] == cycle:
                    self._take_surplus(axis, data, cycle)
                else:
                    answered_in[axis] = cycle
                    answers[axis] = data
                    missing -= 1
                    last_s = time_s
        for axis, data in enumerate(answers):
            if answered_in[axis] == cycle != self._contradicted_in[axis]:
                received[axis] = True
                self._take_answer(axis, data)
        if not missing:
            self._learn(last_s - sync_s)
        if (missing or cycle <= self._watched_until) and taken < MOST_FRAMES:
            read_s = max(read_s, deadline_s)  # nothing more came until then
        if self._coupling is not None:
            self._coupling.to_joints(self._motor_position, self.answers.position)
        self._watch.check(read_s if self._stamped else sync_s, self._telling_s)

    def _learn(self, arrival_s: float) -> None:
        """Follow how early the last answer comes after SYNC [s]: nobody need wake up before."""
        if self._burst_s and self._link.time_stamped:
            rate = LATER if arrival_s > self._expected_s else EARLIER
            expected_s = self._expected_s + rate * (arrival_s - self._expected_s)
            self._expected_s = min(max(expected_s, self._burst_s), MOST_BURSTS * self._burst_s)

    def _take_answer(self, axis: int, data: bytes) -> None:
        answers = self.answers
        if self._trimmed:
            counts, torque = _TRIMMED_ANSWER.unpack(data)
        else:
            status, counts, torque = _ANSWER.unpack(data)
            if status != self._status[axis]:
                self._take_status(axis, status)
        answers.position_counts[axis] = counts
        answers.torque_raw[axis] = torque
        turned = self.counters[axis].nearest(counts, self._middle_counts[axis])
        turned -= self._zero_counts[axis]
        self._motor_position[axis] = turned / self._counts_per_rad[axis]
        answers.torque_nm[axis] = torque * self._nm_per_unit[axis]

    def _take_status(self, axis: int, status: int) -> None:
        """Take a status word that is another than the last."""
        state = state_of(status)
        enabled = state is PowerState.OPERATION_ENABLED
        self._status[axis] = status
        self.answers.statusword[axis] = status
        self.answers.enabled[axis] = enabled
        self.answers.fault[axis] = state.faulty
        self.left_enabled |= not enabled

    def _other_frame(self, arrival: Arrival) -> None:
        """Take a frame that is no answer to SYNC: a statusword by itself, or for the watch."""
        cob_id, data, time_s = arrival
        axis = self._status_slots.get(cob_id)
        if axis is None:
            self._watch.handle(Frame(cob_id, data), time_s)
        elif len(data) == _STATUS.size:
            self._take_status(axis, *_STATUS.unpack(data))
        else:
            self._watch.wrong_length(axis, len(data), time_s, _STATUS.size)

    def send_velocities(self, velocity: NDArray[np.float64]) -> None:
        """Send set-points [rad/s or m/s, joint side] with Enable Operation; all of them or none.

        Raises:
            ValueError, OverflowError, struct.error: A velocity is not finite or does not fit 60FFh:
                nothing was sent.
            TransportError: The bus does not take a frame.
        """
        if self._coupling is not None:
            velocity = self._coupling.to_motors(velocity)
        told = [
            round(value * factor)
            for value, factor in zip(velocity.tolist(), self._units_per_rad_s, strict=True)
        ]
        if self._positions is not None:
            told = self._positions.follow(told, self.counters)
        self._send(self._commands.velocities(told))

    def send_words(self, words: Sequence[int]) -> None:
        """Send controlwords at rest, one an axis; every axis's is tried.

        Raises:
            TransportError: The bus did not take one of the frames.
        """
        if self._positions is not None:
            self._rest = self._positions.hold(
                self.answers.position_counts, self.answers.enabled, self.counters
            )
        self._send(self._commands.words(words, self._rest))

    def _send(self, frames: Frames) -> None:
        try:
            self._link.send_frames(frames)
        except TransportError:
            self._commands.forget()
            raise
