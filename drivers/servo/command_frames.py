"""Frames with the set-points and controlwords of a cycle: `FullCommands`, `TrimmedCommands`.

`SpreadCommands` is for cells with a drive whose data of a cycle are in several frames. The buffers
of the frames are reused: send the returned frames before the next call.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from drivers.canopen.frames import rpdo_cob_id
from drivers.servo.axis_frames import AxisFrames
from drivers.servo.cia402 import ControlWord

Frames = Sequence[tuple[int, bytearray]]

REFRESH_CYCLES = 8
"""Number of cycles after which an unchanged controlword is sent again, in case a frame was lost."""

_FULL = struct.Struct("<Hi")
_VELOCITY = struct.Struct("<i")
_WORD = struct.Struct("<H")


class FullCommands:
    """Commands in one frame per drive: RPDO 1 with controlword and set-point (6 bytes).

    Args:
        node_ids: The drives, base to flange.
        enables: For each drive, the controlword that switches it to Operation Enabled.
    """

    def __init__(self, node_ids: Sequence[int], enables: Sequence[int]) -> None:
        self._enables = tuple(enables)
        self._buffers = [bytearray(_FULL.size) for _ in node_ids]
        self._frames = [
            (rpdo_cob_id(node), buffer)
            for node, buffer in zip(node_ids, self._buffers, strict=True)
        ]

    def velocities(self, values: Sequence[int]) -> Frames:
        """Return the frames with the set-points and Enable Operation.

        Raises:
            struct.error: A value does not fit into 32 bits.
        """
        for buffer, enable, value in zip(self._buffers, self._enables, values, strict=True):
            _FULL.pack_into(buffer, 0, enable, value)
        return self._frames

    def words(self, words: Sequence[int], rest: Sequence[int]) -> Frames:
        """Return the frames with controlwords, and set-points `rest` that cause no motion."""
        own_words = _with_own_enable(words, self._enables)
        for buffer, word, value in zip(self._buffers, own_words, rest, strict=True):
            _FULL.pack_into(buffer, 0, word, value)
        return self._frames

    def forget(self) -> None:
        """Do nothing, because every frame contains its controlword."""


class SpreadCommands:
    """Commands in the frames of `AxisFrames`; the controlword is sent before the set-point.

    Args:
        frames: The drives' frames, base to flange.
        enables: For each drive, the controlword that switches it to Operation Enabled.
    """

    def __init__(self, frames: Sequence[AxisFrames], enables: Sequence[int]) -> None:
        self._enables = tuple(enables)
        self._frames: list[tuple[int, bytearray]] = []
        self._words: list[tuple[bytearray, int]] = []
        self._targets: list[tuple[bytearray, int]] = []
        for each in frames:
            buffers = {cob_id: bytearray(data) for cob_id, data in each.commands}
            word, target = each.places["controlword"], each.places["target"]
            self._words.append((buffers[word.cob_id], word.start))
            self._targets.append((buffers[target.cob_id], target.start))
            later = sorted(buffers, key=lambda cob_id: cob_id == target.cob_id)
            self._frames += [(cob_id, buffers[cob_id]) for cob_id in later]

    def velocities(self, values: Sequence[int]) -> Frames:
        """Return the frames with the set-points and Enable Operation.

        Raises:
            struct.error: A value does not fit into 32 bits.
        """
        return self._fill(self._enables, values)

    def words(self, words: Sequence[int], rest: Sequence[int]) -> Frames:
        """Return the frames with controlwords, and set-points `rest` that cause no motion."""
        return self._fill(_with_own_enable(words, self._enables), rest)

    def forget(self) -> None:
        """Do nothing, because every frame contains its controlword."""

    def _fill(self, words: Sequence[int], values: Sequence[int]) -> Frames:
        for (buffer, start), value in zip(self._targets, values, strict=True):
            _VELOCITY.pack_into(buffer, start, value)
        for (buffer, start), word in zip(self._words, words, strict=True):
            _WORD.pack_into(buffer, start, word)
        return self._frames


class TrimmedCommands:
    """Commands of the trimmed exchange: set-point every cycle, controlword only when it changes.

    The set-point is RPDO 1 (4 bytes), the controlword RPDO 2 (2 bytes). While controlwords are
    commanded without velocities (`words`), each one is also repeated every `REFRESH_CYCLES` cycles,
    so that a lost frame has no lasting effect. With up to `REFRESH_CYCLES` axes, at most one
    controlword is repeated per cycle, so that the bus is not overloaded.

    Args:
        node_ids: The drives, base to flange.
        enables: For each drive, the controlword that switches it to Operation Enabled.
    """

    def __init__(self, node_ids: Sequence[int], enables: Sequence[int]) -> None:
        self._enables = tuple(enables)
        self._velocities = [(rpdo_cob_id(node), bytearray(_VELOCITY.size)) for node in node_ids]
        self._words = [(rpdo_cob_id(node, 2), bytearray(_WORD.size)) for node in node_ids]
        self._sent: list[int | None] = [None] * len(node_ids)
        self._enabled: list[int | None] = list(self._enables)
        self._cycle = 0

    def velocities(self, values: Sequence[int]) -> Frames:
        """Return the set-points; add Enable Operation if it was not the last controlword.

        Raises:
            struct.error: A value does not fit into 32 bits.
        """
        for (_, buffer), value in zip(self._velocities, values, strict=True):
            _VELOCITY.pack_into(buffer, 0, value)
        if self._sent == self._enabled:
            return self._velocities
        return [*self._find_changes(self._enables), *self._velocities]

    def words(self, words: Sequence[int], rest: Sequence[int]) -> Frames:
        """Return controlwords that changed or must be repeated, and set-points without motion."""
        for (_, buffer), value in zip(self._velocities, rest, strict=True):
            _VELOCITY.pack_into(buffer, 0, value)
        self._cycle += 1
        for axis in range(len(self._sent)):
            if (self._cycle + axis) % REFRESH_CYCLES == 0:
                self._sent[axis] = None
        return [*self._find_changes(_with_own_enable(words, self._enables)), *self._velocities]

    def forget(self) -> None:
        """Repeat all controlwords in the next frames, because some may not have been sent."""
        self._sent = [None] * len(self._sent)

    def _find_changes(self, words: Sequence[int]) -> list[tuple[int, bytearray]]:
        frames = []
        for axis, (word, frame) in enumerate(zip(words, self._words, strict=True)):
            if self._sent[axis] != word:
                self._sent[axis] = int(word)
                _WORD.pack_into(frame[1], 0, word)
                frames.append(frame)
        return frames


def _with_own_enable(words: Sequence[int], enables: Sequence[int]) -> list[int]:
    """Return the controlwords, with Enable Operation replaced by each drive's own word for it."""
    return [
        enable if word == ControlWord.ENABLE_OPERATION else int(word)
        for word, enable in zip(words, enables, strict=True)
    ]
