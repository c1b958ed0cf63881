"""`ReactionAverage`: mean period of a force plate's channels, with noise and drift.

A charge amplifier drifts, and jumps when it is switched to operate, so the constant part of a
channel is meaningless. The part that repeats from period to period is caused by the robot. A
channel that is often overloaded is left out completely; an occasional overload rejects only the
periods in which it occurs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.recording.reaction import Reaction
from config.arrays import BoolArray, FloatArray, IntArray, freeze, read_only
from config.cell.torque_filter import ButterworthFilter
from config.errors import DataQualityError

FEWEST_CHANNELS = 3
EDGE_FRACTION = 0.05
DRIFT_SIGMAS = 6.0
CONSTANT = 1e-9
"""Relative variation up to which a channel is constant: it does not measure."""


@dataclass(frozen=True, eq=False)
class ReactionAverage:
    """Mean period of K samples and c channels, in addition to a `PeriodAverage`.

    Bins are those of `PeriodAverage`.

    Attributes:
        channel_names: Names of the channels.
        channels_n: Shape (K, c). Mean period, linear drift removed [N; N m for a moment].
        bin_covariance: Shape (K // 2 + 1, c, c). Covariance of a single period's complex bins
            between channels, real part of E N N^H [N^2].
        used: Shape (c,). False for a channel that was left out; its values are zero.
        drift_n_s, drift_sigma_n_s: Shape (c,). Linear drift that was removed, and its standard
            deviation [N/s].
        base_wrench_matrix: Shape (6, c). See `Reaction`.
        low_pass: Filter of the channels; not yet removed.
    """

    channel_names: tuple[str, ...]
    channels_n: FloatArray
    bin_covariance: FloatArray
    used: BoolArray
    drift_n_s: FloatArray
    drift_sigma_n_s: FloatArray
    base_wrench_matrix: FloatArray
    low_pass: ButterworthFilter | None = None

    def __post_init__(self) -> None:
        c = len(self.channel_names)
        channels = read_only("mean reaction", self.channels_n, float, (None, c), DataQualityError)
        bins = len(channels) // 2 + 1
        object.__setattr__(self, "channels_n", channels)
        freeze(self, DataQualityError, (bins, c, c), "bin_covariance")
        freeze(self, DataQualityError, (c,), "drift_n_s", "drift_sigma_n_s")
        freeze(self, DataQualityError, (6, c), "base_wrench_matrix")
        freeze(self, DataQualityError, (c,), "used", what="channels ", dtype=np.bool_)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Channels that were left out."""
        return tuple(n for n, used in zip(self.channel_names, self.used, strict=True) if not used)


@dataclass(frozen=True, eq=False)
class ReactionPeriods:
    """Channels of a plate cut into periods, with drift and the mean of each period removed.

    Attributes:
        reaction: Readings of the plate from which the periods were cut.
        values: Shape (periods, K, c). Channel values without drift and mean [N; N m for a moment];
            zero if invalid or left out.
        level_n: Shape (c,). Mean of the channels over the good periods [N; N m for a moment].
        present: Shape (periods, K, c). True for valid values; all true for a channel that is left
            out.
        used: Shape (c,). False for a channel that is left out.
        drift_n_s, drift_sigma_n_s: Shape (c,). See `ReactionAverage`.
        too_fast_n_s: Shape (periods, c). Drift of each period that exceeds the limit; zero for
            other periods, and for a channel that is left out [N/s].
    """

    reaction: Reaction
    values: FloatArray
    level_n: FloatArray
    present: BoolArray
    used: BoolArray
    drift_n_s: FloatArray
    drift_sigma_n_s: FloatArray
    too_fast_n_s: FloatArray

    def average(self, good: BoolArray) -> ReactionAverage:
        """Return the mean of the good periods.

        Raises:
            DataQualityError: A sample of the period is valid in fewer than two good periods.
        """
        values, present = self.values[good], self.present[good]
        count = present.sum(axis=0)
        if (count < 2).any():
            sample, channel = np.argwhere(count < 2)[0]
            raise DataQualityError(
                f"channel {self.reaction.channel_names[channel]} of the force plate is valid at"
                f" sample {sample} in fewer than two good periods: record more periods",
                code="RID-RECORDING-PERIODS",
            )
        mean = np.where(present, values, 0.0).sum(axis=0) / count
        deviation = np.where(present, values - mean, 0.0)
        bins = np.fft.rfft(deviation, axis=1) / values.shape[1]
        freedom = (count - 1).sum(axis=0) / values.shape[1]
        covariance = np.einsum("mkc,mkd->kcd", bins, bins.conj()).real
        return ReactionAverage(
            channel_names=self.reaction.channel_names,
            channels_n=mean + self.level_n,
            bin_covariance=covariance / np.sqrt(np.outer(freedom, freedom)),
            used=self.used,
            drift_n_s=self.drift_n_s,
            drift_sigma_n_s=self.drift_sigma_n_s,
            base_wrench_matrix=self.reaction.base_wrench_matrix,
            low_pass=self.reaction.low_pass,
        )


@dataclass(frozen=True)
class GapLimits:
    """Limits of missing samples and rejected periods.

    Attributes:
        longest_gap: Largest number of missing consecutive samples of a period.
        missing: Largest fraction of missing samples.
        rejected: Largest number of rejected periods.
    """

    longest_gap: int
    missing: float
    rejected: int


def cut_reaction(
    reaction: Reaction,
    rows: IntArray,
    place: IntArray,
    good: BoolArray,
    samples: int,
    sample_period_s: float,
    limits: GapLimits,
) -> ReactionPeriods | None:
    """Cut a plate's channels into periods; return None if too few channels are left.

    A period is unusable for a channel that lacks too many samples in it, has the same value in all
    of them, or drifts faster in it than the plate's limit. A channel is left out if more than
    `limits.rejected` good periods, or more than a quarter of the good periods, are unusable for it.

    Args:
        reaction: Measurement of the plate.
        rows, place: Indices of the recording's rows in the main periods, and the index of each of
            these rows, counted from the start of the first main period.
        good: Shape (periods,). Periods that are not rejected for other reasons.
        samples: Samples per period, K.
        sample_period_s: Time between samples [s].
        limits: Limits of `average_periods`.
    """
    c, periods = len(reaction.channel_names), len(good)
    flat, there = np.zeros((periods * samples, c)), np.zeros((periods * samples, c), np.bool_)
    flat[place], there[place] = reaction.channels_n[rows], reaction.valid[rows]
    values = flat.reshape(periods, samples, c)
    present = there.reshape(periods, samples, c)
    broken = np.array(
        [
            [_misses(present[m, :, k], limits.longest_gap, limits.missing) for k in range(c)]
            for m in range(periods)
        ]
    )
    too_fast = _too_fast(values, present, reaction.drift_limit_n_s, samples * sample_period_s)
    broken |= too_fast != 0.0
    lowest = np.where(present, values, np.inf).min(axis=1)
    highest = np.where(present, values, -np.inf).max(axis=1)
    broken |= highest - lowest <= CONSTANT * np.maximum(np.abs(highest), 1.0)
    used = broken[good].sum(axis=0) <= min(limits.rejected, int(good.sum()) // 4)
    if used.sum() < FEWEST_CHANNELS:
        return None
    present = present | ~used
    drift, sigma = _drift(values, present, good[:, np.newaxis] & ~broken, samples * sample_period_s)
    drift, sigma = np.where(used, drift, 0.0), np.where(used, sigma, 0.0)
    time_s = (np.arange(samples) - (samples - 1) / 2.0) * sample_period_s
    values = values - drift * time_s[:, np.newaxis]
    values = np.where(present & used, values, 0.0)
    means = values.sum(axis=1) / np.maximum((present & used).sum(axis=1), 1)
    values = np.where(present & used, values - means[:, np.newaxis], 0.0)
    return ReactionPeriods(
        reaction, values, means[good].mean(axis=0), present, used, drift, sigma, too_fast * used
    )


def _misses(present: BoolArray, longest_gap: int, missing_limit: float) -> bool:
    """Return True if a channel lacks too many samples of a period."""
    missing = np.flatnonzero(~present)
    if len(missing) == 0:
        return False
    bounds = np.flatnonzero(np.diff(missing) > 1)
    longest = int(np.diff(np.concatenate([[-1], bounds, [len(missing) - 1]])).max())
    return longest > longest_gap or len(missing) > missing_limit * len(present)


def _drift(
    values: FloatArray, present: BoolArray, whole: BoolArray, period_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return each channel's linear drift and its standard deviation, (c,) [N/s].

    The drift is the median of the changes of the mean from period to period. Therefore a single
    jump of the zero does not count as drift.
    """
    c = values.shape[2]
    drift, sigma = np.zeros(c), np.zeros(c)
    means = (values * present).sum(axis=1) / np.maximum(present.sum(axis=1), 1)
    for k in range(c):
        number = np.flatnonzero(whole[:, k])
        if len(number) < 2:
            continue
        slopes = np.diff(means[number, k]) / np.diff(number) / period_s
        drift[k] = np.median(slopes)
        scatter = 1.4826 * float(np.median(np.abs(slopes - drift[k])))
        sigma[k] = 1.2533 * scatter / np.sqrt(len(slopes))
    return drift, sigma


def _too_fast(
    values: FloatArray, present: BoolArray, limit_n_s: float, period_s: float
) -> FloatArray:
    """Return each period's drift if it exceeds a limit, zero otherwise, (periods, c) [N/s].

    The drift of a period is the difference between its beginning and the beginning of the next one.
    The drift of the last period is the difference between its end and the end of the previous one.
    Values that repeat in every period cancel in these differences. If six standard deviations of
    the noise of such a difference are larger than the limit, they are used instead of it.
    """
    periods, samples, c = values.shape
    if periods < 2:
        return np.zeros((periods, c))
    edge = max(1, round(EDGE_FRACTION * samples))
    first, last = np.all(present[:, :edge], axis=1), np.all(present[:, -edge:], axis=1)
    begin, end = values[:, :edge].mean(axis=1), values[:, -edge:].mean(axis=1)
    change = np.concatenate([np.diff(begin, axis=0), end[-1:] - end[-2:-1]])
    known = np.concatenate([first[1:] & first[:-1], last[-1:] & last[-2:-1]])
    change = np.where(known, change, 0.0)
    scatter = 1.4826 * np.median(np.abs(change - np.median(change, axis=0)), axis=0)
    limit = np.maximum(limit_n_s * period_s, DRIFT_SIGMAS * scatter)
    return np.asarray(np.where(np.abs(change) > limit, change / period_s, 0.0))
