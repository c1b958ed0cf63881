"""`ChargeAmplifier`: eight charge amplifiers, their low-pass, converter and clock, without a line.

A function of the times that it is given, like the drives: it never looks at a clock, and the same
calls with the same seed give the same counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from config.cell.plate import CHANNELS
from config.simulation.plant import SimulatedPlate
from mock_hw.plant.torque_filter import butterworth_poles

Vector = NDArray[np.float64]
ComplexVector = NDArray[np.complex128]

FULL_SCALE_V = 10.0
LONGEST_STEP_S = 0.010
"""How long an input is taken for constant while nobody says what the sensors feel [s]."""


@dataclass(frozen=True)
class AmplifierSettings:
    """What an amplifier can be set to; the defaults are those of its power-on.

    Attributes:
        range_n: Force at full scale, per channel [N].
        sensitivity_pc_n: Of the sensors, per channel [pC/N].
        low_pass_hz, low_pass_order: The Butterworth filter before the converter.
        rate_hz: Rows per second of the amplifier's own clock.
        bits: Of the converter, whose span is both signs of full scale.
    """

    range_n: tuple[float, ...] = (5000.0,) * 4 + (20000.0,) * 4
    sensitivity_pc_n: tuple[float, ...] = (-1.0,) * CHANNELS
    low_pass_hz: float = 30.0
    low_pass_order: int = 2
    rate_hz: float = 100.0
    bits: int = 16

    def __post_init__(self) -> None:
        if len(self.range_n) != CHANNELS or len(self.sensitivity_pc_n) != CHANNELS:
            raise ValueError(f"range_n and sensitivity_pc_n must have {CHANNELS} values")
        if not (min(self.range_n) > 0.0 and all(self.sensitivity_pc_n)):
            raise ValueError("range_n must be positive and sensitivity_pc_n not 0")
        if not (self.low_pass_hz > 0.0 and self.rate_hz > 0.0):
            raise ValueError("low_pass_hz and rate_hz must be positive")
        if not (1 <= self.low_pass_order <= 8 and 8 <= self.bits <= 16):
            raise ValueError("low_pass_order must be 1 to 8, bits 8 to 16")

    @property
    def volts_per_pc(self) -> Vector:
        """Output over charge, (8,): a charge of range times sensitivity is full scale."""
        gain: Vector = FULL_SCALE_V / (np.array(self.sensitivity_pc_n) * np.array(self.range_n))
        return gain


@dataclass(frozen=True, eq=False)
class AmplifierRows:
    """What has been converted.

    Attributes:
        time_s, device_s: Shape (rows,). When, on the cell's clock and on the amplifier's [s].
        counts: Shape (rows, 8). Converter counts; 2 to the power of (bits - 1) would be full scale.
        overload: Shape (rows,). The latched overload word: bit i for channel i + 1.
    """

    time_s: Vector
    device_s: Vector
    counts: NDArray[np.int16]
    overload: NDArray[np.uint8]


class ChargeAmplifier:
    """Eight channels on one clock, at Reset when switched on.

    Args:
        truth: Drift, zero jump, noise and clock.
        seed: Of the noise.
        now_s: When it is switched on [s].

    Attributes:
        settings: What it is set to; change it by `apply`.
        time_s: How far it has been brought [s].
        operating: Whether it measures; at Reset its inputs are shorted.
        overload: The latched overload word.
    """

    def __init__(self, truth: SimulatedPlate, seed: int, now_s: float = 0.0) -> None:
        self._truth = truth
        self._random = np.random.default_rng(seed)
        self._jump_pc = np.array(truth.zero_jump_pc)
        self._drift_pc_s = np.array(truth.drift_pc_s)
        self._rate = 1.0 + 1e-6 * truth.clock_ppm
        self._reference_pc = np.zeros(CHANNELS)
        self._charge_pc = np.zeros(CHANNELS)
        self._switched_on_s = self._operated_s = now_s
        self._output_v = np.zeros(CHANNELS)
        self._next_row: int | None = None
        self.time_s = now_s
        self.operating = False
        self.overload = 0
        self._overloaded = 0
        self.settings = AmplifierSettings()
        self._set_filter()
        self.convert(now_s)  # of no time: the filter is compiled before anybody waits for an answer

    @property
    def converting(self) -> bool:
        """Whether rows are made."""
        return self._next_row is not None

    def device_s(self, time_s: float) -> float:
        """Return what the amplifier's clock shows at a time of the cell's [s]."""
        return self._truth.clock_offset_s + self._rate * (time_s - self._switched_on_s)

    def apply(self, settings: AmplifierSettings) -> None:
        """Take new settings; the charge on the inputs stays, a low-pass starts settled."""
        rescale = settings.volts_per_pc / self.settings.volts_per_pc
        before, self.settings = self.settings, settings
        filters = (settings.low_pass_hz, settings.low_pass_order)
        if filters != (before.low_pass_hz, before.low_pass_order):
            self._set_filter()
            self._settle(self._output_v * rescale)
        else:
            self._filter.state[:] *= rescale
        self._output_v = self._output_v * rescale
        if self._next_row is not None and settings.rate_hz != before.rate_hz:
            self.start()

    def operate(self, charge_pc: ArrayLike) -> None:
        """Measure from now on: the sensors' charges of now, (8,), become zero."""
        if self.operating:
            return
        self.operating = True
        self._operated_s = self.time_s
        self._reference_pc = np.array(charge_pc, dtype=np.float64)
        self._charge_pc = self._reference_pc.copy()

    def reset(self) -> None:
        """Short the inputs."""
        self.operating = False
        self._overloaded = 0

    def take_overload(self) -> int:
        """Return the latched overload word; what is overloaded still stays in it."""
        word, self.overload = self.overload, self._overloaded
        return word

    def start(self) -> None:
        """Make rows from now on, on the ticks of the amplifier's own clock."""
        self._next_row = math.floor(self.device_s(self.time_s) * self.settings.rate_hz) + 1

    def stop(self) -> None:
        """Make no more rows."""
        self._next_row = None

    def present_counts(self) -> NDArray[np.int16]:
        """Return what a single conversion now would give, (8,), with noise."""
        counts: NDArray[np.int16] = self._convert(self._output_v[np.newaxis])[0]
        return counts

    def convert(
        self, end_s: float, ends_s: ArrayLike = (), charges_pc: ArrayLike = ()
    ) -> AmplifierRows:
        """Let time pass until `end_s`; return the rows that were converted meanwhile.

        Args:
            end_s: Until when [s].
            ends_s: Shape (m,). When intervals of constant charge end, each beginning where the one
                before it ended; the last charge lasts on.
            charges_pc: Shape (m, 8). The sensors' charges [pC].

        Raises:
            ValueError: If time would run backwards.
        """
        if not end_s >= self.time_s:
            raise ValueError(f"end_s {end_s} lies before {self.time_s}")
        times = np.asarray(ends_s, dtype=np.float64)
        charges = np.asarray(charges_pc, dtype=np.float64).reshape(-1, CHANNELS)
        if len(charges):
            self._charge_pc = charges[-1]
        last_s = float(times[-1]) if len(times) else self.time_s
        if end_s > last_s:
            held = last_s + (end_s - last_s) * _shares_of(end_s - last_s)
            times = np.append(times, held)
            charges = np.vstack([charges, np.tile(self._charge_pc, (len(held), 1))])
        row_times, device_s = self._due(end_s)
        output = np.empty((len(row_times), CHANNELS))
        overload = np.empty(len(row_times), dtype=np.uint8)
        volts = self._input(times, charges)
        if len(volts):
            self._overloaded = sum(1 << int(i) for i in np.flatnonzero(_at_limit(volts[-1])))
        rows = _Rows(row_times, output, overload)
        self.overload = _run_filter(self.time_s, times, volts, self._filter, rows, self.overload)
        self._output_v = (self._filter.weights @ self._filter.state).real
        self.time_s = end_s
        return AmplifierRows(row_times, device_s, self._convert(output), overload)

    def _input(self, times: Vector, charges: Vector) -> Vector:
        """Return the charge stages' voltages in every interval, not yet limited, (m, 8)."""
        if not self.operating:
            return np.zeros_like(charges)
        starts = np.concatenate([[self.time_s], times[:-1]])
        passed_s = np.maximum(0.5 * (starts + times) - self._operated_s, 0.0)
        charge = charges - self._reference_pc + self._jump_pc
        charge += passed_s[:, np.newaxis] * self._drift_pc_s
        volts: Vector = charge * self.settings.volts_per_pc
        return volts

    def _due(self, end_s: float) -> tuple[Vector, Vector]:
        if self._next_row is None:
            return np.zeros(0), np.zeros(0)
        rate_hz = self.settings.rate_hz
        after = math.floor(self.device_s(end_s) * rate_hz) + 1
        device_s = np.arange(self._next_row, max(after, self._next_row)) / rate_hz
        self._next_row = max(after, self._next_row)
        times = self._switched_on_s + (device_s - self._truth.clock_offset_s) / self._rate
        return np.clip(times, self.time_s, end_s), device_s

    def _convert(self, volts: Vector) -> NDArray[np.int16]:
        scale = 2 ** (self.settings.bits - 1)
        noise = self._truth.noise_v * self._random.standard_normal(volts.shape)
        counts = np.rint((volts + noise) * (scale / FULL_SCALE_V))
        clipped: NDArray[np.int16] = np.clip(counts, -scale, scale - 1).astype(np.int16)
        return clipped

    def _set_filter(self) -> None:
        settings = self.settings
        poles, residues, weights = butterworth_poles(settings.low_pass_order, settings.low_pass_hz)
        state = np.zeros((len(poles), CHANNELS), dtype=np.complex128)
        self._filter = _LowPass(poles, residues / poles, weights, state)

    def _settle(self, volts: Vector) -> None:
        """Put the filter where a constant input of (8,) volts leaves it."""
        self._filter.state[:] = -self._filter.gains[:, np.newaxis] * volts


