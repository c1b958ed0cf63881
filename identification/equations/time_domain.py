"""`TimeRun`: smoothed recordings as equations in the time domain, in blocks to limit memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import BoolArray, FloatArray, IntArray
from config.errors import EstimationError
from dynamics.model.memory import presliding_of_model
from dynamics.model.robot_model import RobotModel
from dynamics.terms.conditions import Conditions
from identification.equations.low_passed import ColumnCache, LowPassedColumns
from identification.equations.parallel_filter import ParallelFilter
from identification.equations.segments import row_stride
from identification.model.base_parameters import BaseParameters

BLOCK_ROWS = 4096
EVENT_S = 1.0
EVENT_PERIODS = 2.0
"""Shortest interval [periods of the cut-off], so that neighbouring intervals are independent."""


@dataclass(frozen=True, eq=False)
class TimeRun:
    """One smoothed recording with its conditions, and a cache of its columns.

    Attributes:
        known: Shape (b,). Contribution of known bodies to the base parameters; None without any.
    """

    signals: SmoothedSignals
    conditions: Conditions
    known: FloatArray | None = None
    kept: ColumnCache = field(default_factory=ColumnCache, init=False)

    @property
    def event(self) -> IntArray:
        """Index of the time interval of each row, from 0, (samples,).

        An interval lasts `EVENT_S` seconds or more.
        """
        signals = self.signals
        length_s = max(EVENT_S, EVENT_PERIODS / signals.cutoff_hz)
        stretch = np.floor((signals.time_s - signals.time_s[0]) / length_s)
        changed = (np.diff(stretch) != 0.0) | (np.diff(signals.segment) != 0)
        return np.concatenate([[0], np.cumsum(changed)])


@dataclass(frozen=True, eq=False)
class TimeBlock:
    """Some rows of the equations rhs = columns x, in the time domain.

    x are the base parameters, and steps of the nonlinear parameters if requested.

    Attributes:
        columns: Shape (rows, n, any). As returned by `torque_columns`.
        rhs: Shape (rows, n). Torque [N m or N].
        use: Shape (rows, n). True if the joint moves fast enough for its friction to be known. If
            its friction has presliding: False until its hysteresis is known, and inside a long
            standstill.
        moving: Shape (rows, n). True if the joint moves fast enough.
        event: Shape (rows,). Index of each row's interval of time, counted over all recordings from
            0.
        time_s: Shape (rows,). Time of the measurement [s].
    """

    columns: FloatArray
    rhs: FloatArray
    use: BoolArray
    moving: BoolArray
    event: IntArray
    time_s: FloatArray

    def event_rows(self) -> list[IntArray]:
        """Return the rows of each interval of time."""
        return np.split(np.arange(len(self.event)), np.flatnonzero(np.diff(self.event)) + 1)

    def of_joint(
        self, joint: int, rows: IntArray, columns: IntArray | slice
    ) -> tuple[FloatArray, FloatArray]:
        """Return a joint's matrix and torque for the usable rows among `rows`."""
        use = rows[self.use[rows, joint]]
        return self.columns[use, joint][:, columns], self.rhs[use, joint]


def rows_by_event(blocks: Iterable[TimeBlock]) -> Iterator[list[tuple[TimeBlock, IntArray]]]:
    """Yield the rows of each time interval, as a list of the blocks that contain them."""
    stretch: list[tuple[TimeBlock, IntArray]] = []
    event = -1
    for block in blocks:
        for rows in block.event_rows():
            if stretch and block.event[rows[0]] != event:
                yield stretch
                stretch = []
            event = int(block.event[rows[0]])
            stretch.append((block, rows))
    if stretch:
        yield stretch


