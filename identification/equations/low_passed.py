"""`LowPassedColumns`: low-passed columns of equations, with a cache of the constant ones.

A fit of nonlinear parameters evaluates a recording about a dozen times, and the low-pass takes more
time than the computation of the columns. Without gear losses, only few columns depend on the
nonlinear parameters: those of Stribeck friction and of friction with presliding, and the
derivatives. All other columns are then computed and low-passed once, and reused.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import BoolArray, FloatArray, IntArray
from config.column_file import ArrayFile, ArrayPlace
from dynamics.geometry.kinematics import Chain
from dynamics.model.robot_model import RobotModel
from dynamics.terms.conditions import Conditions
from identification.equations.parallel_filter import ParallelFilter
from identification.model.base_parameters import BaseParameters
from identification.model.torque_columns import (
    changing_columns,
    changing_torque_columns,
    torque_columns,
    torque_structure,
)

MOST_BYTES: Final = 2**31
"""Largest size of a recording's cache; columns that do not fit in it are computed every time."""
CHUNK_ROWS: Final = 512
"""Rows whose columns are computed at a time: more would not fit in the cache of a processor."""


@dataclass(eq=False)
class ColumnCache:
    """Cache, in a file, of a recording's columns that do not depend on nonlinear parameters.

    Attributes:
        chain: Kinematic chain of the model; it stays the same object when nonlinear parameters
            change.
        names: Names of the columns.
        blocks: For each first row and stride: mask of the columns that are not zero, and the place
            of their values in the file.
    """

    chain: Chain | None = None
    names: tuple[str, ...] = ()
    blocks: dict[tuple[int, int], tuple[BoolArray, ArrayPlace]] = field(default_factory=dict)
    _file: ArrayFile | None = None

    def begin(self, chain: Chain, names: tuple[str, ...]) -> None:
        """Clear the cache if it belongs to another model or to other columns."""
        if self.chain is not chain or self.names != names:
            self.chain, self.names, self._file = chain, names, None
            self.blocks.clear()

    def keep(self, place: tuple[int, int], seen: BoolArray, values: FloatArray) -> None:
        """Store a block of columns in the cache if the cache has room for it."""
        self._file = self._file or ArrayFile()
        if self._file.size_bytes + values.nbytes <= MOST_BYTES:
            self.blocks[place] = seen, self._file.append(values)

    def of(self, place: tuple[int, int]) -> tuple[BoolArray, FloatArray] | None:
        """Return a block of columns: mask and values; None if it is not in the cache."""
        if self._file is None or place not in self.blocks:
            return None
        seen, where = self.blocks[place]
        return seen, self._file.read(where)


@dataclass(frozen=True, eq=False)
class LowPassedColumns:
    """Computation of one recording's low-passed columns.

    Attributes:
        model, base, standard: As for `torque_columns`.
        signals: The recording.
        conditions: Conditions of the rows from which the columns are computed
            (`ParallelFilter.source`), including presliding hysteresis.
        kept: Cache of this recording's columns; it does not depend on presliding hysteresis.
    """

    model: RobotModel
    base: BaseParameters
    signals: SmoothedSignals
    conditions: Conditions
    standard: FloatArray | None
    kept: ColumnCache

    def of(self, rows: slice, stride: int) -> FloatArray:
        """Return low-passed columns of every `stride`-th row of `rows`, as in `torque_columns`."""
        shared = ParallelFilter(self.signals)
        wide, inner = shared.window(np.arange(rows.start, rows.stop, stride))
        if self.model.transmission.losses:  # all columns depend on nonlinear parameters
            columns = self._flat(wide, self._seen)
            return _expand_columns(self._seen, self._filter(columns, self._seen, wide, inner))
        changing = changing_columns(self.model, self.base)
        fixed = ~changing
        names = tuple(name for name, own in zip(self.base.names, fixed, strict=True) if own)
        self.kept.begin(self.model.chain, names)
        place = (rows.start, stride)
        block = self.kept.of(place)
        if block is None:
            seen = self._seen[:, : len(self.base)]
            columns = self._flat(wide, seen & fixed, linear=True)
            seen = seen[:, fixed]
            block = seen, self._filter(columns, seen, wide, inner)
            self.kept.keep(place, *block)
        if fixed.all() and self.standard is None:
            return _expand_columns(*block)
        moving = changing_torque_columns(
            self.model, self.base, shared.motion(wide), self.conditions.part(wide), self.standard
        )
        count = int(np.count_nonzero(changing))
        slopes = moving.shape[2] - count
        out = np.empty((len(block[1]), moving.shape[1], len(self.base) + slopes))
        out[:, :, : len(self.base)][:, :, fixed] = _expand_columns(*block)
        seen = np.any(moving, axis=0)
        rest = _expand_columns(seen, self._filter(moving[:, seen], seen, wide, inner))
        out[:, :, : len(self.base)][:, :, changing] = rest[:, :, :count]
        out[:, :, len(self.base) :] = rest[:, :, count:]
        return out

    def unfiltered(self, rows: slice, *, linear: bool = False) -> FloatArray:
        """Return the unfiltered columns of source rows; without derivatives if `linear`."""
        conditions = self.conditions.part(rows)
        standard = None if linear else self.standard
        shared = ParallelFilter(self.signals)
        motion = shared.motion(rows)
        if standard is not None and self.model.transmission.losses:
            load = shared.load_nm(self.model, standard, rows, conditions)
            conditions = replace(conditions, load_nm=load)
        return torque_columns(self.model, self.base, motion, conditions, standard)

    @cached_property
    def _seen(self) -> BoolArray:
        """Mask of the columns that a joint's torque can depend on, (n, any)."""
        slopes = self.standard is not None
        count = len(self.base) + (len(self.model.nonlinear_names) if slopes else 0)
        seen = np.zeros((self.model.chain.n, count), dtype=bool)
        structure = torque_structure(self.model, self.base, slopes)
        for own, columns in zip(seen, structure, strict=True):
            own[columns] = True
        return seen

    def _flat(self, rows: slice, seen: BoolArray, *, linear: bool = False) -> FloatArray:
        """Return the unfiltered columns in a mask (n, any) of source rows, (rows, columns)."""
        places = np.flatnonzero(seen)
        flat = np.empty((rows.stop - rows.start, len(places)))
        for start in range(rows.start, rows.stop, CHUNK_ROWS):
            piece = slice(start, min(start + CHUNK_ROWS, rows.stop))
            columns = self.unfiltered(piece, linear=linear).reshape(piece.stop - start, -1)
            columns.take(places, axis=1, out=flat[start - rows.start :][: len(columns)])
        return flat

    def _filter(
        self, flat: FloatArray, seen: BoolArray, wide: slice, inner: IntArray
    ) -> FloatArray:
        """Return the low-passed rows of a window's columns, of each joint those in a mask."""
        shared = ParallelFilter(self.signals)
        if shared.has_channel:
            ends = np.cumsum(seen.sum(axis=1))
            parts = np.split(flat, ends[:-1], axis=1)
            own = [shared.apply_channel(part, j, wide) for j, part in enumerate(parts)]
            flat = np.concatenate(own, axis=1)
        return shared.columns(flat, inner)


def _expand_columns(seen: BoolArray, values: FloatArray) -> FloatArray:
    columns = np.zeros((len(values), *seen.shape))
    columns[:, seen] = values
    return columns
