"""The frames that carry set-points and controlwords in a cycle: `FullCommands`, `TrimmedCommands`.

Buffers are made once and used again; what is returned is to be sent before the next call.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from drivers.canopen.frames import rpdo_cob_id
from drivers.servo.cia402 import ControlWord

Frames = Sequence[tuple[int, bytearray]]

REFRESH_CYCLES = 8
"""How many cycles a controlword may be unchanged before it is sent once more."""

_FULL = struct.Struct("<Hih")
_VELOCITY = struct.Struct("<i")
_WORD = struct.Struct("<H")


class FullCommands:
    """RPDO 1 of 8 bytes: controlword, target velocity, torque offset.

    Parameters
    ----------
    node_ids : sequence of int
        The drives, base to flange.
    """

    def __init__(self, node_ids: Sequence[int]) -> None:
        self._buffers = [bytearray(_FULL.size) for _ in node_ids]
        self._frames = [
            (rpdo_cob_id(node), buffer)
            for node, buffer in zip(node_ids, self._buffers, strict=True)
        ]

    def velocities(self, values: Sequence[int]) -> Frames:
        """Return set-points (60FFh) with Enable Operation.

        Raises
        ------
        struct.error
            A value does not fit.
        """
        for buffer, value in zip(self._buffers, values, strict=True):
            _FULL.pack_into(buffer, 0, ControlWord.ENABLE_OPERATION, value, 0)
        return self._frames

    def words(self, words: Sequence[int]) -> Frames:
        """Return controlwords with velocity 0."""
        for buffer, word in zip(self._buffers, words, strict=True):
            _FULL.pack_into(buffer, 0, word, 0, 0)
        return self._frames

    def forget(self) -> None:
        """Do nothing: every frame says everything."""


class TrimmedCommands:
    """RPDO 1 of 4 bytes, the velocity, every cycle; RPDO 2, the controlword, when it changes.

    While controlwords are commanded they are refreshed too, one axis a cycle at most where there
    are up to `REFRESH_CYCLES` axes, so that a lost frame does not stay lost and a full bus not get
    fuller.

    Parameters
    ----------
    node_ids : sequence of int
        The drives, base to flange.
    """

    def __init__(self, node_ids: Sequence[int]) -> None:
        self._velocities = [(rpdo_cob_id(node), bytearray(_VELOCITY.size)) for node in node_ids]
        self._words = [(rpdo_cob_id(node, 2), bytearray(_WORD.size)) for node in node_ids]
        self._sent: list[int | None] = [None] * len(node_ids)
        self._cycle = 0

    def velocities(self, values: Sequence[int]) -> Frames:
        """Return set-points (60FFh); with Enable Operation where that was not the last word.

        Raises
        ------
        struct.error
            A value does not fit.
        """
        for (_, buffer), value in zip(self._velocities, values, strict=True):
            _VELOCITY.pack_into(buffer, 0, value)
        enable = int(ControlWord.ENABLE_OPERATION)
        if self._sent.count(enable) == len(self._sent):
            return self._velocities
        return [*self._changed([enable] * len(self._sent)), *self._velocities]

    def words(self, words: Sequence[int]) -> Frames:
        """Return controlwords, as far as they have changed or are due again, and velocity 0."""
        for _, buffer in self._velocities:
            _VELOCITY.pack_into(buffer, 0, 0)
        self._cycle += 1
        for axis in range(len(self._sent)):
            if (self._cycle + axis) % REFRESH_CYCLES == 0:
                self._sent[axis] = None
        return [*self._changed(words), *self._velocities]

    def forget(self) -> None:
        """Send every controlword with the next frames: some may not have gone out."""
        self._sent = [None] * len(self._sent)

    def _changed(self, words: Sequence[int]) -> list[tuple[int, bytearray]]:
        frames = []
        for axis, (word, frame) in enumerate(zip(words, self._words, strict=True)):
            if self._sent[axis] != word:
                self._sent[axis] = int(word)
                _WORD.pack_into(frame[1], 0, word)
                frames.append(frame)
        return frames
