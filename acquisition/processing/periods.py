"""`PeriodAverage`: mean period of a periodic recording, its noise, and the rejected periods."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.processing.period_table import (
    MISSING_FRACTION_LIMIT,
    PeriodCutter,
    PeriodTable,
    running_sum,
    sum_of,
)
from acquisition.processing.reaction_average import (
    GapLimits,
    ReactionAverage,
    ReactionPeriods,
    cut_reaction,
)
from acquisition.recording.recording import Recording
from config.arrays import BoolArray, FloatArray, freeze
from config.cell.torque_filter import ButterworthFilter
from config.errors import DataQualityError

LONGEST_GAP = 3
REJECTED_LIMIT = 5
FAMILY_RATIO = 2.0
FAMILY_SIGMAS = 6.0
NEGLIGIBLE_FRACTION = 1e-4
BLOCK_VALUES = 1 << 18


@dataclass(frozen=True)
class PeriodRejection:
    """A period that is not part of the average; `index` counts the main periods from 0."""

    index: int
    reason: str

    @property
    def number(self) -> int:
        """Number of the period, counted from 1."""
        return self.index + 1


@dataclass(frozen=True, eq=False)
class PeriodAverage:
    """Mean period and noise of K samples and n joints, over `periods_kept` periods.

    Bins are `numpy.fft.rfft(x, axis=0) / K`, bin k at k / (K T): a sine of amplitude A at harmonic
    k has a bin of magnitude A / 2. Variances are those of a single period; the variances of the
    mean are smaller by the factor `periods_kept`.

    Attributes:
        joint_names: Base to flange.
        sample_period_s: Time between rows, T [s].
        position, torque_nm: Shape (K, n). Mean period [rad or m], [N m or N].
        position_variance, torque_variance: Shape (n,). Noise variance per channel (3.9, 3.10).
        position_bin_variance, torque_bin_variance: Shape (K // 2 + 1, n). Noise spectrum: variance
            E|N|^2 of each complex bin, with M - 1 complex degrees of freedom.
        periods_kept: Number of averaged periods, M.
        rejected: Rejected periods, with reasons.
        missing_samples: Single rows without valid data in the kept periods; left out of the mean.
        torque_filter: Analog filter of the torques; not yet removed.
        temperature_k: Shape (n,). Mean temperature of each drive over the kept periods [K], if
            recorded.
        reaction: Mean period of a force plate's channels, over the same periods.
    """

    joint_names: tuple[str, ...]
    sample_period_s: float
    position: FloatArray
    torque_nm: FloatArray
    position_variance: FloatArray
    torque_variance: FloatArray
    position_bin_variance: FloatArray
    torque_bin_variance: FloatArray
    periods_kept: int
    rejected: tuple[PeriodRejection, ...] = ()
    missing_samples: int = 0
    torque_filter: ButterworthFilter | None = None
    temperature_k: FloatArray | None = None
    reaction: ReactionAverage | None = None

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        of_joints = ("temperature_k", "position_variance", "torque_variance")
        freeze(self, DataQualityError, (n,), *of_joints)
        freeze(self, DataQualityError, (None, n), "position", what="mean ")
        freeze(self, DataQualityError, (len(self.position), n), "torque_nm")
        bins = (len(self.position) // 2 + 1, n)
        freeze(self, DataQualityError, bins, "position_bin_variance", "torque_bin_variance")
        if self.periods_kept < 2:
            raise DataQualityError(
                f"the variance of the noise cannot be estimated from {self.periods_kept} periods:"
                " at least 2 are needed",
                code="RID-RECORDING-PERIODS",
            )

    @property
    def samples_per_period(self) -> int:
        """Rows of the mean period, K."""
        return len(self.position)

    @property
    def period_s(self) -> float:
        """Period [s]."""
        return self.samples_per_period * self.sample_period_s


def average_periods(recording: Recording, *, rejected_limit: int = REJECTED_LIMIT) -> PeriodAverage:
    """Return the mean of the main periods of a recording, and the noise around it (3.9, 3.10).

    Rows are sorted by `sample_index`, so that a lost row does not shift others. Run-in, transient
    periods and run-out are left out. A period is rejected if:
    - it is incomplete,
    - it lacks more than 2 % of a joint's rows, or more than 3 consecutive rows, or
    - it is an outlier. Then, in any channel, its deviation from the median period (RMS or peak) is
      more than twice the median of all periods' deviations, and more than 6 robust standard
      deviations above this median, and more than 1e-4 of the channel's variation (for a joint at
      rest: of the largest variation of all joints).

    With a force plate, a period is also rejected if a channel drifts too fast in it, lacks too many
    of its rows, or is an outlier. If any joint lacks a single row of a good period, this row is
    left out of the mean.

    Args:
        recording: A periodic recording.
        rejected_limit: Largest number of rejected periods.

    Raises:
        DataQualityError: The recording is not periodic, lacks more than 2 % of a joint's rows or
            the start of a period, has too many rejected periods or fewer than two good ones, or
            lacks the same row in all good periods but one.
    """
    cutter = PeriodCutter()
    cutter.add(recording)
    return average_table(cutter.table(), recording, rejected_limit=rejected_limit)


def average_table(
    table: PeriodTable, recording: Recording | None = None, *, rejected_limit: int = REJECTED_LIMIT
) -> PeriodAverage:
    """Return the mean of cut periods, as `average_periods` does.

    Args:
        table: The periods.
        recording: The whole recording, if a force plate was recorded too.
        rejected_limit: Largest number of rejected periods.

    Raises:
        DataQualityError: See `average_periods`.
    """
    n = len(table.joint_names)
    rejected = _lost(table)
    present: BoolArray = np.asarray(table.present.all(axis=2))
    good = _without(rejected, len(present))
    channels = [
        f"{what} of joint {j!r}" for what in ("position", "torque") for j in table.joint_names
    ]
    rejected |= _out_of_family(table.values, present[:, :, np.newaxis], good, channels, alike=n)
    good = _without(rejected, len(present))
    plate = None
    if recording is not None and recording.reaction is not None:
        plate = cut_reaction(
            recording.reaction,
            *table.places(recording),
            good,
            table.samples,
            table.sample_period_s,
            GapLimits(LONGEST_GAP, MISSING_FRACTION_LIMIT, rejected_limit),
        )
    if plate is not None:
        rejected |= _unfit_reaction(plate, rejected)
    good = _without(rejected, len(present))
    reasons = tuple(PeriodRejection(i, rejected[i]) for i in sorted(rejected))
    kept = int(good.sum())
    if len(present) == 1 and not reasons:
        raise DataQualityError(
            "noise cannot be estimated from one period: record two or more (`periods`)",
            code="RID-RECORDING-PERIODS",
        )
    if kept < 2 or len(reasons) > rejected_limit:
        words = "; ".join(f"period {period.number}: {period.reason}" for period in reasons)
        raise DataQualityError(
            f"{kept} of {len(present)} periods are good, {len(reasons)} are rejected (at least 2"
            f" good ones are needed, at most {rejected_limit} may be rejected): {words}",
            code="RID-RECORDING-PERIODS",
        )
    used = np.flatnonzero(good).tolist()
    count = present[used].sum(axis=0)
    if (count < 2).any():
        raise DataQualityError(
            f"sample {int(np.argmin(count)) + 1} of the period is valid in fewer than two good"
            " periods: record more periods",
            code="RID-RECORDING-PERIODS",
        )
    # Periods are summed one by one, so that the memory does not grow with the number of periods.
    mean = sum_of(table.values(m) * present[m][:, np.newaxis] for m in used)
    mean /= count[:, np.newaxis]
    squares = power = None
    for m in used:
        deviation = np.where(present[m][:, np.newaxis], table.values(m) - mean, 0.0)
        squares = running_sum(squares, np.square(deviation))
        bins = np.square(np.abs(np.fft.rfft(deviation, axis=0) / table.samples))
        power = bins if power is None else power + bins
    assert squares is not None
    assert power is not None
    # sum_k (count_k - 1) is K (M - 1) if no row is missing: (3.10).
    freedom = (count - 1).sum()
    variance = squares / freedom
    bin_variance = power * table.samples / freedom
    return PeriodAverage(
        joint_names=table.joint_names,
        sample_period_s=table.sample_period_s,
        position=mean[:, :n],
        torque_nm=mean[:, n:],
        position_variance=variance[:n],
        torque_variance=variance[n:],
        position_bin_variance=bin_variance[:, :n],
        torque_bin_variance=bin_variance[:, n:],
        periods_kept=kept,
        rejected=reasons,
        missing_samples=int(present[used].size - present[used].sum()),
        torque_filter=table.torque_filter,
        temperature_k=table.mean_temperature(good),
        reaction=None if plate is None else plate.average(good),
    )


def _without(rejected: Container[int], periods: int) -> BoolArray:
    """Return True for each period that is not rejected, (periods,)."""
    return np.array([index not in rejected for index in range(periods)])


def _unfit_reaction(plate: ReactionPeriods, rejected: dict[int, str]) -> dict[int, str]:
    """Return the periods in which the force plate failed and that are not rejected yet."""
    names = [f"channel {name} of the force plate" for name in plate.reaction.channel_names]
    unfit: dict[int, str] = {}
    for k, name in enumerate(names):
        for period, reason in _incomplete(plate.present[:, :, k]).items():
            unfit.setdefault(period, f"{name}: {reason}")
    for period, k in np.argwhere(plate.too_fast_n_s != 0.0).tolist():
        unfit.setdefault(
            period,
            f"{names[k]} drifted by {plate.too_fast_n_s[period, k]:.3g} N/s, the limit is"
            f" {plate.reaction.drift_limit_n_s:g} N/s",
        )
    good = np.array([m not in rejected and m not in unfit for m in range(len(plate.values))])
    used = np.flatnonzero(plate.used)
    there = plate.present[:, :, used]
    values = plate.values[:, :, used]
    channels = [names[k] for k in used]
    odd = _out_of_family(lambda m, rows: values[m, rows], there, good, channels, alike=1)
    return {m: why for m, why in (unfit | odd).items() if m not in rejected}


def _lost(table: PeriodTable) -> dict[int, str]:
    """Return the periods that lack too many rows of any joint, with the reason."""
    present = table.present
    rejected = _incomplete(np.asarray(present.any(axis=2)))
    for joint in range(present.shape[2]):
        for period, reason in _incomplete(present[:, :, joint]).items():
            rejected.setdefault(period, table.of_joint(joint) + reason)
    return rejected


def _incomplete(present: BoolArray) -> dict[int, str]:
    """Return the periods with too many or too long gaps, each with the reason.

    `present` is True for each row that was recorded, (periods, K).
    """
    rejected = {}
    periods, samples = present.shape
    for period in range(periods):
        missing = np.flatnonzero(~present[period])
        if not len(missing):
            continue
        gaps = np.split(missing, np.flatnonzero(np.diff(missing) > 1) + 1)
        gap = max(gaps, key=len)
        longest = len(gap)
        if period == periods - 1 and not present[period, -longest:].any() and longest > LONGEST_GAP:
            rejected[period] = f"ended after {samples - longest} of {samples} samples"
        elif longest > LONGEST_GAP or len(missing) > MISSING_FRACTION_LIMIT * samples:
            rejected[period] = (
                f"{len(missing)} of {samples} samples missing, {longest} in a row from sample"
                f" {int(gap[0])}"
            )
    return rejected


def _out_of_family(
    values: Callable[[int, slice], FloatArray],
    present: BoolArray,
    good: BoolArray,
    channels: Sequence[str],
    *,
    alike: int,
) -> dict[int, str]:
    """Return the good periods that are outliers, each with the reason; none of one or two periods.

    Deviations that are negligible against a channel's own variation never count. `alike`
    consecutive channels have the same quantity. For a channel at rest, the largest variation of
    these channels is used instead, because a joint at rest creeps and the last digit of its encoder
    changes.
    """
    indices = np.flatnonzero(good).tolist()
    if len(indices) < 3:
        return {}
    samples = present.shape[1]
    means: list[FloatArray] = []
    squares = peak = None
    rows = max(1, BLOCK_VALUES // (len(indices) * len(channels)))
    for first in range(0, samples, rows):
        some = np.stack([values(m, slice(first, first + rows)) for m in indices])
        there = present[indices, first : first + rows]
        mean = (some * there).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
        filled = np.where(there, some, mean)
        deviation = filled - np.median(filled, axis=0)
        means.append(mean)
        squares = running_sum(squares, np.square(deviation), axis=1)
        highest = np.abs(deviation).max(axis=1)
        peak = highest if peak is None else np.maximum(peak, highest)
    assert squares is not None
    assert peak is not None
    changes = np.concatenate(means).std(axis=0)
    largest = np.repeat(changes.reshape(-1, alike).max(axis=1), alike)
    at_rest = changes < NEGLIGIBLE_FRACTION * largest
    negligible = NEGLIGIBLE_FRACTION * np.where(at_rest, largest, changes)
    rejected: dict[int, str] = {}
    for words, measure in (("RMS", np.sqrt(squares / samples)), ("peak", peak)):
        common = np.median(measure, axis=0)
        spread = 1.4826 * np.median(np.abs(measure - common), axis=0)
        limit = np.maximum(FAMILY_RATIO * common, common + FAMILY_SIGMAS * spread)
        limit = np.maximum(limit, negligible)
        for row, period in enumerate(indices):
            if int(period) in rejected or not (measure[row] > limit).any():
                continue
            channel = int(np.argmax(measure[row] / limit))
            rejected[int(period)] = (
                f"{channels[channel]} differs from the median period by"
                f" {measure[row, channel]:.3g} ({words}); {common[channel]:.3g} is usual"
            )
    return rejected
