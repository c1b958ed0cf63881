"""`ChargeAmplifier`: physics of eight charge amplifiers with low-pass filter, converter and clock.

The state depends only on the calls and the times in their arguments. Equal calls with equal seeds
give equal converter counts.
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
"""Longest step of the simulation with constant charge, if the caller gives no loads [s]."""


@dataclass(frozen=True)
class AmplifierSettings:
    """Settings of an amplifier; the defaults are those after power-on.

    Attributes:
        range_n: Force at full scale, per channel [N].
        sensitivity_pc_n: Sensitivity of the sensor, per channel [pC/N].
        low_pass_hz: Cut-off frequency of the Butterworth filter before the converter [Hz].
        low_pass_order: Order of the Butterworth filter.
        rate_hz: Rows per second, on the amplifier's own clock.
        bits: Resolution of the converter, over negative to positive full scale [bit].
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
        """Output voltage per charge of each channel, (8,) [V/pC]: full scale at `range_n`."""
        gain: Vector = FULL_SCALE_V / (np.array(self.sensitivity_pc_n) * np.array(self.range_n))
        return gain


@dataclass(frozen=True, eq=False)
class AmplifierRows:
    """Rows that the converter has produced.

    Attributes:
        time_s: Shape (rows,). Times on the cell's clock [s].
        device_s: Shape (rows,). Times on the amplifier's clock [s].
        counts: Shape (rows, 8). Converter counts; full scale is 2 to the power of (bits - 1).
        overload: Shape (rows,). The overload word: bit i stays set after an overload of channel i +
            1, until it is read.
    """

    time_s: Vector
    device_s: Vector
    counts: NDArray[np.int16]
    overload: NDArray[np.uint8]


class ChargeAmplifier:
    """Eight channels with a common clock; after switch-on they are in the state Reset.

    Args:
        truth: True properties: drift, zero jump, noise and clock error.
        seed: Random seed of the noise.
        now_s: Switch-on time [s].

    Attributes:
        settings: Present settings; use `apply` to change them.
        time_s: Time up to which the amplifier has been advanced [s].
        operating: True if the amplifier measures; False in Reset, in which its inputs are shorted.
        overload: The overload word, whose bits stay set until it is read.
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
        self.convert(now_s)  # no duration: compiles the filter in advance

    @property
    def converting(self) -> bool:
        """True if the converter produces rows."""
        return self._next_row is not None

    def device_s(self, time_s: float) -> float:
        """Return the time on the amplifier's clock for a time on the cell's clock [s]."""
        return self._truth.clock_offset_s + self._rate * (time_s - self._switched_on_s)

    def apply(self, settings: AmplifierSettings) -> None:
        """Apply new settings; charges remain, and a new low-pass starts in its steady state."""
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
        """Start to measure; the present charges of the sensors, (8,) [pC], are the new zero."""
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
        """Return the overload word; clear the bits of channels that are no longer overloaded."""
        word, self.overload = self.overload, self._overloaded
        return word

    def start(self) -> None:
        """Start the converter: `rate_hz` rows per second of the amplifier's clock."""
        self._next_row = math.floor(self.device_s(self.time_s) * self.settings.rate_hz) + 1

    def stop(self) -> None:
        """Stop the converter."""
        self._next_row = None

    def present_counts(self) -> NDArray[np.int16]:
        """Return the counts of a single conversion at the present time, (8,), with noise."""
        counts: NDArray[np.int16] = self._convert(self._output_v[np.newaxis])[0]
        return counts

    def convert(
        self, end_s: float, ends_s: ArrayLike = (), charges_pc: ArrayLike = ()
    ) -> AmplifierRows:
        """Advance time to `end_s`; return the rows that the converter produced until then.

        Args:
            end_s: End time [s].
            ends_s: Shape (m,). End times of intervals with constant charge; each interval begins at
                the end of the previous one. The charge of the last interval also applies after its
                end.
            charges_pc: Shape (m, 8). Charges of the sensors in the intervals [pC].

        Raises:
            ValueError: `end_s` is before the present time.
        """
        if not end_s >= self.time_s:
            raise ValueError(f"end_s {end_s} is before the present time {self.time_s}")
        times = np.asarray(ends_s, dtype=np.float64)
        charges = np.asarray(charges_pc, dtype=np.float64).reshape(-1, CHANNELS)
        if len(charges):
            self._charge_pc = charges[-1]
        last_s = float(times[-1]) if len(times) else self.time_s
        if end_s > last_s:
            held = last_s + (end_s - last_s) * _step_ends(end_s - last_s)
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
        """Return the voltages of the charge stages in every interval, not yet limited, (m, 8)."""
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
        """Set the filter to its steady state for a constant input of (8,) volts."""
        self._filter.state[:] = -self._filter.gains[:, np.newaxis] * volts


def _at_limit(volts: Vector) -> NDArray[np.bool_]:
    return np.abs(volts) >= FULL_SCALE_V


def _step_ends(duration_s: float) -> Vector:
    """Divide a duration into steps of at most `LONGEST_STEP_S`; return their ends as fractions."""
    steps = max(1, math.ceil(duration_s / LONGEST_STEP_S - 1e-9))
    return np.arange(1, steps + 1) / steps


class _LowPass(NamedTuple):
    """Low-pass of all channels: poles, residues / poles, output weights, and states (poles, 8)."""

    poles: ComplexVector
    gains: ComplexVector
    weights: Vector
    state: ComplexVector


class _Rows(NamedTuple):
    """Sampling times in order, and the outputs and overload words at these times.

    The shapes are (rows,), (rows, 8) and (rows,).
    """

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
    """Filter inputs that are constant in each interval; sample the output at the rows' times.

    Args:
        start_s: Start of the first interval [s].
        ends_s: Shape (m,). Ends of the intervals [s].
        volts: Shape (m, 8). Inputs of the intervals [V], not yet limited to full scale.
        low_pass: The filter; its state is overwritten.
        rows: The sampling times, within the intervals; outputs and overload words are written into
            its arrays.
        latched: The overload word before the first interval.

    Returns:
        The overload word after the last interval.
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