def _at_limit(volts: Vector) -> NDArray[np.bool_]:
    return np.abs(volts) >= FULL_SCALE_V


def _shares_of(duration_s: float) -> Vector:
    """Return where steps of at most `LONGEST_STEP_S` end, as shares of a duration."""
    steps = max(1, math.ceil(duration_s / LONGEST_STEP_S - 1e-9))
    return np.arange(1, steps + 1) / steps


class _LowPass(NamedTuple):
    """The filter of all channels: poles, residues over poles, output weights; state (p, 8)."""

    poles: ComplexVector
    gains: ComplexVector
    weights: Vector
    state: ComplexVector


class _Rows(NamedTuple):
    """When to look at the output, in order, and what is seen: (rows,), (rows, 8), (rows,)."""

    time_s: Vector
    output: Vector
    overload: NDArray[np.uint8]


@njit(cache=True)
def _run_filter(
    start_s: float,
    ends_s: Vector,
    volts: Vector,
    low_pass: _LowPass,
    rows: _Rows,
    latched: int,
) -> int:
    """Filter inputs that are constant over intervals; look at the output at every row's time.

    Args:
        start_s, ends_s: Scalar, (m,). When the first interval begins, and when each ends [s].
        volts: Shape (m, 8). Input before the charge stage's limits.
        low_pass: The filter; its state is changed in place.
        rows: Filled; their times lie within the intervals.
        latched: The overload word at the beginning.

    Returns:
        The overload word at the end.
    """
    poles, gains, weights, state = low_pass
    row_times, output, overload = rows
    channels = volts.shape[1]
    limited = np.empty(channels)
    now_s = start_s
    row = 0
    for interval in range(len(ends_s)):
        for channel in range(channels):
            volt = volts[interval, channel]
            if abs(volt) >= FULL_SCALE_V:
                latched |= 1 << channel
                volt = math.copysign(FULL_SCALE_V, volt)
            limited[channel] = volt
        while True:
            to_row = row < len(row_times) and row_times[row] <= ends_s[interval]
            until_s = row_times[row] if to_row else ends_s[interval]
            if until_s > now_s:
                for pole in range(len(poles)):
                    decay = np.exp(poles[pole] * (until_s - now_s))
                    into = gains[pole] * (decay - 1.0)
                    for channel in range(channels):
                        state[pole, channel] = (
                            decay * state[pole, channel] + into * limited[channel]
                        )
                now_s = until_s
            if not to_row:
                break
            for channel in range(channels):
                volt = 0.0
                for pole in range(len(poles)):
                    volt += weights[pole] * state[pole, channel].real
                output[row, channel] = volt
            overload[row] = latched
            row += 1
    return latched
