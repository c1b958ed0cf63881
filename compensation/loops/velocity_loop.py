"""`VelocityLoop`: a drive's velocity controller, fitted to its measured frequency response.

    G_c(s) = K_p (1 + 1 / (T_i s)) exp(-s T_d) / (1 + s T_c)

T_d is the drive's own delay beyond the known delay of one cycle and the interpolation. T_c is the
lag of the current loop. Both are included if the data show them (theory: section 13). The fit is
maximum likelihood on the complex bins, each weighted by its measured variance (Pintelon and
Schoukens 2012, chapter 9). The minimum description length (Rissanen 1978) selects the terms; the
size of the misfit and its whiteness along the lines show whether they suffice.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from numpy.typing import NDArray

from compensation.loops.frequency_response import FrequencyResponse
from config.arrays import FloatArray, freeze
from config.errors import ConfigError, EstimationError

if TYPE_CHECKING:
    import control

Extra = Literal["delay", "lag"]
EXTRAS: Final[tuple[Extra, ...]] = ("delay", "lag")
PLAIN: Final[tuple[Extra, ...]] = ()
CHOICES: Final[tuple[tuple[Extra, ...], ...]] = (PLAIN, ("delay",), ("lag",), EXTRAS)
FEWEST_LINES: Final = 4
WHITENESS_LAGS: Final = 5
CLEARLY_SHORTER: Final = 4.0
FARTHEST_LOG: Final = 20.0
"""Largest distance of gain and integral time from their start values, in logarithms; data without a
controller would lead the fit to infinity."""
SMALLEST_P: Final = 0.001
SMALL_MISFIT: Final = 0.01
"""Misfit that does not matter, although it can be clearly larger than the noise."""


@dataclass(frozen=True, eq=False)
class LoopTrial:
    """Fit with one choice of terms, for comparison with other choices.

    Attributes:
        extras: Terms in addition to the PI controller: `delay`, `lag`.
        cost: Sum over all lines of |misfit|^2 divided by its variance.
        aic, mdl: Akaike's criterion and the minimum description length; smaller is better.
    """

    extras: tuple[Extra, ...]
    cost: float
    aic: float
    mdl: float


@dataclass(frozen=True, eq=False)
class VelocityLoop:
    """A fitted velocity controller, referred to the joint side of the gear.

    Attributes:
        gain: K_p [N m s/rad or N s/m].
        integral_time_s: T_i [s].
        delay_s, lag_s: T_d and T_c [s]; 0 if the data do not show them.
        names: Fitted parameters, in the order of the covariance.
        covariance: Shape (k, k). Covariance of the fitted parameters, including the uncertainty of
            the choice of terms.
        p_value: Probability of a larger cost by chance; small if the controller has another
            structure.
        trials: All choices that were compared; empty for a loop from a file.
        whiteness: Probability of a larger correlation of neighbouring lines by chance; small if a
            term is missing; 1 if there are too few lines for the test.
        misfit: Median over the lines of |1 - measured / fitted response|.
    """

    joint_name: str
    gain: float
    integral_time_s: float
    delay_s: float
    lag_s: float
    names: tuple[str, ...]
    covariance: FloatArray
    p_value: float
    trials: tuple[LoopTrial, ...]
    whiteness: float = 1.0
    misfit: float = 0.0

    def __post_init__(self) -> None:
        k = len(self.names)
        freeze(self, EstimationError, (k, k), "covariance")
        if not (self.gain > 0.0 and self.integral_time_s > 0.0 and self.lag_s >= 0.0):
            raise EstimationError(
                f"joint {self.joint_name}: invalid velocity controller: gain {self.gain:.4g},"
                f" integral time {self.integral_time_s:.4g} s; measure the loop again",
                code="RID-LOOP-WEAK",
            )

    @property
    def is_explained(self) -> bool:
        """False if the misfit is not noise and large enough to matter."""
        return self.misfit <= SMALL_MISFIT or self.p_value >= SMALLEST_P

    @property
    def is_complete(self) -> bool:
        """False if neighbouring lines have similar misfits that are large enough to matter."""
        return self.misfit <= SMALL_MISFIT or self.whiteness >= SMALLEST_P

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviation of each fitted parameter."""
        sizes = np.sqrt(np.diagonal(self.covariance))
        return dict(zip(self.names, sizes.tolist(), strict=True))

    def response(self, frequency_hz: FloatArray) -> NDArray[np.complex128]:
        """Return G_c at frequencies [Hz] with its delay; not defined at 0 Hz."""
        values = (self.gain, self.integral_time_s, self.delay_s, self.lag_s)
        return _response(np.asarray(frequency_hz), *values)

    def widened(self, share: float) -> VelocityLoop:
        """Return the loop with a relative error of gain and integral time added to its covariance.

        Args:
            share: Standard deviation of the error, relative to the values.
        """
        values = {"gain": self.gain, "integral_time_s": self.integral_time_s}
        more = [(share * values.get(name, 0.0)) ** 2 for name in self.names]
        return replace(self, covariance=self.covariance + np.diag(more))

    def add(self, by: Mapping[str, float]) -> VelocityLoop:
        """Return the loop with amounts added to its parameters, limited to possible values."""
        least = 1e-3
        return replace(
            self,
            gain=max(self.gain + by.get("gain", 0.0), least * self.gain),
            integral_time_s=max(
                self.integral_time_s + by.get("integral_time_s", 0.0), least * self.integral_time_s
            ),
            delay_s=max(self.delay_s + by.get("delay", 0.0), 0.0),
            lag_s=max(self.lag_s + by.get("lag", 0.0), 0.0),
        )

    @property
    def transfer_function(self) -> control.TransferFunction:
        """G_c(s) without its delay, as a python-control transfer function.

        python-control has no exact delay; `response` includes it.
        """
        import control

        return control.TransferFunction(*_fraction(self.gain, self.integral_time_s, self.lag_s))


