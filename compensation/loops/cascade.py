"""`Cascade`: current, velocity and position loop of one axis together, their margins and advice.

    velocity loop   L_v = G_c P ,            T_v = L_v / (1 + L_v)
    position loop   L_p = K_v R T_v / s ,    R: commands on their way (`interpolation_response`)

G_c holds the current loop's lag and the drive's delay (`VelocityLoop`), P the axis
(`AxisMechanics`), R the cycle of delay and the interpolation of the digital position loop. What the
position loop samples above half its frequency is neglected.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import control
import numpy as np
from numpy.typing import NDArray

from compensation.loops.axis_mechanics import AxisMechanics
from compensation.loops.multisine_spectra import interpolation_response
from compensation.loops.velocity_loop import VelocityLoop
from config.arrays import FloatArray
from config.errors import EstimationError

Complex = NDArray[np.complex128]

LEAST_PHASE_DEG: Final = 60.0
LEAST_GAIN: Final = 2.0
DRAWS: Final = 200
POINTS: Final = 1500
LOWEST_HZ: Final = 0.05
HIGHEST_HZ: Final = 2000.0


@dataclass(frozen=True)
class Margins:
    """How far an open loop is from instability.

    Attributes
    ----------
    gain : float or None
        The factor by which its gain may grow, below 1 where it is unstable already and has to
        shrink; None where no gain makes it unstable.
    phase_deg : float or None
        The phase that it may lose; None where its gain is below 1 everywhere.
    crossover_hz, phase_crossover_hz : float or None
        Where its gain is 1, and where its phase is -180 degrees.
    """

    gain: float | None
    phase_deg: float | None
    crossover_hz: float | None
    phase_crossover_hz: float | None

    @property
    def gain_db(self) -> float | None:
        """The gain margin [dB]."""
        return None if self.gain is None else 20.0 * math.log10(self.gain)


@dataclass(frozen=True, eq=False)
class Cascade:
    """The loops of one axis around one another.

    Attributes
    ----------
    loop : VelocityLoop
        The velocity controller with its current loop.
    mechanics : AxisMechanics
        What it moves.
    position_gain_per_s : float
        K_v [1/s].
    cycle_time_s : float
        Of the position loop [s].
    """

    loop: VelocityLoop
    mechanics: AxisMechanics
    position_gain_per_s: float
    cycle_time_s: float

    def __post_init__(self) -> None:
        if self.loop.joint_name != self.mechanics.joint_name:
            raise EstimationError(
                f"the velocity loop is of joint {self.loop.joint_name}, the mechanics of"
                f" {self.mechanics.joint_name}"
            )

    def velocity_loop(self, frequency_hz: FloatArray) -> Complex:
        """Return the velocity loop opened at the error, L_v."""
        return self.loop.response(frequency_hz) * self.mechanics.response(frequency_hz)

    def closed_velocity_loop(self, frequency_hz: FloatArray) -> Complex:
        """Return velocity over its command as it reaches the drive, T_v."""
        opened = self.velocity_loop(frequency_hz)
        return np.asarray(opened / (1.0 + opened))

    def position_loop(self, frequency_hz: FloatArray) -> Complex:
        """Return the position loop opened at the error, L_p."""
        reach = interpolation_response(frequency_hz, self.cycle_time_s)
        turn = 2j * math.pi * np.asarray(frequency_hz)
        closed = self.closed_velocity_loop(frequency_hz)
        return np.asarray(self.position_gain_per_s * reach * closed / turn)

    @property
    def velocity_margins(self) -> Margins:
        """Of the velocity loop with its current loop."""
        grid = _grid(HIGHEST_HZ)
        return margins(grid, self.velocity_loop(grid))

    @property
    def position_margins(self) -> Margins:
        """Of the position loop around all."""
        grid = _grid(0.5 / self.cycle_time_s)
        return margins(grid, self.position_loop(grid))

    @property
    def peak(self) -> float:
        """Largest amplification of the position loop without feedforward, |L_p / (1 + L_p)|."""
        opened = self.position_loop(_grid(0.5 / self.cycle_time_s))
        return float(np.abs(opened / (1.0 + opened)).max())

    @property
    def position_loop_frd(self) -> control.FrequencyResponseData:
        """L_p as python-control's object, over rad/s, its delay exact."""
        grid = _grid(0.5 / self.cycle_time_s)
        return control.FRD(self.position_loop(grid), 2.0 * math.pi * grid)

    @property
    def largest_position_gain_per_s(self) -> float:
        """The largest K_v with a phase margin of 60 degrees and a gain margin of 2 [1/s]."""
        grid = _grid(0.5 / self.cycle_time_s)
        unit = self.position_loop(grid) / self.position_gain_per_s
        phase = np.degrees(np.unwrap(np.angle(unit)))
        level = np.log(np.abs(unit))
        found = []
        for degrees, factor in ((LEAST_PHASE_DEG - 180.0, 1.0), (-180.0, LEAST_GAIN)):
            below = np.flatnonzero(phase < degrees)
            if len(below) and below[0] > 0:
                k = int(below[0])
                share = (phase[k - 1] - degrees) / (phase[k - 1] - phase[k])
                at = (1.0 - share) * level[k - 1] + share * level[k]
                found.append(math.exp(-at) / factor)
        return min(found, default=math.inf)

    def drawn(self, seed: int = 0) -> tuple[Cascade, ...]:
        """Return cascades whose fitted parameters are drawn from their covariances."""
        random = np.random.default_rng(seed)
        loops = random.multivariate_normal(
            np.zeros(len(self.loop.names)), self.loop.covariance, DRAWS
        )
        axes = random.multivariate_normal(np.zeros(2), self.mechanics.covariance, DRAWS)
        return tuple(
            replace(
                self,
                loop=self.loop.moved(dict(zip(self.loop.names, off.tolist(), strict=True))),
                mechanics=replace(
                    self.mechanics,
                    inertia=max(
                        self.mechanics.inertia + float(inertia), 1e-3 * self.mechanics.inertia
                    ),
                    damping=self.mechanics.damping + float(damping),
                ),
            )
            for off, (inertia, damping) in zip(loops, axes, strict=True)
        )


