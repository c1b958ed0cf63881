"""`TorqueChannel`: what a recording's torque went through on its way, and the position did not.

A drive's torque is sampled, filtered and sent by itself: it may be late by a fraction of a sample,
and low-passed long before anybody recorded it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray, IntArray, freeze
from config.errors import EstimationError


@dataclass(frozen=True, eq=False)
class TorqueChannel:
    """Delay and bandwidth of the torque beside the position.

    Attributes
    ----------
    delay_s : ndarray, shape (n,)
        By how much each joint's torque is late [s]; negative where the position is.
    delay_sigma_s : ndarray, shape (n,)
        Standard deviations; 0 where no delay was found.
    bandwidth_hz : float or None
        Where the torque was low-passed; None where the recording shows no limit of its own.
    """

    delay_s: FloatArray
    delay_sigma_s: FloatArray
    bandwidth_hz: float | None = None

    def __post_init__(self) -> None:
        freeze(self, EstimationError, (None,), "delay_s")
        freeze(self, EstimationError, (len(self.delay_s),), "delay_sigma_s")

    @classmethod
    def none(cls, joints: int) -> TorqueChannel:
        """Return the channel that changes nothing."""
        return cls(np.zeros(joints), np.zeros(joints))

    @property
    def changes(self) -> bool:
        """Whether it does anything."""
        return self.bandwidth_hz is not None or bool(np.any(self.delay_s))

    def undelayed(self, signals: SmoothedSignals) -> SmoothedSignals:
        """Return signals whose torque is in time with the position, and whose bandwidth is known.

        Parameters
        ----------
        signals : SmoothedSignals
            As they were recorded.
        """
        bandwidth_hz = self.bandwidth_hz
        if bandwidth_hz is not None and bandwidth_hz >= signals.cutoff_hz:
            bandwidth_hz = None
        source = signals.unfiltered
        if source is not None:
            torque_nm = self._shifted(source.time_s, source.torque_nm, source.segment)
            source = replace(source, torque_nm=torque_nm)
        return replace(
            signals,
            torque_nm=self._shifted(signals.time_s, signals.torque_nm, signals.segment),
            torque_bandwidth_hz=bandwidth_hz,
            unfiltered=source,
        )

    def _shifted(self, time_s: FloatArray, torque_nm: FloatArray, segment: IntArray) -> FloatArray:
        """Return torques (samples, n) as they were a delay later."""
        from scipy.interpolate import CubicSpline  # large, and few recordings need it

        torque = torque_nm.copy()
        for number in np.unique(segment) if np.any(self.delay_s) else ():
            rows = segment == number
            own_s = time_s[rows]
            for j in np.flatnonzero(self.delay_s):
                at = np.clip(own_s + self.delay_s[j], own_s[0], own_s[-1])
                torque[rows, j] = CubicSpline(own_s, torque[rows, j])(at)
        return torque

    def undelayed_period(self, average: PeriodAverage) -> PeriodAverage:
        """Return a mean period whose torque is in time with the position.

        Parameters
        ----------
        average : PeriodAverage
            As it was recorded.
        """
        rows = average.samples_per_period
        frequency_hz = np.fft.rfftfreq(rows, average.sample_period_s)
        turn = np.exp(2j * np.pi * np.outer(frequency_hz, self.delay_s))
        torque = np.fft.irfft(np.fft.rfft(average.torque_nm, axis=0) * turn, n=rows, axis=0)
        return replace(average, torque_nm=torque)
