"""`CyclicExchange`: SYNC, the drives' answers and their set-points in every cycle, efficiently.

Cycle k: SYNC, at which every drive applies the set-point of cycle k-1 and answers with statusword,
position and torque (TPDO 1); then the next set-point (RPDO 1), which acts at SYNC k+1. In the
trimmed exchange, controlword and statusword have their own frames (RPDO 2, TPDO 2), which are sent
when they change. If a drive's PDOs are fixed, or its torque is read by SDO, its answer is joined
from several frames.
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
_BARE_BITS = 47  # length of a frame without data, with intermission, without stuff bits

MOST_FRAMES = 1024
LATE_CYCLES = 4
WATCHED_CYCLES = 10
"""Number of cycles in which `collect` waits for second answers after one came."""

LATER, EARLIER = 0.1, 0.02
"""Rates at which `collect` adapts to answers that come later, or earlier, than expected."""

MOST_BURSTS = 1.5
READING_S = 25e-6
"""Time from a frame's time stamp until it can be read [s]."""

QUICK_STOP_LATENCY_S, QUICK_STOP_BURSTS = 300e-6, 1.2
"""Time from the last answer until a quick stop is on the bus: the computer's part [s], and the
bus's part in bursts of answers."""


class CyclicExchange:
    """The cyclic frames of all axes; messages and arrays are allocated once and reused.

    Args:
        link: The bus; the constructor does not use it.
        node_ids: The drives, base to flange.
        watch: Monitor of every frame that is not a TPDO of these drives.
        coupling: Coupling of motors and joints, if a wrist is coupled.
        trimmed: Whether the cell's exchange is the trimmed one.
        profiles: The drives' profiles; CiA 402's if left out.
        cycle_time_s: Time for which a set-point acts [s]; for drives in a position mode.
        bitrate: Bit rate of the bus [bit/s]. In real time `collect` sleeps until all answers should
            have come, instead of waking up for each; it estimates this time from their time stamps.
            0 disables the sleep.

    Attributes:
        answers: The last answers of `collect`; counts, torque and status word are 6064h, 6077h and
            6041h. If a drive sends more than one answer in a cycle, the surplus answer counts as
            late if the drive did not answer in one of the `LATE_CYCLES` cycles before, otherwise as
            a second answer. After a second answer, `collect` waits for second answers in the next
            `WATCHED_CYCLES` cycles. A second answer that comes after `collect` has returned is
            counted for that cycle, whose first answer was already used.
        duplicate_frames: Number of second answers; they are not used.
        contradictions: Shape (n,). Number of cycles in which an identifier's answers differed; then
            neither is used.
        left_enabled: Whether an answer has shown a state other than Operation Enabled; set here,
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
        self._data = [b""] * count  # the last first answers of a cycle
        self._status = [-1] * count  # the last status words; -1: none was received
        self._answered_in = [-1] * count  # cycles of the answers in `_data`
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
        self._stop_latency_s = QUICK_STOP_LATENCY_S + (
            QUICK_STOP_BURSTS * bits / bitrate if bitrate else 0.0
        )
        self._stamped = link.simulated or link.time_stamped

    def use_units(self, units: Iterable[AxisUnits]) -> None:
        """Set the drives' units, base to flange."""
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

        If frames have no time stamps, the frames that wait from the cycle before are read first, so
        that they are not taken for answers to this SYNC.
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
        """Count a surplus answer as late, if an earlier cycle lacks one, or as a second one."""
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
        """Note that two answers differ; the one that shows a drive without power may be true."""
        if self._contradicted_in[axis] != cycle:
            self._contradicted_in[axis] = cycle
            self.contradictions[axis] += 1
        if not self._trimmed:
            for each in (data, self._data[axis]):
                if len(each) == _ANSWER.size:  # frames that are read before SYNC are unchecked
                    state = state_of(_STATUS.unpack_from(each)[0])
                    self.left_enabled |= state is not PowerState.OPERATION_ENABLED

    def collect(self, deadline_s: float) -> None:
        """Wait for every axis's answer, at most until `deadline_s` [s]; fill the arrays.

        An axis without an answer, or with two different ones, keeps its last values and has
        `received` False. A quick stop needs some time until it is on the bus. A drive's heartbeat
        therefore counts as lost if its timeout ends within this time.
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
            self._update_delay(last_s - sync_s)
        if (missing or cycle <= self._watched_until) and taken < MOST_FRAMES:
            read_s = max(read_s, deadline_s)  # no frame came until then
        if self._coupling is not None:
            self._coupling.to_joints(self._motor_position, self.answers.position)
        self._watch.check(read_s if self._stamped else sync_s, self._stop_latency_s)

    def _update_delay(self, arrival_s: float) -> None:
        """Track the delay of the last answer after SYNC [s], to avoid waking up earlier."""
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
        """Process a status word that differs from the last."""
        state = state_of(status)
        enabled = state is PowerState.OPERATION_ENABLED
        self._status[axis] = status
        self.answers.statusword[axis] = status
        self.answers.enabled[axis] = enabled
        self.answers.fault[axis] = state.faulty
        self.left_enabled |= not enabled

    def _other_frame(self, arrival: Arrival) -> None:
        """Process a frame that is not an answer to SYNC: a separate statusword, or any other."""
        cob_id, data, time_s = arrival
        axis = self._status_slots.get(cob_id)
        if axis is None:
            self._watch.handle(Frame(cob_id, data), time_s)
        elif len(data) == _STATUS.size:
            self._take_status(axis, *_STATUS.unpack(data))
        else:
            self._watch.wrong_length(axis, len(data), time_s, _STATUS.size)

    def send_velocities(self, velocity: NDArray[np.float64]) -> None:
        """Send set-points [rad/s or m/s, joint side] with Enable Operation, all or none.

        Raises:
            ValueError, OverflowError, struct.error: A velocity is not finite or does not fit 60FFh;
                nothing was sent.
            TransportError: The bus does not accept a frame.
        """
        if self._coupling is not None:
            velocity = self._coupling.to_motors(velocity)
        targets = [
            round(value * factor)
            for value, factor in zip(velocity.tolist(), self._units_per_rad_s, strict=True)
        ]
        if self._positions is not None:
            targets = self._positions.follow(targets, self.counters)
        self._send(self._commands.velocities(targets))

    def send_words(self, words: Sequence[int]) -> None:
        """Send controlwords at rest, one per axis; every axis is tried.

        Raises:
            TransportError: The bus did not accept one of the frames.
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