def time_runs(
    model: RobotModel,
    signals: Sequence[SmoothedSignals],
    payload: Sequence[bool],
    known: FloatArray | None = None,
) -> tuple[TimeRun, ...]:
    """Combine recordings with their conditions.

    Args:
        model: The robot.
        signals: The recordings.
        payload: For each recording, True if the robot carried the unknown payload.
        known: Shape (recordings, b). Contribution of known bodies to the base parameters.

    Raises:
        EstimationError: The joints are not those of the model, or `payload` does not have one value
            per recording.
    """
    if len(payload) != len(signals):
        raise EstimationError(
            f"payload has {len(payload)} values, but there are {len(signals)} recordings: give"
            " one value for each recording",
            code="RID-API-ARGUMENT",
        )
    for smoothed in signals:
        if smoothed.joint_names != model.joint_names:
            raise EstimationError(
                f"the recording has joints {', '.join(smoothed.joint_names)}, but the model has"
                f" {', '.join(model.joint_names)}: use the recording's own robot",
                code="RID-ROBOT-OTHER",
            )
    carried = [None] * len(signals) if known is None else list(known)
    return tuple(
        TimeRun(smoothed, Conditions(temperature_k=smoothed.temperature_k, payload=loaded), own)
        for smoothed, loaded, own in zip(signals, payload, carried, strict=True)
    )


def time_blocks(
    model: RobotModel,
    base: BaseParameters,
    runs: Sequence[TimeRun],
    standstill_rad_s: float,
    standard: FloatArray | None = None,
    *,
    low_passed: bool = False,
) -> Iterator[TimeBlock]:
    """Yield the equations of some recordings; `standard` as in `torque_columns`.

    Columns and torque of a recording pass the same filter (`UnfilteredSignals`). 8 rows per period
    of the cut-off contain all information. The columns of a mean period are low-passed in three
    cases: if `low_passed` is true, if its torque passed a channel, or if friction has presliding.

    The friction of a joint is unknown near standstill and reversal. Therefore rows within the
    filter's length of a standstill or reversal are left out; of a mean period that is not
    low-passed, only the rows near standstill. Friction with presliding is known there, so these
    rows are used. Of a longer standstill, only the rows within one period of the cut-off from
    motion are used, because the others repeat one value.
    """
    first_event = 0
    for run in runs:
        signals, event = run.signals, run.event + first_event
        first_event = int(event[-1]) + 1
        shared = ParallelFilter(signals)
        whole = shared.conditions(model, run.conditions)
        narrowed = LowPassedColumns(model, base, signals, whole, standard, run.kept)
        use, moves = shared.usable_rows(model, whole, standstill_rad_s)
        stride = row_stride(signals)
        filtered = low_passed or _always_filtered(model, signals)
        for rows in _blocks(signals.segment):
            if filtered:
                columns = narrowed.of(rows, stride)
                rows = slice(rows.start, rows.stop, stride)
            else:
                columns = narrowed.unfiltered(rows)
            torque = shared.torque(np.arange(len(signals))[rows])
            if run.known is not None:
                torque = torque - columns[..., : len(base)] @ run.known
            yield TimeBlock(
                columns=columns,
                rhs=torque,
                use=use[rows],
                moving=moves[rows],
                event=event[rows],
                time_s=signals.time_s[rows],
            )
            signals.release()


def count_rows(model: RobotModel, run: TimeRun) -> int:
    """Return how many rows of a recording `time_blocks` yields."""
    signals = run.signals
    if not _always_filtered(model, signals):
        return len(signals)
    stride = row_stride(signals)
    return sum(-(-(rows.stop - rows.start) // stride) for rows in _blocks(signals.segment))


def _always_filtered(model: RobotModel, signals: SmoothedSignals) -> bool:
    narrow = signals.channel is not None and signals.channel.changes
    return narrow or signals.unfiltered is not None or bool(presliding_of_model(model))


def _blocks(segment: IntArray) -> Iterator[slice]:
    """Yield the rows of blocks; no block crosses a gap between segments."""
    edges = (np.flatnonzero(np.diff(segment)) + 1).tolist()
    for first, end in pairwise([0, *edges, len(segment)]):
        for start in range(first, end, BLOCK_ROWS):
            yield slice(start, min(start + BLOCK_ROWS, end))


def joint_equations(
    model: RobotModel,
    base: BaseParameters,
    runs: Sequence[TimeRun],
    standstill_rad_s: float,
    standard: FloatArray | None = None,
) -> Iterator[list[tuple[FloatArray, FloatArray]]]:
    """Yield each joint's equations, matrix (rows, any) and torque (rows,), interval by interval.

    The intervals are those of `TimeRun.event`; rows in which the joint is too slow are left out.
    """
    for block in time_blocks(model, base, runs, standstill_rad_s, standard):
        for rows in block.event_rows():
            yield [block.of_joint(j, rows, slice(None)) for j in range(model.chain.n)]
