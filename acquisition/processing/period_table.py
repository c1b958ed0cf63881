"""`PeriodTable`: main periods of a recording, cut while its rows arrive."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.processing.block_file import BlockFile
from acquisition.recording.recording import Recording
from config.arrays import BoolArray, FloatArray, IntArray
from config.cell.torque_filter import ButterworthFilter
from config.errors import DataQualityError

MISSING_FRACTION_LIMIT = 0.02


@dataclass(frozen=True, eq=False)
class PeriodTable:
    """Positions and torques of each main period; memory hardly grows with the number of periods.

    Attributes:
        joint_names: Base to flange.
        sample_period_s: Time between rows [s].
        torque_filter: Analog filter of the torques.
        each_joint: True if the recording states for each joint which rows are valid.
        start: Row of the motion at which the first period begins.
        warm: True if the drives' temperatures were measured.
        blocks: Rows of each period: positions, torques, validity, and temperatures [K]; zero for
            missing rows.
        present: Shape (periods, K, n). True if the row was recorded, per joint.
    """

    joint_names: tuple[str, ...]
    sample_period_s: float
    torque_filter: ButterworthFilter | None
    each_joint: bool
    start: int
    warm: bool
    blocks: BlockFile
    present: BoolArray

    @property
    def samples(self) -> int:
        """Rows per period, K."""
        return int(self.present.shape[1])

    def values(self, period: int, rows: slice = slice(None)) -> FloatArray:
        """Return positions, then torques, of a period, (K, 2 n), or of neighbouring rows in it."""
        return self.blocks.rows(period, rows)[:, : 2 * len(self.joint_names)]

    def of_joint(self, joint: int) -> str:
        """Return a message prefix that names the joint; empty if `each_joint` is False."""
        return f"joint {self.joint_names[joint]!r}: " if self.each_joint else ""

    def places(self, recording: Recording) -> tuple[IntArray, IntArray]:
        """Return the main rows of a recording, and their indices from the first period's start."""
        rows = np.flatnonzero(_is_main(recording))
        return rows, recording.sample_index[rows] - self.start

    def mean_temperature(self, good: BoolArray) -> FloatArray | None:
        """Return the drives' mean temperatures over the valid rows of good periods, (n,) [K].

        None without temperatures, or without a good period.
        """
        if not self.warm:
            return None
        total, count = None, 0
        for period in np.flatnonzero(good).tolist():
            is_complete = self.present[period].all(axis=1)
            warm = self.blocks[period][is_complete, 3 * len(self.joint_names) :]
            total, count = running_sum(total, warm), count + len(warm)
        return None if total is None else total / count


