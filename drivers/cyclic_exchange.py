"""`CyclicExchange`: SYNC, the drives' answers and their set-points, every cycle, at little cost.

Cycle k: SYNC, at which every drive takes up the set-point of cycle k-1 and answers with statusword,
position and torque (TPDO 1); then the next set-point (RPDO 1), which acts at SYNC k+1.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.canopen.frames import SYNC, rpdo_cob_id, tpdo_cob_id
from drivers.cia402 import AxisUnits, ControlWord, PowerState
from drivers.drive_watch import DriveWatch
from drivers.transport import CanLink
from drivers.wrist_coupling import WristCoupling

_COMMAND = struct.Struct("<Hih")
_ANSWER = struct.Struct("<Hih")

MOST_FRAMES = 1024
LATE_CYCLES = 4


class CyclicExchange:
    """The cyclic frames of all axes: messages and arrays are made once and used again.

    Parameters
    ----------
    link
        The bus; the constructor does not use it.
    node_ids
        The drives, base to flange.
    watch
        Takes every frame that is not a TPDO of these drives.
    coupling
        What the motors do to the joints, where a wrist is coupled.

    Attributes
    ----------
    received : ndarray of bool, shape (n,)
        Whether the drive answered in this cycle; if not, the other arrays keep its last values.
    position : ndarray of float, shape (n,)
        Of the joints [rad or m].
    torque_nm : ndarray of float, shape (n,)
        Of the motors, at the link side of their gears [N m or N].
    position_counts, torque_raw, statusword : ndarray of int32, int16, uint16, shape (n,)
        6064h, 6077h and 6041h as they came.
    late_frames, duplicate_frames
        How many TPDOs came after their cycle, or twice; they are not used. An answer too many is a
        late one where its drive did not answer in one of the `LATE_CYCLES` cycles before.
    left_enabled
        Whether an answer has shown another state than Operation Enabled; set here, cleared by the
        owner.
    sync_time_s
        Time of the last SYNC [s].
    """

    def __init__(
        self,
        link: CanLink,
        node_ids: Sequence[int],
        watch: DriveWatch,
        coupling: WristCoupling | None = None,
    ) -> None:
        count = len(node_ids)
        self._link = link
        self._watch = watch
        self.received: NDArray[np.bool_] = np.zeros(count, dtype=np.bool_)
        self.position = np.zeros(count)
        self._coupling = coupling
        self._motor_position = self.position if coupling is None else np.zeros(count)
        self.torque_nm = np.zeros(count)
        self.position_counts = np.zeros(count, dtype=np.int32)
        self.torque_raw = np.zeros(count, dtype=np.int16)
        self.statusword = np.zeros(count, dtype=np.uint16)
        self.late_frames = 0
        self.duplicate_frames = 0
        self.left_enabled = False
        self.sync_time_s = -math.inf
        self._cycle = 0
        self._missed_in = [-LATE_CYCLES - 1] * count  # the last cycle without an answer
        self._slots = {tpdo_cob_id(node): axis for axis, node in enumerate(node_ids)}
        self._zero_counts = [0] * count
        self._counts_per_rad = [1.0] * count
        self._units_per_rad_s = [1.0] * count
        self._nm_per_permille = [1.0] * count
        self._buffers = [bytearray(_COMMAND.size) for _ in node_ids]
        self._commands = [
            (rpdo_cob_id(node), buffer)
            for node, buffer in zip(node_ids, self._buffers, strict=True)
        ]

    def use_units(self, units: Iterable[AxisUnits]) -> None:
        """Take the drives' units, base to flange."""
        for axis, unit in enumerate(units):
            self._zero_counts[axis] = unit.zero_counts
            self._counts_per_rad[axis] = unit.counts_per_rad
            self._units_per_rad_s[axis] = unit.velocity_units_per_rad_s
            self._nm_per_permille[axis] = unit.nm_per_permille

    def sync(self) -> float:
        """Send SYNC; return its time on the link's clock [s].

        What still waits from the cycle before is read first, so that it is not taken for an answer
        to this SYNC; in simulated time the frames' own stamps tell.
        """
        for axis, received in enumerate(self.received.tolist()):
            if not received:
                self._missed_in[axis] = self._cycle
        if not self._link.simulated:
            self._read_waiting()
        self._cycle += 1
        self.sync_time_s = self._link.clock.now_s()
        self._link.send_frames((SYNC,))
        return self.sync_time_s

    def _read_waiting(self) -> None:
        receive = self._link.receive
        for _ in range(MOST_FRAMES):
            frame = receive(-math.inf)
            if frame is None:
                return
            axis = self._slots.get(frame.cob_id)
            if axis is not None:
                self._count_surplus(axis)
            else:
                self._watch.handle(frame, self._link.last_time_s)

    def _count_surplus(self, axis: int) -> None:
        """Count an answer too many: that of an earlier cycle that lacks one, or a copy."""
        if self._cycle - self._missed_in[axis] <= LATE_CYCLES:
            self._missed_in[axis] = -LATE_CYCLES - 1
            self.late_frames += 1
        else:
            self.duplicate_frames += 1

    def collect(self, deadline_s: float) -> None:
        """Wait for every axis's answer, at most until `deadline_s` [s]; fill the arrays.

        An axis whose answer does not come keeps its last values and has `received` False.
        """
        received = self.received
        received.fill(False)
        missing = len(self._commands)
        link = self._link
        receive = link.receive
        slots = self._slots
        for _ in range(MOST_FRAMES):
            frame = receive(deadline_s)
            if frame is None:
                break
            cob_id, data = frame
            axis = slots.get(cob_id)
            if axis is None:
                self._watch.handle(frame, link.last_time_s)
                continue
            if len(data) != 8:
                self._watch.wrong_length(axis, len(data), link.last_time_s)
            elif received[axis] or link.last_time_s < self.sync_time_s:
                self._count_surplus(axis)
            else:
                status, counts, torque = _ANSWER.unpack(data)
                received[axis] = True
                self.statusword[axis] = status
                self.position_counts[axis] = counts
                self.torque_raw[axis] = torque
                turned = counts - self._zero_counts[axis]
                self._motor_position[axis] = turned / self._counts_per_rad[axis]
                self.torque_nm[axis] = torque * self._nm_per_permille[axis]
                if status & 0x6F != PowerState.OPERATION_ENABLED:
                    self.left_enabled = True
                missing -= 1
                if not missing:
                    break
        if self._coupling is not None:
            self._coupling.to_joints(self._motor_position, self.position)
        self._watch.check(self.sync_time_s)

    def send_velocities(self, velocity: NDArray[np.float64]) -> None:
        """Send set-points [rad/s or m/s, joint side] with Enable Operation; all of them or none.

        Raises
        ------
        ValueError, OverflowError, struct.error
            A velocity is not finite or does not fit 60FFh: nothing was sent.
        TransportError
            The bus does not take a frame.
        """
        if self._coupling is not None:
            velocity = self._coupling.to_motors(velocity)
        for buffer, value, factor in zip(
            self._buffers, velocity.tolist(), self._units_per_rad_s, strict=True
        ):
            _COMMAND.pack_into(buffer, 0, ControlWord.ENABLE_OPERATION, round(value * factor), 0)
        self._link.send_frames(self._commands)

    def send_words(self, words: Sequence[int]) -> None:
        """Send controlwords with velocity 0, one an axis; every axis's is tried.

        Raises
        ------
        TransportError
            The bus did not take one of the frames.
        """
        for word, buffer in zip(words, self._buffers, strict=True):
            _COMMAND.pack_into(buffer, 0, word, 0, 0)
        self._link.send_frames(self._commands)
