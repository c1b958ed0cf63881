"""`TorqueChannel`: delay and filter between a joint's torque and its recorded value.

A drive samples, filters and sends its torque independently of its position. Therefore the recorded
torque can be late by a fraction of a sample, and low-passed. The filter is applied to the model's
columns or to the predicted torque. The recorded torque is not deconvolved; only `undelayed_period`
shifts the torque of a mean period.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from acquisition.processing.periods import PeriodAverage
from config.arrays import FloatArray, freeze
from config.errors import EstimationError

ComplexArray = NDArray[np.complex128]
ChannelKind = Literal["none", "delay", "lag", "zero-phase", "delay + lag"]

LAG_PERIODS: Final = 7.0
"""Number of time constants after which 0.1 % of an event remains in a first-order filter."""
WIDTH_PERIODS: Final = 4.0
ADVANCE_PERIODS: Final = 2.0
"""Numbers of filter widths after an event (`WIDTH_PERIODS`) and before it (`ADVANCE_PERIODS`) over
which a zero-phase filter spreads most of the event."""
PADDING_S: Final = 0.5
"""Shortest extension of a signal at its end before it is filtered [s]."""


@dataclass(frozen=True, eq=False)
class TorqueChannel:
    """Linear filter of each joint's torque: exp(-j w d) / ((1 + j w T) (1 + (w Z)^(2 m))).

    Attributes:
        delay_s, lag_s, width_s: Shape (n,). Delay d, time constant T of a first-order filter, and
            width Z of a zero-phase filter (a Butterworth filter run forwards and backwards) [s]; 0
            for a delay or filter that the data do not show. A negative delay means that the
            position is late.
        delay_sigma_s, lag_sigma_s, width_sigma_s: Shape (n,). Their standard deviations; 0 for a
            value of 0. A value that is only a bound, at the end of its search range, has itself as
            standard deviation.
        order: Order m of the Butterworth filter.
    """

    delay_s: FloatArray
    delay_sigma_s: FloatArray
    lag_s: FloatArray
    lag_sigma_s: FloatArray
    width_s: FloatArray
    width_sigma_s: FloatArray
    order: int = 1

    def __post_init__(self) -> None:
        freeze(self, EstimationError, (None,), "delay_s")
        shape = (len(self.delay_s),)
        freeze(self, EstimationError, shape, "delay_sigma_s", "lag_s", "lag_sigma_s")
        freeze(self, EstimationError, shape, "width_s", "width_sigma_s")

    @classmethod
    def none(cls, joints: int) -> TorqueChannel:
        """Return a channel that does not change a torque."""
        nothing = np.zeros(joints)
        return cls.of_delays(nothing, nothing)

    @classmethod
    def of_delays(cls, delay_s: FloatArray, sigma_s: FloatArray) -> TorqueChannel:
        """Return a channel with delays and without filters."""
        nothing = np.zeros(len(delay_s))
        return cls(delay_s, sigma_s, nothing, nothing, nothing, nothing)

    @property
    def kind(self) -> ChannelKind:
        """Kind of the channel; "none" only if no joint has a delay or a filter."""
        if np.any(self.width_s):
            return "zero-phase"
        if np.any(self.lag_s):
            return "delay + lag" if np.any(self.delay_s) else "lag"
        return "delay" if np.any(self.delay_s) else "none"

    @property
    def changes(self) -> bool:
        """True if the channel changes a torque."""
        return self.kind != "none"

    @property
    def filters(self) -> bool:
        """True if the channel has a filter and not only delays."""
        return self.kind not in ("none", "delay")

    @property
    def passed_s(self) -> FloatArray:
        """Longest standstill that is ignored, because the filter smooths it out, shape (n,) [s]."""
        return np.maximum(self.lag_s, self.width_s)

    @property
    def after_s(self) -> FloatArray:
        """Time after an event during which the recorded torque depends on the event, (n,) [s]."""
        filters_s = np.maximum(LAG_PERIODS * self.lag_s, WIDTH_PERIODS * self.width_s)
        return np.asarray(np.maximum(self.delay_s, 0.0) + filters_s)

    @property
    def before_s(self) -> FloatArray:
        """Time before an event during which the recorded torque depends on the event, (n,) [s]."""
        return np.asarray(np.maximum(-self.delay_s, 0.0) + ADVANCE_PERIODS * self.width_s)

    def response(self, frequency_hz: FloatArray) -> ComplexArray:
        """Return the frequency response of each joint, shape (frequencies, n)."""
        s = 2j * np.pi * frequency_hz[:, np.newaxis]
        smooth = 1.0 + (2.0 * np.pi * frequency_hz[:, np.newaxis] * self.width_s) ** (
            2 * self.order
        )
        filters = (1.0 + s * self.lag_s) * smooth
        return np.asarray(np.exp(-s * self.delay_s) / filters)

    def undelayed_period(self, average: PeriodAverage) -> PeriodAverage:
        """Return a mean period whose torque is synchronous with its position.

        The phases of the torque's bins are shifted by the delay; the amplitudes do not change.

        Args:
            average: The recorded mean period.
        """
        rows = average.samples_per_period
        frequency_hz = np.fft.rfftfreq(rows, average.sample_period_s)
        turn = np.exp(2j * np.pi * np.outer(frequency_hz, self.delay_s))
        torque = np.fft.irfft(np.fft.rfft(average.torque_nm, axis=0) * turn, n=rows, axis=0)
        return replace(average, torque_nm=torque)

    def of_joint(self, values: FloatArray, joint: int, sample_period_s: float) -> FloatArray:
        """Apply a joint's channel to its uniformly sampled columns, (samples, any)."""
        own = self.of_joints([joint])
        return own.through(values[:, np.newaxis], sample_period_s)[:, 0] if own.changes else values

    def of_joints(self, joints: list[int]) -> TorqueChannel:
        """Return the channel of the selected joints."""
        return TorqueChannel(
            self.delay_s[joints], self.delay_sigma_s[joints],
            self.lag_s[joints], self.lag_sigma_s[joints],
            self.width_s[joints], self.width_sigma_s[joints], self.order,
        )  # fmt: skip

    def through(self, values: FloatArray, sample_period_s: float) -> FloatArray:
        """Apply the channel to uniformly sampled signals.

        Args:
            values: Shape (samples, n) or (samples, n, any). Torques, or columns of the torque
                equations; one segment without a gap.
            sample_period_s: Time between samples [s].
        """
        rows = len(values)
        longest_s = float(np.max(self.after_s + self.before_s, initial=0.0))
        padding = int(np.ceil(max(PADDING_S, 2.0 * longest_s) / sample_period_s))
        spectrum = np.fft.rfft(with_padding(values, rows + padding), axis=0)
        frequency_hz: FloatArray = np.asarray(
            np.fft.rfftfreq(rows + padding, sample_period_s), dtype=np.float64
        )
        response = self.response(frequency_hz)
        spectrum *= response if values.ndim == 2 else response[:, :, np.newaxis]
        return np.asarray(np.fft.irfft(spectrum, n=rows + padding, axis=0)[:rows])


def with_padding(values: FloatArray, rows: int) -> FloatArray:
    """Append rows that lead smoothly from the last value to the first, `rows` in all.

    The periodic extension then has no jump.
    """
    added = np.linspace(0.0, np.pi, rows - len(values) + 2)[1:-1]
    share = ((1.0 - np.cos(added)) / 2.0).reshape((-1,) + (1,) * (values.ndim - 1))
    return np.concatenate([values, values[-1] + (values[0] - values[-1]) * share])
