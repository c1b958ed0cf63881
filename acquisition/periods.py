"""`PeriodAverage`: the mean period of a periodic recording, its noise, and what was rejected."""

from __future__ import annotations

from dataclasses import dataclass

from acquisition.arrays import FloatArray, read_only
from config.cell import ButterworthFilter
from config.errors import DataQualityError


@dataclass(frozen=True)
class RejectedPeriod:
    """A period that was not averaged in; `index` counts the main periods from 0."""

    index: int
    reason: str


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

    def __post_init__(self) -> None:
        n = len(self.joint_names)
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