def fit_velocity_loop(
    measured: FrequencyResponse, choices: Sequence[tuple[Extra, ...]] = CHOICES
) -> VelocityLoop:
    """Fit a velocity controller to its frequency response.

    Args:
        choices: The choices of terms that are compared.

    Raises:
        EstimationError: There are too few lines, the fitted gain or times are not positive, or the
            gain is less than two standard deviations.
    """
    lines = len(measured.frequency_hz)
    if lines < FEWEST_LINES:
        raise EstimationError(
            f"joint {measured.joint_name}: the frequency response has {lines} lines, but a velocity"
            f" controller needs at least {FEWEST_LINES}: excite it at more frequencies",
            code="RID-LOOP-WEAK",
        )
    fits = [_fit(measured, extras) for extras in choices]
    trials = tuple(_trial(measured, extras, cost) for extras, _, _, cost in fits)
    best = _choose_trial(trials)
    extras, values, covariance, cost = fits[best]
    covariance = covariance + _model_covariance(trials, [fit[1] for fit in fits], best)
    found = dict(zip(("gain", "integral_time_s", *extras), values.tolist(), strict=True))
    loop = VelocityLoop(
        joint_name=measured.joint_name,
        gain=found["gain"],
        integral_time_s=found["integral_time_s"],
        delay_s=found.get("delay", 0.0),
        lag_s=found.get("lag", 0.0),
        names=tuple(found),
        covariance=covariance,
        p_value=_chance_of_cost(measured, cost, len(values)),
        trials=trials,
    )
    if 2.0 * loop.sigma["gain"] > loop.gain:
        raise EstimationError(
            f"joint {measured.joint_name}: the data do not show the gain of its velocity loop,"
            f" {loop.gain:.3g} ± {2.0 * loop.sigma['gain']:.2g} (two standard deviations): check"
            " the torque and the commands of this joint, and increase the excitation",
            code="RID-LOOP-WEAK",
        )
    fitted = loop.response(measured.frequency_hz)
    left = measured.response - fitted
    return replace(
        loop,
        whiteness=whiteness(left / np.sqrt(measured.variance)),
        misfit=float(np.median(np.abs(left / fitted))),
    )


