"""`Cascade`: current, velocity and position loop of one axis, with their margins and gain advice.

    velocity loop   L_v = G_c P ,            T_v = L_v / (1 + L_v)
    position loop   L_p = K_v R T_v / s ,    R: transmission of commands (`interpolation_response`)

G_c includes the lag of the current loop and the delay of the drive (`VelocityLoop`), P is the axis
(`AxisMechanics`), and R is the delay of one cycle and the interpolation of the digital position
loop. Aliasing of the position loop above half its sampling rate is neglected.

python-control computes the margins from frequency responses, because these represent delays
exactly. Rational transfer functions do not.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
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
POINTS: Final = 200
"""Number of points of a frequency grid; python-control's spline then gives margins to 1e-5."""
LOWEST_HZ: Final = 0.05
HIGHEST_HZ: Final = 2000.0


@dataclass(frozen=True)
class Margins:
    """Stability margins of an open loop.

    Attributes:
        gain: Factor by which the gain can grow before the loop becomes unstable; below 1 if it is
            unstable already; None if the phase crosses -180 degrees at no computed frequency.
        phase_deg: Phase margin [degrees]; None if the gain crosses 1 at no computed frequency.
        crossover_hz, phase_crossover_hz: Frequencies [Hz] of gain 1 and of phase -180 degrees.
    """

    gain: float | None
    phase_deg: float | None
    crossover_hz: float | None
    phase_crossover_hz: float | None

    @property
    def gain_db(self) -> float | None:
        """Gain margin [dB]; None without `gain`."""
        return None if self.gain is None else 20.0 * math.log10(self.gain)


@dataclass(frozen=True, eq=False)
class Cascade:
    """Nested loops of one axis.

    Attributes:
        loop: Velocity controller with its current loop.
        mechanics: Inertia and damping of the axis.
        position_gain_per_s: K_v [1/s].
        cycle_time_s: Cycle time of the position loop [s].
    """

    loop: VelocityLoop
    mechanics: AxisMechanics
    position_gain_per_s: float
    cycle_time_s: float

    def __post_init__(self) -> None:
        if self.loop.joint_name != self.mechanics.joint_name:
            raise EstimationError(
                f"the velocity loop belongs to joint {self.loop.joint_name}, the mechanics to"
                f" {self.mechanics.joint_name}",
                code="RID-INTERNAL-ERROR",
            )

    def velocity_loop(self, frequency_hz: FloatArray) -> Complex:
        """Return the open velocity loop L_v at frequencies [Hz]."""
        s = 2j * math.pi * np.asarray(frequency_hz, dtype=float)
        series = self.loop.transfer_function * self.mechanics.transfer_function
        return np.asarray(series(s) * np.exp(-s * self.loop.delay_s), dtype=np.complex128)

    def closed_velocity_loop(self, frequency_hz: FloatArray) -> Complex:
        """Return the closed velocity loop T_v: velocity over the command that reaches the drive."""
        opened = self.velocity_loop(frequency_hz)
        return np.asarray(opened / (1.0 + opened))

    def position_loop(self, frequency_hz: FloatArray) -> Complex:
        """Return the open position loop L_p at frequencies [Hz]."""
        reach = interpolation_response(frequency_hz, self.cycle_time_s)
        turn = 2j * math.pi * np.asarray(frequency_hz)
        closed = self.closed_velocity_loop(frequency_hz)
        return np.asarray(self.position_gain_per_s * reach * closed / turn)

    @property
    def velocity_loop_frd(self) -> control.FrequencyResponseData:
        """L_v as a python-control frequency response, over rad/s."""
        return _frd(self.velocity_loop, HIGHEST_HZ)

    @property
    def position_loop_frd(self) -> control.FrequencyResponseData:
        """L_p as a python-control frequency response, over rad/s."""
        return _frd(self.position_loop, 0.5 / self.cycle_time_s)

    @property
    def velocity_margins(self) -> Margins:
        """Margins of the velocity loop, including the current loop."""
        return margins(self.velocity_loop_frd)

    @property
    def position_margins(self) -> Margins:
        """Margins of the position loop, the outermost loop."""
        return margins(self.position_loop_frd)

    @property
    def peak(self) -> float:
        """Largest magnitude of the closed position loop without feedforward, |L_p / (1 + L_p)|."""
        return float(np.max(self.position_loop_frd.feedback().magnitude))

    @property
    def largest_position_gain_per_s(self) -> float:
        """Largest K_v with a phase margin of 60 degrees and a gain margin of 2 [1/s]."""
        loop = self.position_loop_frd
        turned = loop * cmath.exp(-1j * math.radians(LEAST_PHASE_DEG))
        factor = min(_gain_to_edge(turned), _gain_to_edge(loop) / LEAST_GAIN)
        return self.position_gain_per_s * factor

    def spread(self) -> tuple[Cascade, ...]:
        """Return pairs of cascades, one standard deviation above and below this one.

        There is one pair per column of the square root of the parameter covariance. If a result is
        computed from both cascades of a pair, half the difference is the contribution of this
        column to the result's standard deviation.
        """
        loop = self.loop
        steps = [
            (dict(zip(loop.names, column.tolist(), strict=True)), 0.0, 0.0)
            for column in _root(loop.covariance).T
        ]
        steps += [({}, *column.tolist()) for column in _root(self.mechanics.covariance).T]
        return tuple(
            replace(
                self,
                loop=loop.add({name: sign * step for name, step in controller.items()}),
                mechanics=self.mechanics.add(sign * inertia, sign * damping),
            )
            for controller, inertia, damping in steps
            for sign in (1.0, -1.0)
        )


