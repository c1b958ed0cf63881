"""Precompensated velocity feedforward (6.1-6.3): inverse velocity loop of a model's torque.

A drive generates torque from velocity error only, so a loaded robot lags behind its command. The
feedforward is the desired speed v_d plus the velocity error that generates the desired torque
tau_d. For a velocity controller G_c with the gain K_p and the integral time T_i it is

    v_ff = v_d + G_c^-1 tau_d ,    G_c^-1 = (1 / K_p) T_i s / (T_i s + 1) .

G_c^-1 is a high-pass filter, because the loop's own integrator generates constant torque. A command
takes effect after a delay. Therefore all values are sent earlier by this delay.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.signals.bins import from_bins, to_bins
from compensation.loops.multisine_spectra import interpolation_response
from compensation.loops.velocity_loop import VelocityLoop
from config.arrays import FloatArray, freeze
from config.errors import ConfigError

CYCLES_TO_ACT: Final = 2.0
REST_S: Final = 1.5
RETURN_S: Final = 1.5


@dataclass(frozen=True, eq=False)
class FeedforwardTuning:
    """Correction of the feedforward by one reference run, per axis.

    Attributes:
        scale: Shape (n,). Factor of the model torque.
        delay_s: Shape (n,). Transport delay in addition to the known delay of two cycles [s].
    """

    scale: FloatArray
    delay_s: FloatArray

    def __post_init__(self) -> None:
        freeze(self, ConfigError, (None,), "scale")
        freeze(self, ConfigError, self.scale.shape, "delay_s")

    @classmethod
    def none(cls, joints: int) -> FeedforwardTuning:
        """Return a tuning that does not change the feedforward."""
        return cls(np.ones(joints), np.zeros(joints))


def inverse_response(
    loop: VelocityLoop, frequency_hz: FloatArray
) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    """Return 1 / G_c at frequencies [Hz]; 0 at 0 Hz, as constant torque needs no velocity error."""
    found = np.zeros(len(frequency_hz), dtype=np.complex128)
    moving = frequency_hz > 0.0
    found[moving] = 1.0 / loop.response(frequency_hz[moving])
    return found


def periodic_feedforward(
    loops: Sequence[VelocityLoop],
    velocity: FloatArray,
    torque_nm: FloatArray,
    cycle_time_s: float,
    *,
    tuning: FeedforwardTuning | None = None,
    band_hz: float | None = None,
) -> FloatArray:
    """Return the feedforward of a periodic motion, exact at each of its harmonics.

    Args:
        loops: Velocity loops, one per joint.
        velocity, torque_nm: Shape (K, n). One period of the desired motion and its model torque.
        cycle_time_s: Time between rows [s].
        tuning: Correction found in a reference run.
        band_hz: Highest frequency at which the torque is compensated [Hz] (default: a quarter of
            the sampling rate).

    Returns:
        Shape (K, n). Speeds to send; row k acts two cycles later.
    """
    rows, n = velocity.shape
    tuning = tuning or FeedforwardTuning.none(n)
    period_s = rows * cycle_time_s
    band_hz = band_hz or 0.25 / cycle_time_s
    highest = (rows - 1) // 2
    frequency_hz = np.arange(highest + 1) / period_s
    reach = interpolation_response(frequency_hz, cycle_time_s)
    wanted, torque = to_bins(velocity, highest), to_bins(torque_nm, highest)
    torque[frequency_hz > band_hz] = 0.0
    bins = np.empty_like(wanted)
    for j, loop in enumerate(loops):
        error = tuning.scale[j] * inverse_response(loop, frequency_hz) * torque[:, j]
        ahead = np.exp(2j * math.pi * frequency_hz * tuning.delay_s[j])
        bins[:, j] = (wanted[:, j] + error) / reach * ahead
    return from_bins(bins, rows)


@dataclass
class InverseFilter:
    """G_c^-1 in the time domain, for torques that are linear between samples.

    The state is the torque of the loop's integrator. Parameters are those of `VelocityLoop` without
    delay and lag; the caller compensates delay and lag by sending values earlier.

    Args:
        gain, integral_time_s: Shape (n,). K_p and T_i of each joint.
        step_s: Time between samples [s].
        torque_nm: Shape (n,). Torque that the integrators already hold at the start.
    """

    gain: FloatArray
    integral_time_s: FloatArray
    step_s: float
    torque_nm: FloatArray

    def __post_init__(self) -> None:
        self._carried = np.array(self.torque_nm, dtype=float)
        self._last = self._carried.copy()
        x = self.step_s / self.integral_time_s
        decay = np.exp(-x)
        share = -np.expm1(-x) / x
        # The integrator's torque c obeys c' = (tau - c) / T_i; tau is linear over the step.
        self._decay, self._old, self._new = decay, share - decay, 1.0 - share

    def step(self, torque_nm: FloatArray) -> FloatArray:
        """Return the velocity error that generates the next sample's torque, shape (n,)."""
        self._carried = self._decay * self._carried + self._old * self._last + self._new * torque_nm
        self._last = torque_nm
        return np.asarray((torque_nm - self._carried) / self.gain)


