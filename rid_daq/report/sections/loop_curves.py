"""Curves of a drive's loops: frequency responses with errors, and open loops with margins."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from config.arrays import FloatArray
from rid_daq.report.sections.section import Numbers, Section, round_values

if TYPE_CHECKING:
    from compensation.loops.cascade import Cascade
    from compensation.loops.frequency_response import Distortion, FrequencyResponse
    from compensation.loops.velocity_loop import VelocityLoop

FIT_POINTS = 200
CASCADE_POINTS = 300
LOWEST_HZ = 0.2
HIGHEST_HZ = 50.0


class Polar(Section):
    """A frequency response, as magnitude and phase.

    Attributes:
        frequency_hz: Frequencies [Hz].
        magnitude: Magnitude at each frequency.
        phase_deg: Phase at each frequency [degrees]; the first value is between -360 and 0.
    """

    frequency_hz: Numbers
    magnitude: Numbers
    phase_deg: Numbers


class DistortionSection(Section):
    """Nonlinear distortion at frequency lines that the multisine does not excite.

    Attributes:
        frequency_hz: The lines [Hz].
        output: Amplitude of the torque at each line.
        level: Part of the torque that the linear response does not explain, divided by the velocity
            error at the neighbouring excited lines.
        noise: The value that `level` would have because of noise alone.
    """

    frequency_hz: Numbers
    output: Numbers
    level: Numbers
    noise: Numbers

    @classmethod
    def of(cls, found: Distortion) -> DistortionSection:
        """Return the distortion at even or odd lines."""
        return cls(**{name: round_values(getattr(found, name)) for name in cls.model_fields})


class ControllerResponse(Polar):
    """Frequency response of a velocity controller, with its errors, distortion and fit.

    Attributes:
        std_noise: Standard deviation of the response due to noise alone, at each frequency.
        std_total: Standard deviation of the response due to noise and distortion, at each
            frequency.
        coherence: Coherence at each frequency.
        even: Distortion at even lines.
        odd: Distortion at odd lines.
        fit: Response of the fitted controller.
    """

    std_noise: Numbers
    std_total: Numbers
    coherence: Numbers
    even: DistortionSection
    odd: DistortionSection
    fit: Polar

    @classmethod
    def of(cls, measured: FrequencyResponse, loop: VelocityLoop) -> ControllerResponse:
        """Return the measured response of a controller, with the fitted response."""
        f = measured.frequency_hz
        grid = np.geomspace(f[0], f[-1], FIT_POINTS)
        magnitude, phase_deg = _polar(measured.response)
        fitted, fitted_deg = _polar(loop.response(grid))
        return cls(
            frequency_hz=tuple(f.tolist()),
            magnitude=magnitude,
            phase_deg=phase_deg,
            std_noise=round_values(np.sqrt(measured.variance_noise)),
            std_total=round_values(np.sqrt(measured.variance)),
            coherence=round_values(measured.coherence),
            even=DistortionSection.of(measured.even),
            odd=DistortionSection.of(measured.odd),
            fit=Polar(frequency_hz=round_values(grid), magnitude=fitted, phase_deg=fitted_deg),
        )


class MechanicsResponse(Polar):
    """Frequency response of an axis, velocity over torque.

    Attributes:
        std_total: Standard deviation of the response, at each frequency.
        coherence: Coherence at each frequency.
    """

    std_total: Numbers
    coherence: Numbers

    @classmethod
    def of(cls, measured: FrequencyResponse) -> MechanicsResponse:
        """Return the measured response of an axis."""
        magnitude, phase_deg = _polar(measured.response)
        return cls(
            frequency_hz=tuple(measured.frequency_hz.tolist()),
            magnitude=magnitude,
            phase_deg=phase_deg,
            std_total=round_values(np.sqrt(measured.variance)),
            coherence=round_values(measured.coherence),
        )


class LoopMargins(Section):
    """Stability margins of an open loop, at the most critical crossover if there are several.

    Attributes:
        gain: Factor by which the loop's gain can grow before the loop is unstable; below 1 if it is
            unstable already; null if no gain makes it unstable.
        gain_db: The same factor in decibels; null if `gain` is null.
        phase_deg: Phase that the loop can lose before it is unstable [degrees]; null if the loop's
            gain is nowhere 1.
        crossover_hz: Frequency at which the loop's gain is 1 [Hz]; null if there is none.
        phase_crossover_hz: Frequency at which the loop's phase is -180 degrees [Hz]; null if there
            is none.
    """

    gain: float | None
    phase_deg: float | None
    crossover_hz: float | None
    phase_crossover_hz: float | None
    gain_db: float | None

    @property
    def words(self) -> tuple[str, str]:
        """Phase margin and gain margin as texts."""
        phase, gain = self.phase_deg, self.gain_db
        return (
            "no crossover" if phase is None else f"{phase:.0f}° at {self.crossover_hz:.2g} Hz",
            "any gain" if gain is None else f"{gain:.1f} dB",
        )


class OpenLoop(Section):
    """Frequency response of an open loop, with its margins.

    Attributes:
        magnitude: Magnitude at each frequency of the cascade.
        phase_deg: Phase at each frequency of the cascade [degrees].
        margins: The margins.
    """

    magnitude: Numbers
    phase_deg: Numbers
    margins: LoopMargins

    @classmethod
    def of(cls, response: np.ndarray[Any, Any], margins: LoopMargins) -> OpenLoop:
        """Return an open loop from its complex response."""
        magnitude, phase_deg = _polar(response)
        return cls(magnitude=magnitude, phase_deg=phase_deg, margins=margins)


class CascadeCurves(Section):
    """Open velocity loop and open position loop of an axis.

    Attributes:
        frequency_hz: Frequencies of the modelled loops [Hz].
        velocity: The modelled velocity loop.
        position: The modelled position loop.
        measured: The position loop, computed from measured responses.
    """

    frequency_hz: Numbers
    velocity: OpenLoop
    position: OpenLoop
    measured: Polar

    @classmethod
    def of(
        cls, controller: FrequencyResponse, mechanics: FrequencyResponse, cascade: Cascade
    ) -> CascadeCurves:
        """Return the curves of a cascade, from measured responses and the model."""
        highest = min(HIGHEST_HZ, 0.45 / cascade.cycle_time_s)
        grid = np.geomspace(LOWEST_HZ, highest, CASCADE_POINTS)
        f = controller.frequency_hz
        opened = controller.response * mechanics.response
        modelled = cascade.position_loop(f) / cascade.closed_velocity_loop(f)
        measured = modelled * opened / (1.0 + opened)
        shown = f <= highest
        magnitude, phase_deg = _polar(measured[shown])
        return cls(
            frequency_hz=round_values(grid),
            velocity=OpenLoop.of(
                cascade.velocity_loop(grid), LoopMargins.from_attributes(cascade.velocity_margins)
            ),
            position=OpenLoop.of(
                cascade.position_loop(grid), LoopMargins.from_attributes(cascade.position_margins)
            ),
            measured=Polar(
                frequency_hz=round_values(f[shown]), magnitude=magnitude, phase_deg=phase_deg
            ),
        )


def _polar(response: np.ndarray[Any, Any]) -> tuple[Numbers, Numbers]:
    """Return magnitude and phase of a response; the first phase is between -360 and 0 degrees."""
    phase: FloatArray = np.degrees(np.unwrap(np.angle(response)))
    phase = phase - 360.0 * np.ceil(phase[0] / 360.0 - 1e-9) if len(phase) else phase
    return round_values(np.abs(response), 6), round_values(phase)
