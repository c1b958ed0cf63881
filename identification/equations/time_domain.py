"""`TimeRun`: smoothed recordings as equations in time, block by block to bound memory."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import BoolArray, FloatArray, IntArray
from config.errors import EstimationError
from dynamics.model.memory import counted, presliding, sliding, with_memory
from dynamics.model.robot_model import RobotModel
from dynamics.model.standstill import moving
from dynamics.terms.conditions import Conditions
from identification.equations.low_passed import KeptColumns, LowPassedColumns
from identification.equations.segments import thinning
from identification.model.base_parameters import BaseParameters

BLOCK_ROWS = 4096
EVENT_S = 1.0


@dataclass(frozen=True, eq=False)
class TimeRun:
    """One smoothed recording, its circumstances, and what of its equations is kept."""

    signals: SmoothedSignals
    conditions: Conditions
    kept: KeptColumns = field(default_factory=KeptColumns, init=False)

    @property
    def event(self) -> IntArray:
        """Which stretch of `EVENT_S` seconds each row belongs to, from 0, shape (samples,)."""
        signals = self.signals
        stretch = np.floor((signals.time_s - signals.time_s[0]) / EVENT_S)
        changed = (np.diff(stretch) != 0.0) | (np.diff(signals.segment) != 0)
        return np.concatenate([[0], np.cumsum(changed)])


@dataclass(frozen=True, eq=False)
class TimeBlock:
    """Some rows of the equations rhs = columns (beta, shape step).

    Attributes
    ----------
    columns : ndarray, shape (rows, n, any)
        As `torque_columns` gives them.
    rhs : ndarray, shape (rows, n)
        Torque [N m or N].
    use : ndarray of bool, shape (rows, n)
        Where the joint moves fast enough for its friction to be known, or remembers it and is not
        in the middle of a pause.
    moving : ndarray of bool, shape (rows, n)
        Where it moves fast enough.
    event : ndarray of int64, shape (rows,)
        Which stretch of time a row belongs to, counted over all recordings from 0.
    """

    columns: FloatArray
    rhs: FloatArray
    use: BoolArray
    moving: BoolArray
    event: IntArray


def time_runs(
    model: RobotModel, signals: Sequence[SmoothedSignals], payload: Sequence[bool]
) -> tuple[TimeRun, ...]:
    """Put recordings and their circumstances together.

    Raises
    ------
    EstimationError
        The joints are not the model's, or `payload` has not a value a recording.
    """
    if len(payload) != len(signals):
        raise EstimationError(
            f"payload says of {len(payload)} recordings whether they carry it, there are"
            f" {len(signals)}"
        )
    for smoothed in signals:
        if smoothed.joint_names != model.joint_names:
            raise EstimationError(
                f"the recording has joints {', '.join(smoothed.joint_names)}, the model"
                f" {', '.join(model.joint_names)}: use the recording's own robot"
            )
    return tuple(
        TimeRun(smoothed, Conditions(temperature_k=smoothed.temperature_k, payload=loaded))
        for smoothed, loaded in zip(signals, payload, strict=True)
    )


def time_blocks(
    model: RobotModel,
    base: BaseParameters,
    runs: Sequence[TimeRun],
    standstill_rad_s: float,
    standard: FloatArray | None = None,
    *,
    low_passed: bool = False,
    sliding_alone: bool = False,
) -> Iterator[TimeBlock]:
    """Yield the equations of some recordings; `standard` as in `torque_columns`.

    Where friction has memory the rows at rest and at reversal count, at which the model's torque
    changes faster than the low-passed measurement can: then the columns are low-passed alike, as
    they are with `low_passed`, and where the torque's own bandwidth is known. Of a pause only the
    rows within a period of the cut-off from motion count: what follows is the same value again,
    for as long as the pause lasts. Rows that say nothing more are left out of low-passed
    equations: 8 in a period of the cut-off hold all of it.

    With `sliding_alone` only those rows count that a period of the lowest cut-off parts from any at
    which not all of the joint slides: what friction does there, low-passed, rings no further.
    """
    first_event = 0
    for run in runs:
        signals, event = run.signals, run.event + first_event
        first_event = int(event[-1]) + 1
        whole = with_memory(model, signals.position, run.conditions, signals.segment)
        narrowed = LowPassedColumns(model, base, signals, whole, standard, run.kept)
        moves = moving(model, signals.velocity, standstill_rad_s)
        if sliding_alone:
            lowest_hz = signals.torque_bandwidth_hz or signals.cutoff_hz
            use = ~_near(~sliding(whole, moves), signals, lowest_hz)
        else:
            use = counted(whole, moves) & _near(moves, signals, signals.cutoff_hz)
        stride = thinning(signals)
        for rows in _blocks(signals.segment):
            narrow = signals.torque_bandwidth_hz is not None
            if low_passed or narrow or whole.memory is not None:
                columns = narrowed.of(rows, stride)
                rows = slice(rows.start, rows.stop, stride)
            else:
                columns = narrowed.unfiltered(rows)
            yield TimeBlock(
                columns=columns,
                rhs=signals.torque_nm[rows],
                use=use[rows],
                moving=moves[rows],
                event=event[rows],
            )


def rows_of(model: RobotModel, run: TimeRun) -> int:
    """Return how many rows of a recording `time_blocks` yields."""
    signals = run.signals
    if signals.torque_bandwidth_hz is None and not presliding(model):
        return len(signals)
    stride = thinning(signals)
    return sum(-(-(rows.stop - rows.start) // stride) for rows in _blocks(signals.segment))


def _near(those: BoolArray, signals: SmoothedSignals, cutoff_hz: float) -> BoolArray:
    """Return which rows are within a period of a cut-off from one of those, (samples, n)."""
    reach = math.ceil(1.0 / (cutoff_hz * signals.sample_period_s))
    near = np.zeros_like(those)
    edges = (np.flatnonzero(np.diff(signals.segment)) + 1).tolist()
    for first, end in pairwise([0, *edges, len(those)]):
        rows = np.arange(end - first)
        before, after = np.maximum(rows - reach, 0), np.minimum(rows + reach + 1, end - first)
        for j in range(those.shape[1]):  # counts of all joints at once would be the largest array
            counts = np.concatenate([[0], np.cumsum(those[first:end, j])])
            near[first:end, j] = counts[after] > counts[before]
    return near


def _blocks(segment: IntArray) -> Iterator[slice]:
    """Yield the rows of blocks, none of which reaches over a gap between segments."""
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
    """Yield each joint's equations, matrix (rows, any) and torque (rows,), stretch by stretch.

    A stretch is at most `EVENT_S` long; rows where the joint is too slow are left out.
    """
    for block in time_blocks(model, base, runs, standstill_rad_s, standard):
        edges = np.flatnonzero(np.diff(block.event)) + 1
        for rows in np.split(np.arange(len(block.event)), edges):
            uses = [rows[block.use[rows, j]] for j in range(model.chain.n)]
            yield [(block.columns[use, j], block.rhs[use, j]) for j, use in enumerate(uses)]