def count_padding_rows(step_s: float) -> int:
    """Return the number of rows that `append_return` appends: rest, return, rest."""
    return round((2.0 * REST_S + RETURN_S) / step_s)


def append_return(values: FloatArray, step_s: float) -> FloatArray:
    """Append a smooth return to the first row, so that the periodic signal has no jump.

    The return is much longer than the integral time of a velocity loop, so its effect has decayed
    when the motion begins.

    Args:
        values: Shape (samples, n). A signal that is at rest at both ends.
        step_s: Time between rows [s].

    Returns:
        Shape (samples + rows, n), with the rows that `count_padding_rows` returns.
    """
    rows = count_padding_rows(step_s)
    x = np.clip((np.arange(1, rows + 1) * step_s - REST_S) / RETURN_S, 0.0, 1.0)[:, np.newaxis]
    share = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    return np.concatenate([values, values[-1] + share * (values[0] - values[-1])])


def rest_to_rest_feedforward(
    loops: Sequence[VelocityLoop],
    velocity: FloatArray,
    torque_nm: FloatArray,
    cycle_time_s: float,
    *,
    tuning: FeedforwardTuning | None = None,
) -> FloatArray:
    """Return the feedforward of a motion from rest to rest, computed in the frequency domain.

    A slow return is appended, which makes the motion periodic. In the frequency domain, delays are
    compensated to fractions of a cycle. Parameters and result are those of `feedforward`.
    """
    speed, torque = (append_return(values, cycle_time_s) for values in (velocity, torque_nm))
    ahead = periodic_feedforward(loops, speed, torque, cycle_time_s, tuning=tuning)
    return ahead[: len(velocity)]


def feedforward(
    loops: Sequence[VelocityLoop],
    velocity: FloatArray,
    torque_nm: FloatArray,
    cycle_time_s: float,
    *,
    tuning: FeedforwardTuning | None = None,
) -> FloatArray:
    """Return the feedforward of any motion in the time domain, as on-line compensation computes it.

    Args:
        loops: Velocity loops, one per joint.
        velocity, torque_nm: Shape (samples, n). The desired motion and its model torque.
        cycle_time_s: Time between rows [s].
        tuning: Correction found in a reference run.

    Returns:
        Shape (samples, n). Speeds to send, row by row. Commands that would have to be sent before
        the first row are left out. The motion begins at rest.
    """
    n = velocity.shape[1]
    tuning = tuning or FeedforwardTuning.none(n)
    gain = np.array([loop.gain for loop in loops])
    inverse = InverseFilter(
        gain=gain / tuning.scale,
        integral_time_s=np.array([loop.integral_time_s for loop in loops]),
        step_s=cycle_time_s,
        torque_nm=torque_nm[0],
    )
    wanted = velocity + np.array([inverse.step(row) for row in torque_nm])
    ahead_s = CYCLES_TO_ACT * cycle_time_s + np.array([loop.delay_s + loop.lag_s for loop in loops])
    rows = np.arange(len(wanted), dtype=np.float64)
    out = np.empty_like(wanted)
    for j in range(n):
        later = rows + (ahead_s[j] + tuning.delay_s[j]) / cycle_time_s
        out[:, j] = np.interp(later, rows, wanted[:, j])
    return np.asarray(out)