@dataclass(frozen=True)
class GainAdvice:
    """What to do about the position gain of a cell.

    Attributes
    ----------
    joint_name : str
        The axis that allows least.
    present_per_s : float
        K_v as it is [1/s].
    largest_per_s : float
        The largest K_v that keeps the margins on every axis, two standard deviations below what
        the fits say.
    sentence : str
        The advice in words.
    """

    joint_name: str
    present_per_s: float
    largest_per_s: float
    sentence: str


def advise(cascades: Sequence[Cascade]) -> GainAdvice:
    """Return what the margins say about K_v, which all axes share.

    Parameters
    ----------
    cascades : sequence of Cascade
        Of the axes that were measured.
    """
    limits = [_surely(cascade) for cascade in cascades]
    least = int(np.argmin(limits))
    present, largest = cascades[0].position_gain_per_s, limits[least]
    name = cascades[least].loop.joint_name
    rule = f"{LEAST_PHASE_DEG:g}° of phase and {20.0 * math.log10(LEAST_GAIN):.0f} dB of gain"
    if present > largest:
        text = (
            f"K_v {present:g} 1/s leaves {name} less than {rule}: {largest:.3g} 1/s keeps that on"
            " every axis. Lower position_gain_per_s in the cell file."
        )
    else:
        text = (
            f"K_v {present:g} 1/s may grow to {largest:.3g} 1/s: up to there every axis keeps"
            f" {rule}; {name} allows least. A larger K_v follows more closely where there is no"
            " feedforward."
        )
    return GainAdvice(name, present, largest, text)


def margins(frequency_hz: FloatArray, opened: Complex) -> Margins:
    """Return the margins of an open loop given on a fine grid, of several the one nearest.

    Parameters
    ----------
    frequency_hz : ndarray, shape (points,)
        Rising.
    opened : ndarray of complex, shape (points,)
        The open loop.
    """
    level = np.log(np.abs(opened))
    turns = np.degrees(np.unwrap(np.angle(opened)))
    where = np.log(frequency_hz)
    ones = [_between(where, level, turns, k, -float(level[k])) for k in _crossings(level)]
    half = np.mod(turns, 360.0) - 180.0
    # A jump of the remainder by a whole turn is no crossing.
    halves = [k for k in _crossings(half) if abs(half[k + 1] - half[k]) < 180.0]
    halfway = [_between(where, half, level, k, -float(half[k])) for k in halves]
    phase = min(ones, key=lambda x: abs(_wrapped(x[1])), default=None)
    gain = min(halfway, key=lambda x: abs(x[1]), default=None)
    return Margins(
        gain=None if gain is None else math.exp(-gain[1]),
        phase_deg=None if phase is None else _wrapped(phase[1]),
        crossover_hz=None if phase is None else math.exp(phase[0]),
        phase_crossover_hz=None if gain is None else math.exp(gain[0]),
    )


def _crossings(values: FloatArray) -> list[int]:
    """Return the places behind which values change their sign."""
    return [int(k) for k in np.flatnonzero(np.diff(np.signbit(values)))]


def _between(
    where: FloatArray, crossing: FloatArray, other: FloatArray, k: int, rise: float
) -> tuple[float, float]:
    """Return place and other value where `crossing` has risen by `rise` since point k."""
    share = rise / float(crossing[k + 1] - crossing[k])
    return (
        float(where[k] + share * (where[k + 1] - where[k])),
        float(other[k] + share * (other[k + 1] - other[k])),
    )


def _wrapped(phase_deg: float) -> float:
    """Return the phase above -180 degrees, from -180 to 180."""
    return (phase_deg + 360.0) % 360.0 - 180.0


def _surely(cascade: Cascade) -> float:
    """Return the largest K_v of an axis, two standard deviations below its best estimate."""
    best = cascade.largest_position_gain_per_s
    drawn = np.array([one.largest_position_gain_per_s for one in cascade.drawn()])
    return float(best - 2.0 * drawn.std())


def _grid(highest_hz: float) -> FloatArray:
    return np.geomspace(LOWEST_HZ, highest_hz, POINTS)
