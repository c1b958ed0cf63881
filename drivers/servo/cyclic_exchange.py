"""`CyclicExchange`: exchange of SYNC, answers and set-points with all drives in every cycle.

Cycle k begins with SYNC. Every drive then applies the set-point of cycle k-1 and answers with
statusword, position and torque (TPDO 1). Afterwards the next set-point is sent (RPDO 1), which acts
at SYNC k+1. A drive whose RPDO is asynchronous applies its set-point on arrival instead. In the
trimmed exchange, controlword and statusword have their own frames (RPDO 2, TPDO 2), which are sent
when they change. The answer of a drive is joined from several frames if its PDOs are fixed, if its
torque is read by SDO, or if it sends its digital inputs.
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
from drivers.servo.axis_frames import JOINED_ANSWER, AnswerJoiner, AxisFrames
from drivers.servo.cia402 import AxisUnits, PowerState, enabling_word, state_of
from drivers.servo.command_frames import Frames, FullCommands, SpreadCommands, TrimmedCommands
from drivers.servo.drive_watch import DriveWatch
from drivers.servo.position_counter import BITS_32, PositionTargets

_TRIMMED_ANSWER = struct.Struct("<ih")
_STATUS = struct.Struct("<H")
_BARE_BITS = 47  # frame without data and stuff bits, with intermission

MOST_FRAMES = 1024
LATE_CYCLES = 4
WATCHED_CYCLES = 10
"""Number of cycles in which `collect` waits for second answers, after a second answer arrived."""

LATER, EARLIER = 0.1, 0.02
"""Fractions by which `collect` corrects the expected arrival time of the last answer in a cycle,
after it arrived later, or earlier, than expected."""

MOST_BURSTS = 1.5
READING_S = 25e-6
"""Time from a frame's time stamp until the program can read the frame [s]."""

QUICK_STOP_LATENCY_S, QUICK_STOP_BURSTS = 300e-6, 1.2
"""Parts of the time from the last answer until a quick stop is on the bus: computing time [s], and
waiting time for the bus, in multiples of the duration of all answers of a cycle."""