class PeriodCutter:
    """Cutter that divides a periodic recording, in parts or as a whole, into periods."""

    def __init__(self) -> None:
        self._first: Recording | None = None
        self._origin: int | None = None
        self._blocks: BlockFile | None = None
        self._warm = False
        self._main: tuple[int, int] = (0, 0)
        self._before = -1
        self._after: int | None = None

    def add(self, part: Recording) -> None:
        """Add the main rows of the next part; a recording that is not periodic has no such rows."""
        self._first = self._first or part
        if part.samples_per_period is None:
            return
        index, main = part.sample_index, _is_main(part)
        earlier = index[(part.phase < Phase.MAIN) & (index >= 0)]
        self._before = max(self._before, int(earlier.max(initial=-1)))
        later = index[part.phase == Phase.RUN_OUT]
        if len(later):
            lowest = int(later.min())
            self._after = lowest if self._after is None else min(self._after, lowest)
        if not main.any():
            return
        lowest, highest = int(index[main].min()), int(index[main].max())
        if self._origin is None:
            self._origin, self._main = lowest, (lowest, highest)
        self._main = min(self._main[0], lowest), max(self._main[1], highest)
        samples, n = self._samples, len(part.joint_names)
        period, place = np.divmod(index[main] - self._origin, samples)
        valid, there = part.valid[main], part.joint_valid[main]
        position, torque_nm = part.position[main], part.torque_nm[main]
        if self._blocks is None:
            self._blocks = BlockFile((samples, 4 * n))
        for number in np.unique(period).tolist():
            block = self._blocks[number]
            own = np.flatnonzero(period == number)
            row, joint = np.nonzero(there[own])
            row = own[row]
            block[place[row], joint] = position[row, joint]
            block[place[row], n + joint] = torque_nm[row, joint]
            block[place[row], 2 * n + joint] = 1.0
            if part.temperature_k is not None:
                self._warm = True
                whole = own[valid[own]]
                block[place[whole], 3 * n :] = part.temperature_k[main][whole]
            self._blocks[number] = block

    @property
    def periods(self) -> int:
        """Number of main periods so far, including incomplete ones."""
        if self._origin is None:
            return 0
        return -(-(self._main[1] - self._main[0] + 1) // self._samples)

    def table(self, start: int | None = None) -> PeriodTable:
        """Return the periods so far.

        Args:
            start: Row of the motion at which the first period begins, if known.

        Raises:
            DataQualityError: The recording is not periodic or has no main rows, more than 2 % of a
                joint's rows are missing, or the start of a period is unknown.
        """
        samples = self._samples
        if self._first is None or self._origin is None or self._blocks is None:
            raise DataQualityError(
                "the recording has no row of the main periods: it ended before the first period."
                " Record again",
                code="RID-RECORDING-PERIODS",
            )
        if start is None:
            start = self._first_row()
        if start != self._origin:
            self._blocks = self._shift(self._blocks, self._origin - start)
            self._origin = start
        n = len(self._first.joint_names)
        count = (self._main[1] - start) // samples + 1
        table = PeriodTable(
            joint_names=self._first.joint_names,
            sample_period_s=float(self._first.sample_period_s or 0.0),
            torque_filter=self._first.torque_filter,
            each_joint=self._first.answered is not None,
            start=start,
            warm=self._warm,
            blocks=self._blocks,
            present=np.stack(
                [self._blocks[number][:, 2 * n : 3 * n] != 0.0 for number in range(count)]
            ),
        )
        _refuse_gaps(table, self._main[1] - start + 1)
        return table

    @property
    def _samples(self) -> int:
        if self._first is None or self._first.samples_per_period is None:
            raise DataQualityError(
                "the recording is not periodic and cannot be averaged; `rid-daq identify` uses"
                " it directly",
                code="RID-RECORDING-NOT-PERIODIC",
            )
        return self._first.samples_per_period

    def _first_row(self) -> int:
        """Return the row at which the first main period starts, even if that row was lost."""
        first, last = self._main
        earliest = self._before + 1 if self._before >= 0 else first
        latest = first
        if self._after is not None:
            length = round((last + 1 - first) / self._samples) * self._samples
            earliest = max(earliest, last + 1 - length)
            latest = min(latest, self._after - length)
        if earliest != latest:
            raise DataQualityError(
                f"the first main period starts between rows {earliest} and {latest} of the"
                " motion, and the rows around it are lost: record again",
                code="RID-RECORDING-ROWS-LOST",
            )
        return latest

    def _shift(self, blocks: BlockFile, shift: int) -> BlockFile:
        """Return the periods, cut again with each row's index increased by `shift` rows."""
        samples = self._samples
        moved = BlockFile(blocks.shape)
        for number in blocks:
            block = blocks[number]
            period, first = divmod(number * samples + shift, samples)
            for target, rows, into in (
                (period, slice(None, samples - first), slice(first, None)),
                (period + 1, slice(samples - first, None), slice(None, first)),
            ):
                if block[rows].any():
                    whole = moved[target]
                    whole[into] = block[rows]
                    moved[target] = whole
        return moved


def cut_periods(recording: Recording, start: int | None = None) -> tuple[FloatArray, BoolArray]:
    """Return positions and torques of the main periods, and which rows are present.

    Args:
        recording: A periodic recording with K rows per period.
        start: Row of the motion at which its first period begins, if known.

    Returns:
        `values`, shape (periods, K, 2 n). Positions, then torques; zero for missing rows.
        `present`, shape (periods, K, n). True if the row was recorded, per joint.

    Raises:
        DataQualityError: The recording has no main rows, more than 2 % of a joint's rows are
            missing, or the start of a period is unknown.
    """
    cutter = PeriodCutter()
    cutter.add(recording)
    table = cutter.table(start)
    return np.stack([table.values(number) for number in range(len(table.present))]), table.present


def sum_of(arrays: Iterable[FloatArray]) -> FloatArray:
    """Return the sum of arrays of one shape, at least one, added one after the other."""
    total: FloatArray | None = None
    for array in arrays:
        total = array.copy() if total is None else np.add(total, array, out=total)
    if total is None:
        raise ValueError("nothing to add")
    return total


def running_sum(so_far: FloatArray | None, values: FloatArray, axis: int = 0) -> FloatArray:
    """Add values along an axis to an earlier sum; rounding is that of one sum over all values."""
    if so_far is not None:
        values = np.concatenate([np.expand_dims(so_far, axis), values], axis=axis)
    return np.asarray(values.sum(axis=axis))


def _is_main(recording: Recording) -> BoolArray:
    return np.asarray((recording.phase == Phase.MAIN) & (recording.sample_index >= 0))


def _refuse_gaps(table: PeriodTable, reached: int) -> None:
    """Refuse periods with too many missing rows.

    Raises:
        DataQualityError: Too many rows are missing; the message names the joint and the periods.
    """
    samples = table.samples
    there = table.present.sum(axis=1)
    missing = reached - there.sum(axis=0)
    worst = int(missing.argmax())
    if missing[worst] > MISSING_FRACTION_LIMIT * reached:
        where = np.flatnonzero(samples - there[:, worst] > MISSING_FRACTION_LIMIT * samples)
        raise DataQualityError(
            f"{table.of_joint(worst)}{missing[worst]} of {reached} rows of the main periods are"
            f" missing or invalid; the limit is {MISSING_FRACTION_LIMIT:.0%} (exceeded in"
            f" {_list_periods(where + 1)}): check for lost frames on the bus",
            code="RID-RECORDING-ROWS-LOST",
        )


def _list_periods(periods: IntArray) -> str:
    """Return the numbers of periods in words, consecutive ones as ranges."""
    runs = np.split(periods, np.flatnonzero(np.diff(periods) > 1) + 1)
    words = [f"{run[0]} to {run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs]
    return ("periods " if len(periods) > 1 else "period ") + ", ".join(words)