def _choose_trial(trials: Sequence[LoopTrial]) -> int:
    """Return the index of the trial with the least description length.

    A lag is preferred to a delay if their description lengths differ little.
    """
    least = min(range(len(trials)), key=lambda k: trials[k].mdl)
    if trials[least].extras == ("delay",):
        for k, trial in enumerate(trials):
            if trial.extras == ("lag",) and trial.mdl < trials[least].mdl + CLEARLY_SHORTER:
                return k
    return least


def _model_covariance(
    trials: Sequence[LoopTrial], values: Sequence[FloatArray], best: int
) -> FloatArray:
    """Return the covariance of gain and integral time due to the uncertain choice of terms.

    The weight of each choice is the probability given by its description length (Burnham and
    Anderson 2002, chapter 4).
    """
    lengths = np.array([trial.mdl for trial in trials])
    chance = np.exp(-0.5 * (lengths - lengths.min()))
    chance /= chance.sum()
    difference = np.array([each[:2] - values[best][:2] for each in values])
    added = np.zeros((len(values[best]), len(values[best])))
    added[:2, :2] = (chance[:, np.newaxis] * difference).T @ difference
    return added


def whiteness(misfit: NDArray[np.complex128]) -> float:
    """Return the probability that uncorrelated (white) misfits show at least this correlation.

    A test of the Ljung-Box type on the complex autocorrelation of the weighted misfits along the
    lines.

    Args:
        misfit: Shape (lines,). Misfits divided by their standard deviations, in the order of
            frequency.
    """
    lines = len(misfit)
    lags = min(WHITENESS_LAGS, lines // 3)
    power = float(np.mean(np.abs(misfit) ** 2))
    if lags < 1 or power == 0.0:
        return 1.0
    statistic = 0.0
    for lag in range(1, lags + 1):
        alike = float(abs(np.vdot(misfit[:-lag], misfit[lag:]))) / (lines * power)
        statistic += 2.0 * lines * (lines + 1.0) / (lines - lag) * alike**2
    return _chi_squared_tail(2 * lags, statistic)


def _chi_squared_tail(freedom: float, value: float) -> float:
    """Return the probability that a chi-squared value is larger."""
    from scipy.special import chdtrc  # a slow import that only the fit of a loop needs

    return float(chdtrc(freedom, value))


def _chance_of_cost(measured: FrequencyResponse, cost: float, parameters: int) -> float:
    """Return the probability of a larger cost if only noise remains.

    The variance of each line comes from few periods. Therefore the line's part of the cost follows
    an F distribution instead of a chi-squared one. The sum is approximated by a scaled chi-squared
    distribution with the same mean and variance.
    """
    lines, freedom = len(measured.frequency_hz), measured.noise_freedom
    if freedom <= 2:
        return _chi_squared_tail(2 * lines - parameters, 2.0 * cost)
    # Mean and variance of |misfit|^2 / variance; the variance has `freedom` degrees of freedom.
    mean = freedom / (freedom - 1.0)
    variance = freedom**3 / ((freedom - 1.0) ** 2 * (freedom - 2.0))
    left = lines - 0.5 * parameters
    scale = variance / mean
    return _chi_squared_tail(2.0 * left * mean / scale, 2.0 * cost / scale)


def _trial(measured: FrequencyResponse, extras: tuple[Extra, ...], cost: float) -> LoopTrial:
    parameters, values = 2 + len(extras), 2 * len(measured.frequency_hz)
    return LoopTrial(
        extras=extras,
        cost=cost,
        aic=2.0 * cost + 2.0 * parameters,
        mdl=2.0 * cost + math.log(values) * parameters,
    )


def _fit(
    measured: FrequencyResponse, extras: tuple[Extra, ...]
) -> tuple[tuple[Extra, ...], FloatArray, FloatArray, float]:
    """Return the parameters, their covariance and the cost, sum |misfit|^2 / variance."""
    from scipy.optimize import least_squares  # a slow import that few commands need

    frequency_hz, weight = measured.frequency_hz, 1.0 / np.sqrt(measured.variance)

    def unfold(x: FloatArray) -> tuple[float, float, float, float]:
        more = dict(zip(extras, x[2:].tolist(), strict=True))
        return (
            math.exp(x[0]),
            math.exp(x[1]),
            1e-3 * more.get("delay", 0.0),
            1e-3 * more.get("lag", 0.0),
        )

    def residuals(x: FloatArray) -> FloatArray:
        misfit = weight * (_response(frequency_hz, *unfold(x)) - measured.response)
        return np.concatenate([misfit.real, misfit.imag])

    size = np.abs(measured.response)
    middle = float(np.median(frequency_hz))
    start = [math.log(float(np.median(size))), math.log(1.0 / (2.0 * math.pi * middle))]
    begin = np.array([*start, *(0.5 for _ in extras)])
    lowest = np.array([*(each - FARTHEST_LOG for each in start), *(0.0 for _ in extras)])
    highest = np.array([*(each + FARTHEST_LOG for each in start), *(np.inf for _ in extras)])
    found = least_squares(residuals, begin, x_scale="jac", bounds=(lowest, highest))
    values = np.array(unfold(found.x))
    kept = np.array([0, 1, *(2 + EXTRAS.index(extra) for extra in extras)])
    # Derivatives of the values with respect to x: the value itself if x is its logarithm, 1e-3 if x
    # is in milliseconds.
    chain_rule = np.concatenate([values[:2], np.full(2, 1e-3)])[kept]
    # With E|dG|^2 = variance, real and imaginary parts have half the variance each.
    slopes: FloatArray = np.asarray(found.jac, dtype=float)
    # The weights are inexact, because they are estimated from few periods: scale the covariance by
    # the misfit.
    freedom = 2 * len(frequency_hz) - len(begin)
    inflation = max(1.0, 4.0 * float(found.cost) / freedom)
    inverse = inflation * np.linalg.pinv(2.0 * slopes.T @ slopes)
    covariance: FloatArray = np.asarray(inverse * np.outer(chain_rule, chain_rule), dtype=float)
    return extras, values[kept], covariance, 2.0 * float(found.cost)


def _fraction(gain: float, integral_s: float, lag_s: float) -> tuple[list[float], list[float]]:
    """Return numerator and denominator of G_c without its delay, highest power of s first."""
    lag = [integral_s * lag_s] if lag_s > 0.0 else []
    return [gain * integral_s, gain], [*lag, integral_s, 0.0]


def _response(
    frequency_hz: FloatArray, gain: float, integral_s: float, delay_s: float, lag_s: float
) -> NDArray[np.complex128]:
    """Return G_c at frequencies [Hz].

    The fit and `rid-daq compensate` use it without importing python-control, which loads
    matplotlib.
    """
    s = 2j * math.pi * frequency_hz
    numerator, denominator = _fraction(gain, integral_s, lag_s)
    return np.asarray(
        np.polyval(numerator, s) / np.polyval(denominator, s) * np.exp(-s * delay_s),
        dtype=np.complex128,
    )


def in_order(
    names: Sequence[str], modelled: Sequence[str], loops: Sequence[VelocityLoop]
) -> list[VelocityLoop]:
    """Return the loops in the order of the joints.

    Raises:
        ConfigError: The model belongs to other joints, or a loop is missing.
    """
    if tuple(modelled) != tuple(names):
        raise ConfigError(
            f"the model has the joints {', '.join(modelled)}, the motion {', '.join(names)}: use a"
            " model of this robot",
            code="RID-ROBOT-OTHER",
        )
    measured = {loop.joint_name: loop for loop in loops}
    missing = [name for name in names if name not in measured]
    if missing:
        raise ConfigError(
            f"no velocity loop of {', '.join(missing)}: measure it with `rid-daq loop`",
            code="RID-LOOP-MISSING",
        )
    return [measured[name] for name in names]
