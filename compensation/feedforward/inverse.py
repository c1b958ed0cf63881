"""Pre-compensated velocity feedforward (6.1-6.3): the velocity loop's inverse, applied to a model.

The drive makes torque out of velocity error alone, so a robot under load lags behind its command.
The feedforward is the speed wanted plus the error that makes the torque wanted,

    v_ff = v_d + G_c^-1 tau_d ,    G_c^-1 = (1 / K_p) T_i s / (T_i s + 1) ,

a high-pass: what is constant, the loop's own integrator carries. Everything is computed ahead by
the time that commands take to act.
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
from config.robot.robot import RobotDescription

CYCLES_TO_ACT: Final = 2.0
REST_S: Final = 1.5
RETURN_S: Final = 1.5


@dataclass(frozen=True, eq=False)
class FeedforwardTuning:
    """How one reference run corrects the feedforward, axis by axis.

    Attributes:
        scale: Shape (n,). What the model's torque is multiplied by.
        delay_s: Shape (n,). Transport delay beyond the cycles that are known [s].
    """

    scale: FloatArray
    delay_s: FloatArray

    def __post_init__(self) -> None:
        freeze(self, ConfigError, (None,), "scale")
        freeze(self, ConfigError, self.scale.shape, "delay_s")

    @classmethod
    def none(cls, joints: int) -> FeedforwardTuning:
        """Return the tuning that changes nothing."""
        return cls(np.ones(joints), np.zeros(joints))


def refuse_coupled_wrist(robot: RobotDescription, what: str) -> None:
    """Refuse what works joint by joint for a robot whose motors do not.

    Raises:
        ConfigError: The robot's wrist is coupled; `what` is named.
    """
    if robot.coupling is not None:
        raise ConfigError(
            f"robot {robot.name}: {what} works joint by joint, and this robot's wrist is coupled;"
            " use `rid-daq compensate` without it",
            code="RID-ROBOT-COUPLED-WRIST",
        )


def inverse_response(
    loop: VelocityLoop, frequency_hz: FloatArray
) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    """Return 1 / G_c at frequencies [Hz], 0 at 0: what is constant needs nothing."""
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
    """Return the feedforward of a periodic motion, exactly on its bins.

    Args:
        loops: One a joint.
        velocity, torque_nm: Shape (K, n). One period of the motion wanted, and the torque that a
            model says it takes.
        cycle_time_s: Time between rows [s].
        tuning: Correction from a reference run.
        band_hz: Torque above this frequency [Hz] is left out; a quarter of the sampling frequency,
            if not given.

    Returns:
        Shape (K, n). Speeds to send, row by row: those of row k act two cycles later.
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
    """G_c^-1 in time, sample after sample, for torques that are linear in between.

    The state is the torque that the loop's integrator carries. Parameters are those of
    `VelocityLoop`, without delay and lag, which the caller looks ahead for.

    Args:
        gain, integral_time_s: Shape (n,). K_p and T_i of every joint.
        step_s: Time between samples [s].
        torque_nm: Shape (n,). The torque at the start, which the integrators carry already.
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
        # x' = (tau - x) / T_i with tau linear over the step.
        self._decay, self._old, self._new = decay, share - decay, 1.0 - share

    def step(self, torque_nm: FloatArray) -> FloatArray:
        """Return the velocity error that makes the next sample's torque, shape (n,)."""
        self._carried = self._decay * self._carried + self._old * self._last + self._new * torque_nm
        self._last = torque_nm
        return np.asarray((torque_nm - self._carried) / self.gain)


def padding_rows(step_s: float) -> int:
    """Return the rows of the return, with a rest before and after it."""
    return round((2.0 * REST_S + RETURN_S) / step_s)


def returned(values: FloatArray, step_s: float) -> FloatArray:
    """Return a signal with a smooth way back to its first row, so that its bins have no jump.

    The return is far longer than a velocity loop's integral time: nothing of it is left when the
    motion begins.

    Args:
        values: Shape (samples, n). A signal that rests at both ends.
        step_s: Time between rows [s].

    Returns:
        Shape (samples + padding_rows, n).
    """
    rows = padding_rows(step_s)
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
    """Return the feedforward of any motion that begins and ends at rest, on its bins.

    The motion is made periodic by a slow return to its start: all delays are looked ahead for, by
    parts of a cycle too. Parameters and result are those of `feedforward`.
    """
    speed, torque = (returned(values, cycle_time_s) for values in (velocity, torque_nm))
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
    """Return the feedforward of any motion in time, row after row, as the on-line stage does.

    Args:
        loops: One a joint.
        velocity, torque_nm: Shape (samples, n). The motion wanted, and the torque that a model says
            it takes.
        cycle_time_s: Time between rows [s].
        tuning: Correction from a reference run.

    Returns:
        Shape (samples, n). Speeds to send, row by row. What the first two cycles would have to be
        told before the motion begins is lost; it begins at rest.
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
