"""`PeriodAverage`: the mean period of a periodic recording, its noise, and what was rejected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.processing.reaction_average import (
    GapLimits,
    ReactionAverage,
    ReactionPeriods,
    cut_reaction,
)
from acquisition.recording.recording import Recording
from config.arrays import BoolArray, FloatArray, IntArray, read_only
from config.cell.cell import ButterworthFilter
from config.errors import DataQualityError

MISSING_FRACTION_LIMIT = 0.02
LONGEST_GAP = 3
REJECTED_LIMIT = 5
FAMILY_RATIO = 2.0
FAMILY_SIGMAS = 6.0
NEGLIGIBLE_FRACTION = 1e-4


@dataclass(frozen=True)
class RejectedPeriod:
    """A period that was not averaged in; `index` counts the main periods from 0."""

    index: int
    reason: str

    @property
    def number(self) -> int:
        """The period as people count, from 1."""
        return self.index + 1


@dataclass(frozen=True, eq=False)
class PeriodAverage:
    """Mean period and noise of K samples and n joints, over `periods_kept` periods.

    Bins are `numpy.fft.rfft(x, axis=0) / K`, bin k at k / (K T): a sine of amplitude A at
    harmonic k has a bin of magnitude A / 2. Variances are those of a single period; the mean's are
    smaller by `periods_kept`.

    Attributes
    ----------
    joint_names : tuple of str
        Base to flange.
    sample_period_s : float
        Time between rows, T [s].
    position, torque_nm : ndarray, shape (K, n)
        Mean period [rad or m], [N m or N].
    position_variance, torque_variance : ndarray, shape (n,)
        Noise variance per channel (3.9, 3.10).
    position_bin_variance, torque_bin_variance : ndarray, shape (K // 2 + 1, n)
        Noise spectrum: variance E|N|^2 of each complex bin, freedom M - 1 complex pairs.
    periods_kept : int
        Periods averaged, M.
    rejected : tuple of RejectedPeriod
        What was left out, and why.
    missing_samples : int
        Single rows without valid data inside the kept periods; left out of the mean.
    torque_filter : ButterworthFilter or None
        The analog filter that the torques passed; not yet divided out.
    temperature_k : ndarray, shape (n,), or None
        Mean temperature of each drive over the kept periods [K], where it was recorded.
    reaction : ReactionAverage or None
        The mean period of a force plate's channels, over the same periods.
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
    rejected: tuple[RejectedPeriod, ...] = ()
    missing_samples: int = 0
    torque_filter: ButterworthFilter | None = None
    temperature_k: FloatArray | None = None
    reaction: ReactionAverage | None = None

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        if self.temperature_k is not None:
            warmth = read_only("temperature_k", self.temperature_k, float, (n,), DataQualityError)
            object.__setattr__(self, "temperature_k", warmth)
        position = read_only("mean position", self.position, float, (None, n), DataQualityError)
        samples = len(position)
        shapes: dict[str, tuple[int, ...]] = {
            "torque_nm": (samples, n),
            "position_variance": (n,),
            "torque_variance": (n,),
            "position_bin_variance": (samples // 2 + 1, n),
            "torque_bin_variance": (samples // 2 + 1, n),
        }
        object.__setattr__(self, "position", position)
        for name, shape in shapes.items():
            array = read_only(name, getattr(self, name), float, shape, DataQualityError)
            object.__setattr__(self, name, array)
        if self.periods_kept < 2:
            raise DataQualityError(f"{self.periods_kept} periods have no noise variance, 2 do")

    @property
    def samples_per_period(self) -> int:
        """Rows of the mean period, K."""
        return len(self.position)

    @property
    def period_s(self) -> float:
        """The period [s]."""
        return self.samples_per_period * self.sample_period_s


def average_periods(recording: Recording, *, rejected_limit: int = REJECTED_LIMIT) -> PeriodAverage:
    """Return the mean of the main periods of a recording, and the noise around it (3.9, 3.10).

    Rows are put in their place by `sample_index`, so that a lost row shifts nothing. Run-in,
    transient periods and run-out are left out. A period is rejected where it is incomplete, misses
    more than 2 % of a joint's rows or more than 3 in sequence, or is out of family: its deviation
    from the median period (RMS or peak, any channel) is more than twice, and 6 robust standard
    deviations above, what is common among the periods. A single row of a good period that any joint
    misses is left out of the mean at its place.

    Parameters
    ----------
    recording : Recording
        Of a periodic motion.
    rejected_limit : int
        More rejected periods than this make the recording useless.

    Raises
    ------
    DataQualityError
        The recording is not periodic, misses more than 2 % of a joint's rows, has too many rejected
        periods or fewer than two good ones.
    """
    if recording.samples_per_period is None or recording.sample_period_s is None:
        raise DataQualityError(
            "the recording is not periodic, so there are no periods to average; `rid-daq identify`"
            " uses it as it is"
        )
    samples = recording.samples_per_period
    values, there = cut_periods(recording, samples)
    rejected = _lost(there, recording)
    present: BoolArray = np.asarray(there.all(axis=2))
    good = np.array([index not in rejected for index in range(len(present))])
    n = len(recording.joint_names)
    channels = [
        f"{what} of joint {j!r}" for what in ("position", "torque") for j in recording.joint_names
    ]
    rejected |= _out_of_family(values, present, good, channels)
    good = np.array([index not in rejected for index in range(len(present))])
    plate = _cut_reaction(recording, samples, good, rejected_limit)
    if plate is not None:
        rejected |= _unfit_reaction(plate, rejected)
    good = np.array([index not in rejected for index in range(len(present))])
    reasons = tuple(RejectedPeriod(i, rejected[i]) for i in sorted(rejected))
    kept = int(good.sum())
    if len(present) == 1 and not reasons:
        raise DataQualityError(
            "there is one period, whose noise nobody can tell: record two or more (`periods`)"
        )
    if kept < 2 or len(reasons) > rejected_limit:
        words = "; ".join(f"period {period.number}: {period.reason}" for period in reasons)
        raise DataQualityError(
            f"{kept} of {len(present)} periods are good, {len(reasons)} are rejected (at least 2"
            f" good ones are needed, at most {rejected_limit} may be rejected): {words}"
        )
    values, present = values[good], present[good]
    count = present.sum(axis=0)
    if (count < 2).any():
        raise DataQualityError(
            f"sample {int(np.argmin(count)) + 1} of the period is valid in fewer than two good"
            " periods: record more periods"
        )
    missing = int(present.size - present.sum())
    weights = present[:, :, np.newaxis]
    mean = (values * weights).sum(axis=0) / count[:, np.newaxis]
    deviation = np.where(weights, values - mean, 0.0)
    # sum_k (count_k - 1) is K (M - 1) where no row is missing: (3.10).
    variance = np.square(deviation).sum(axis=(0, 1)) / (count - 1).sum()
    power = np.square(np.abs(np.fft.rfft(deviation, axis=1) / samples)).sum(axis=0)
    bin_variance = power * samples / (count - 1).sum()
    return PeriodAverage(
        joint_names=recording.joint_names,
        sample_period_s=recording.sample_period_s,
        position=mean[:, :n],
        torque_nm=mean[:, n:],
        position_variance=variance[:n],
        torque_variance=variance[n:],
        position_bin_variance=bin_variance[:, :n],
        torque_bin_variance=bin_variance[:, n:],
        periods_kept=kept,
        rejected=reasons,
        missing_samples=missing,
        torque_filter=recording.torque_filter,
        temperature_k=_mean_temperature(recording, samples, good),
        reaction=None if plate is None else plate.average(good),
    )


def _cut_reaction(
    recording: Recording, samples: int, good: BoolArray, rejected_limit: int
) -> ReactionPeriods | None:
    """Return the channels of a force plate cut into periods, where one has measured them."""
    if recording.reaction is None or recording.sample_period_s is None:
        return None
    main = (recording.phase == Phase.MAIN) & (recording.sample_index >= 0)
    rows = np.flatnonzero(main)
    return cut_reaction(
        recording.reaction,
        rows,
        recording.sample_index[rows] - _first_main_index(recording, main, samples),
        good,
        samples,
        recording.sample_period_s,
        GapLimits(LONGEST_GAP, MISSING_FRACTION_LIMIT, rejected_limit),
    )


def _unfit_reaction(plate: ReactionPeriods, rejected: dict[int, str]) -> dict[int, str]:
    """Return the periods that are not yet rejected and in which the force plate failed."""
    names = [f"channel {name} of the force plate" for name in plate.reaction.channel_names]
    unfit: dict[int, str] = {}
    for k, name in enumerate(names):
        for period, reason in _incomplete(plate.present[:, :, k]).items():
            unfit.setdefault(period, f"{name}: {reason}")
    for period, k in np.argwhere(plate.too_fast_n_s != 0.0).tolist():
        unfit.setdefault(
            period,
            f"{names[k]} drifted by {plate.too_fast_n_s[period, k]:.3g} N/s,"
            f" {plate.reaction.drift_limit_n_s:g} N/s is the limit",
        )
    good = np.array([m not in rejected and m not in unfit for m in range(len(plate.values))])
    used = np.flatnonzero(plate.used)
    there = plate.present[:, :, used]
    odd = _out_of_family(plate.values[:, :, used], there, good, [names[k] for k in used])
    return {m: why for m, why in (unfit | odd).items() if m not in rejected}


def _mean_temperature(recording: Recording, samples: int, good: BoolArray) -> FloatArray | None:
    """Return the mean over the rows of the good periods, (n,) [K]."""
    if recording.temperature_k is None:
        return None
    main = (recording.phase == Phase.MAIN) & (recording.sample_index >= 0)
    start = _first_main_index(recording, main, samples)
    rows = np.flatnonzero(main & recording.valid)
    kept = rows[good[(recording.sample_index[rows] - start) // samples]]
    return np.asarray(recording.temperature_k[kept].mean(axis=0))


def cut_periods(recording: Recording, samples: int) -> tuple[FloatArray, BoolArray]:
    """Return positions and torques of the main periods as they are, and which rows are there.

    Parameters
    ----------
    recording : Recording
        Of a periodic motion.
    samples : int
        Rows of a period, K.

    Returns
    -------
    values : ndarray, shape (periods, K, 2 n)
        Positions, then torques; zero where a row is not there.
    present : ndarray of bool, shape (periods, K, n)
        Which rows of which joints are.

    Raises
    ------
    DataQualityError
        More than 2 % of a joint's rows are missing, or where a period starts is not known.
    """
    main = (recording.phase == Phase.MAIN) & (recording.sample_index >= 0)
    start = _first_main_index(recording, main, samples)
    place = recording.sample_index[main] - start
    periods = int(place.max()) // samples + 1
    there = recording.valid_of_joints[main]
    n = len(recording.joint_names)
    values = np.zeros((periods * samples, 2 * n))
    present = np.zeros((periods * samples, n), dtype=np.bool_)
    row, joint = np.nonzero(there)
    values[place[row], joint] = recording.position[main][row, joint]
    values[place[row], n + joint] = recording.torque_nm[main][row, joint]
    present[place[row], joint] = True
    reached = int(place.max()) + 1
    missing = reached - present.sum(axis=0)
    worst = int(missing.argmax())
    if missing[worst] > MISSING_FRACTION_LIMIT * reached:
        misses = samples - present[:, worst].reshape(periods, samples).sum(axis=1)
        where = np.flatnonzero(misses > MISSING_FRACTION_LIMIT * samples)
        raise DataQualityError(
            f"{_of_joint(recording, worst)}{missing[worst]} of {reached} rows of the main periods"
            f" are missing or not valid; more than {MISSING_FRACTION_LIMIT:.0%} is too much (it is"
            f" more in {_listed(where + 1)}): look for lost frames on the bus"
        )
    return values.reshape(periods, samples, 2 * n), present.reshape(periods, samples, n)


def _of_joint(recording: Recording, joint: int) -> str:
    """Return whose rows are spoken of, where joints have rows of their own."""
    return "" if recording.answered is None else f"joint {recording.joint_names[joint]!r}: "


def _listed(periods: IntArray) -> str:
    """Name periods by their numbers, those in sequence together."""
    runs = np.split(periods, np.flatnonzero(np.diff(periods) > 1) + 1)
    words = [f"{run[0]} to {run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs]
    return ("periods " if len(periods) > 1 else "period ") + ", ".join(words)


def _first_main_index(recording: Recording, main: BoolArray, samples: int) -> int:
    """Return the motion row at which the first main period starts, even where that row was lost."""
    index = recording.sample_index
    if not main.any():
        raise DataQualityError("the recording holds no row of the main periods: it ended before")
    first, last = int(index[main].min()), int(index[main].max())
    before = index[(recording.phase < Phase.MAIN) & (index >= 0)]
    after = index[recording.phase == Phase.RUN_OUT]
    earliest = int(before.max()) + 1 if len(before) else first
    latest = first
    if len(after):
        length = round((last + 1 - first) / samples) * samples
        earliest = max(earliest, last + 1 - length)
        latest = min(latest, int(after.min()) - length)
    if earliest != latest:
        raise DataQualityError(
            f"the first main period starts between rows {earliest} and {latest} of the motion, but"
            " the rows around it were lost: record again"
        )
    return latest


def _lost(present: BoolArray, recording: Recording) -> dict[int, str]:
    """Return the periods that miss too much of any joint, (periods, K, n), with the reason."""
    rejected = _incomplete(np.asarray(present.any(axis=2)))
    for joint in range(present.shape[2]):
        for period, reason in _incomplete(present[:, :, joint]).items():
            rejected.setdefault(period, _of_joint(recording, joint) + reason)
    return rejected


def _incomplete(present: BoolArray) -> dict[int, str]:
    """Return the periods that miss too much, (periods, K), with the reason."""
    rejected = {}
    periods, samples = present.shape
    for period in range(periods):
        missing = np.flatnonzero(~present[period])
        if not len(missing):
            continue
        bounds = np.flatnonzero(np.diff(missing) > 1)
        longest = int(np.diff(np.concatenate([[-1], bounds, [len(missing) - 1]])).max())
        if period == periods - 1 and not present[period, -longest:].any() and longest > LONGEST_GAP:
            rejected[period] = f"ended after {samples - longest} of {samples} samples"
        elif longest > LONGEST_GAP or len(missing) > MISSING_FRACTION_LIMIT * samples:
            rejected[period] = (
                f"{len(missing)} of {samples} samples missing, {longest} in sequence from sample"
                f" {int(missing[0])}"
            )
    return rejected


def _out_of_family(
    values: FloatArray, present: BoolArray, good: BoolArray, channels: Sequence[str]
) -> dict[int, str]:
    """Return the complete periods that differ from the others far more than those do, with why."""
    indices = np.flatnonzero(good)
    if len(indices) < 3:
        return {}
    there = present[indices].reshape(*present[indices].shape[:2], -1)
    mean = (values[indices] * there).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
    filled = np.where(there, values[indices], mean)
    deviation = filled - np.median(filled, axis=0)
    negligible = NEGLIGIBLE_FRACTION * mean.std(axis=0)
    rejected: dict[int, str] = {}
    for words, measure in (
        ("RMS", np.sqrt(np.square(deviation).mean(axis=1))),
        ("peak", np.abs(deviation).max(axis=1)),
    ):
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
                f" {measure[row, channel]:.3g} ({words}), common is {common[channel]:.3g}"
            )
    return rejected