@dataclass(frozen=True)
class GainAdvice:
    """Advice on the position gain of a cell.

    Attributes:
        joint_name: Axis with the smallest limit.
        present_per_s: Present K_v [1/s].
        largest_per_s: Largest K_v that keeps the margins on every axis, two standard deviations
            below the estimate [1/s]; 0 if two standard deviations exceed the estimate.
        sentence: The advice in words.
    """

    joint_name: str
    present_per_s: float
    largest_per_s: float
    sentence: str


def advise(cascades: Sequence[Cascade]) -> GainAdvice:
    """Return advice on K_v, which all axes share.

    Args:
        cascades: The measured axes.
    """
    limits = [_safe_position_gain(cascade) for cascade in cascades]
    least = int(np.argmin(limits))
    present, largest = cascades[0].position_gain_per_s, max(0.0, limits[least])
    name = cascades[least].loop.joint_name
    rule = (
        f"{LEAST_PHASE_DEG:g}° of phase margin and {20.0 * math.log10(LEAST_GAIN):.0f} dB of gain"
        " margin"
    )
    if largest == 0.0:
        text = (
            f"The loops of {name} are too uncertain for advice on K_v: measure again with more"
            " periods."
        )
    elif present > largest:
        probable = present > cascades[least].largest_position_gain_per_s
        text = (
            f"K_v {present:g} 1/s {'leaves' if probable else 'may leave'} {name} less than {rule}."
            f" Lower position_gain_per_s in the cell file to {largest:.3g} 1/s, which keeps these"
            " margins on every axis."
        )
    else:
        text = (
            f"K_v {present:g} 1/s can be raised to {largest:.3g} 1/s: every axis then keeps"
            f" {rule}; {name} is the limit. A larger K_v reduces the error of motions without"
            " feedforward."
        )
    return GainAdvice(name, present, largest, text)


def margins(opened: control.FrequencyResponseData) -> Margins:
    """Return the margins of an open loop, at the most critical crossing if there are several.

    Args:
        opened: The open loop, over rad/s.
    """
    gain, phase_deg, _, at_half, at_one, _ = control.stability_margins(opened)
    return Margins(
        gain=_finite(gain),
        phase_deg=_finite(phase_deg),
        crossover_hz=_finite(at_one / (2.0 * math.pi)),
        phase_crossover_hz=_finite(at_half / (2.0 * math.pi)),
    )


def _finite(value: float) -> float | None:
    """Return None if the value is not finite: python-control's result if there is no crossing."""
    return float(value) if math.isfinite(value) else None


def _gain_to_edge(opened: control.FrequencyResponseData) -> float:
    """Return the smallest gain factor that puts an open loop on the critical point -1."""
    factors = control.stability_margins(opened, returnall=True)[0]
    return float(min(factors, default=math.inf))


def _frd(
    response: Callable[[FloatArray], Complex], highest_hz: float
) -> control.FrequencyResponseData:
    grid = np.geomspace(LOWEST_HZ, highest_hz, POINTS)
    return control.FRD(response(grid), 2.0 * math.pi * grid)


def _root(covariance: FloatArray) -> FloatArray:
    """Return a matrix whose product with its transpose is the covariance."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _safe_position_gain(cascade: Cascade) -> float:
    """Return the largest K_v of an axis, two standard deviations below its best estimate."""
    ends = np.array([one.largest_position_gain_per_s for one in cascade.spread()])
    std = float(np.linalg.norm(0.5 * (ends[0::2] - ends[1::2])))
    return cascade.largest_position_gain_per_s - 2.0 * std
