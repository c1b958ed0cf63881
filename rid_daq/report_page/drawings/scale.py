"""`Scale`: places of an axis's values in a drawing, and its ticks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.formats.interval import superscript, with_minus_sign
from rid_daq.blocks.plot import Axis

_STEPS: Final = (1.0, 2.0, 2.5, 5.0, 10.0)
_ROUNDING: Final = 1e-9
_FEWEST_DECADES: Final = 1.5
"""Shorter logarithmic axes have ticks at 1, 2 and 5 times the powers of ten."""

_PLAIN: Final = (1e-4, 1e6)
"""Largest absolute values whose tick labels have no power of ten."""


@dataclass(frozen=True)
class Tick:
    """A tick of an axis; an empty label marks a minor tick."""

    value: float
    label: str


@dataclass(frozen=True)
class Scale:
    """Linear or logarithmic scale.

    Attributes:
        low, high: Ends of the axis.
        is_log: True for a logarithmic scale.
        start, end: Places of the ends in the drawing [pt].
    """

    low: float
    high: float
    is_log: bool
    start: float
    end: float

    def place(self, values: FloatArray) -> FloatArray:
        """Return the places of values [pt]; NaN for a value that a logarithmic axis cannot show."""
        values = np.asarray(values, dtype=float)
        if self.is_log:
            positive = np.where(values > 0.0, values, np.nan)
            share = np.log(positive / self.low) / math.log(self.high / self.low)
        else:
            share = (values - self.low) / (self.high - self.low)
        return np.asarray(self.start + share * (self.end - self.start))

    def ticks(self, spacing: float) -> tuple[Tick, ...]:
        """Return the ticks; labels are at least `spacing` apart [pt], as far as possible."""
        most = max(2, int(abs(self.end - self.start) / spacing))
        return _log_ticks(self, most) if self.is_log else _linear_ticks(self.low, self.high, most)


def axis_ends(axis: Axis, values: Iterable[FloatArray], margin: float) -> tuple[float, float]:
    """Return the ends of an axis: the declared ones, or those of the data with a margin.

    Args:
        axis: The axis.
        values: Values on the axis.
        margin: Margin as a fraction of the data's range.
    """
    every = np.concatenate([np.zeros(0), *(np.asarray(each, dtype=float) for each in values)])
    seen = every[np.isfinite(every) & (every > 0.0 if axis.log else True)]
    low, high = (float(seen.min()), float(seen.max())) if len(seen) else (1.0, 10.0)
    if low == high:
        half = 0.5 * abs(low) or 0.5
        low, high = (low / 2.0, high * 2.0) if axis.log else (low - half, high + half)
    if axis.log:
        reach = (high / low) ** margin
        low, high = low / reach, high * reach
    else:
        reach = (high - low) * margin
        low, high = low - reach, high + reach
    low = low if axis.least is None else axis.least
    high = high if axis.most is None else axis.most
    return (low, high) if high > low else (low, low + (abs(low) or 1.0))


def _linear_ticks(low: float, high: float, most: int) -> tuple[Tick, ...]:
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(part * power for part in _STEPS if part * power >= rough * (1.0 - _ROUNDING))
    first, last = math.ceil(low / step - _ROUNDING), math.floor(high / step + _ROUNDING)
    values = [number * step for number in range(first, last + 1)]
    largest = max(abs(low), abs(high))
    exponent = 0 if _PLAIN[0] <= largest < _PLAIN[1] else math.floor(math.log10(largest))
    unit = 10.0**exponent
    decimals = max(0, -math.floor(math.log10(step / unit) + _ROUNDING))
    if step / power == _STEPS[2]:  # 2.5 has one more digit
        decimals = max(0, 1 - math.floor(math.log10(power / unit) + _ROUNDING))
    tail = f"·10{superscript(exponent)}" if exponent else ""
    labels = (with_minus_sign(f"{value / unit + 0.0:.{decimals}f}") for value in values)
    return tuple(
        Tick(value, label + tail if value else label)
        for value, label in zip(values, labels, strict=True)
    )


def _log_ticks(scale: Scale, most: int) -> tuple[Tick, ...]:
    first, last = math.floor(math.log10(scale.low)), math.ceil(math.log10(scale.high))
    decades = math.log10(scale.high / scale.low)
    every = max(1, math.ceil(decades / most))
    labelled = (1, 2, 5) if decades < _FEWEST_DECADES else (1,)
    ticks = []
    for power in range(first, last + 1):
        for factor in range(1, 10):
            value = factor * 10.0**power
            if scale.low * (1.0 - _ROUNDING) <= value <= scale.high * (1.0 + _ROUNDING):
                is_named = factor in labelled and power % every == 0
                if is_named or every == 1 or factor == 1:
                    ticks.append(Tick(value, _power_label(factor, power) if is_named else ""))
    return tuple(ticks)


def _power_label(factor: int, power: int) -> str:
    if -3 <= power <= 3:
        return f"{factor * 10.0**power:g}"
    return f"{'' if factor == 1 else f'{factor}·'}10{superscript(power)}"