class CyclicExchange:
    """Exchange of the cyclic frames with all axes; frames and arrays are allocated once and reused.

    Args:
        link: The bus; the constructor does not use it.
        node_ids: The drives, base to flange.
        watch: Monitor that receives every frame that is not a TPDO of these drives.
        coupling: Coupling of motors and joints, if a wrist is coupled.
        trimmed: True for the trimmed exchange (`exchange: trimmed` in the cell file).
        profiles: The drives' profiles; if left out, those of drives that follow CiA 402 completely.
        cycle_time_s: Cycle time [s], by which the set-points of drives in a position mode are
            integrated.
        bitrate: Bit rate of the bus [bit/s]. With a bit rate, in real time, `collect` sleeps until
            it expects that all answers have arrived, instead of waking up for each one; it
            estimates this time from the answers' time stamps. 0 disables the sleep.

    Attributes:
        answers: The latest answers; counts, torque and status word are the values of 6064h, 6077h
            and 6041h. If more than one answer of a drive arrives in a cycle, the additional answer
            counts as late if the drive did not answer in one of the `LATE_CYCLES` cycles before;
            otherwise it counts as a second answer. After a second answer, `collect` waits for
            further second answers in the next `WATCHED_CYCLES` cycles. A second answer that arrives
            after `collect` has returned is still counted for its own cycle, although the first
            answer of that cycle was used.
        duplicate_frames: Number of second answers of all drives; they are not used.
        contradictions: Shape (n,). Number of cycles in which two answers with a drive's identifier
            had different data; neither answer is used.
        left_enabled: True after an answer has shown a state other than Operation Enabled; only the
            owner of this object sets it to False.
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
        self.answers = Answers.initial(count)
        self._coupling = coupling
        position = self.answers.position
        self._motor_position = position if coupling is None else np.zeros(count)
        self.duplicate_frames = 0
        self.contradictions: NDArray[np.int64] = np.zeros(count, dtype=np.int64)
        self.left_enabled = False
        self.sync_time_s = -math.inf
        self._cycle = 0
        self._missed_in = [-LATE_CYCLES - 1] * count  # for each axis: last cycle without an answer
        # for each axis: first answer of the last cycle in which the drive answered
        self._data = [b""] * count
        self._status = [-1] * count  # for each axis: last status word; -1 before the first one
        self._answered_in = [-1] * count  # for each axis: cycle of the answer in `_data`
        self._doubled_in = [-1] * count  # for each axis: last cycle with a second answer
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
        if self._joiner is not None:
            self._answer_bytes = JOINED_ANSWER.size
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

        If frames have no time stamps, frames that are still unread from the previous cycle are read
        first, so that they are not mistaken for answers to this SYNC.
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
            self._link.send_frames((SYNC, *self._joiner.requests))
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
        """Count an additional answer: late if an earlier cycle lacks one, else a second answer."""
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
        """Count contradicting answers; if either shows a disabled drive, take it as true."""
        if self._contradicted_in[axis] != cycle:
            self._contradicted_in[axis] = cycle
            self.contradictions[axis] += 1
        if not self._trimmed:
            for each in (data, self._data[axis]):
                if (
                    len(each) == self._answer_bytes
                ):  # frames of other lengths have not been checked yet
                    state = state_of(_STATUS.unpack_from(each)[0])
                    self.left_enabled |= state is not PowerState.OPERATION_ENABLED

    def collect(self, deadline_s: float) -> None:
        """Wait for the answers of all axes, at most until `deadline_s` [s]; fill `answers`.

        If an axis has no answer, or two different ones, its values remain unchanged and its
        `received` is False. A quick stop needs some time until it is on the bus. Therefore a
        drive's heartbeat already counts as lost if its timeout will end within this time.
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
            read_s = max(read_s, deadline_s)  # all frames that arrived until then have been read
        if self._coupling is not None:
            self._coupling.to_joints(self._motor_position, self.answers.position)
        self._watch.check(read_s if self._stamped else sync_s, self._stop_latency_s)

    def _update_delay(self, arrival_s: float) -> None:
        """Adapt the expected time from SYNC to the last answer, at which `collect` wakes up."""
        if self._burst_s and self._link.time_stamped:
            rate = LATER if arrival_s > self._expected_s else EARLIER
            expected_s = self._expected_s + rate * (arrival_s - self._expected_s)
            self._expected_s = min(max(expected_s, self._burst_s), MOST_BURSTS * self._burst_s)

    def _take_answer(self, axis: int, data: bytes) -> None:
        answers = self.answers
        if self._trimmed:
            counts, torque = _TRIMMED_ANSWER.unpack(data)
        else:
            if self._joiner is None:
                status, counts, torque = _ANSWER.unpack(data)
            else:
                status, counts, torque, answers.inputs[axis] = JOINED_ANSWER.unpack(data)
            if status != self._status[axis]:
                self._take_status(axis, status)
        answers.position_counts[axis] = counts
        answers.torque_raw[axis] = torque
        turned = self.counters[axis].nearest(counts, self._middle_counts[axis])
        turned -= self._zero_counts[axis]
        self._motor_position[axis] = turned / self._counts_per_rad[axis]
        answers.torque_nm[axis] = torque * self._nm_per_unit[axis]

    def _take_status(self, axis: int, status: int) -> None:
        """Process a new value of an axis's status word."""
        state = state_of(status)
        enabled = state is PowerState.OPERATION_ENABLED
        self._status[axis] = status
        self.answers.statusword[axis] = status
        self.answers.enabled[axis] = enabled
        self.answers.fault[axis] = state.faulty
        self.left_enabled |= not enabled

    def _other_frame(self, arrival: Arrival) -> None:
        """Process a frame that does not answer SYNC, such as a separate frame with a statusword."""
        cob_id, data, time_s = arrival
        axis = self._status_slots.get(cob_id)
        if axis is None:
            self._watch.handle(Frame(cob_id, data), time_s)
        elif len(data) == _STATUS.size:
            self._take_status(axis, *_STATUS.unpack(data))
        else:
            self._watch.wrong_length(axis, len(data), time_s, _STATUS.size)

    def send_velocities(self, velocity: NDArray[np.float64]) -> None:
        """Send velocities [rad/s or m/s, joint side] to all axes, with Enable Operation.

        Raises:
            ValueError, OverflowError, struct.error: A velocity is not finite or too large for
                60FFh; no frame was sent.
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
        """Send a controlword to every axis, with set-points that cause no motion.

        Raises:
            TransportError: The bus did not accept one of the frames; all others were still sent.
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
