"""The curves of a drive's loops: responses with their errors, opened loops with their margins."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from config.arrays import FloatArray
from rid_daq.report.sections.section import Numbers, Section, rounded

if TYPE_CHECKING:
    from compensation.loops.cascade import Cascade
    from compensation.loops.frequency_response import Distortion, FrequencyResponse
    from compensation.loops.velocity_loop import VelocityLoop

FIT_POINTS = 200
CASCADE_POINTS = 300
LOWEST_HZ = 0.2
HIGHEST_HZ = 50.0


class Polar(Section):
    """A frequency response: magnitude, and phase between -360 and 0 degrees at its start.

    Attributes:
        frequency_hz, magnitude, phase_deg: One value a frequency.
    """

    frequency_hz: Numbers
    magnitude: Numbers
    phase_deg: Numbers


class DistortionSection(Section):
    """Distortion at lines that nobody excites, one value a line.

    Attributes:
        frequency_hz: The lines [Hz].
        output, level, noise: What the response does not explain there, over the velocity error
            beside it, and its noise.
    """

    frequency_hz: Numbers
    output: Numbers
    level: Numbers
    noise: Numbers

    @classmethod
    def of(cls, found: Distortion) -> DistortionSection:
        """Return the distortion of one kind of lines."""
        return cls(**{name: rounded(getattr(found, name)) for name in cls.model_fields})


class ControllerResponse(Polar):
    """A velocity controller's response with its errors, distortion, and what was fitted."""

    std_noise: Numbers
    std_total: Numbers
    coherence: Numbers
    even: DistortionSection
    odd: DistortionSection
    fit: Polar

    @classmethod
    def of(cls, measured: FrequencyResponse, loop: VelocityLoop) -> ControllerResponse:
        """Return what was measured of a controller."""
        f = measured.frequency_hz
        grid = np.geomspace(f[0], f[-1], FIT_POINTS)
        magnitude, phase_deg = _polar(measured.response)
        fitted, fitted_deg = _polar(loop.response(grid))
        return cls(
            frequency_hz=tuple(f.tolist()),
            magnitude=magnitude,
            phase_deg=phase_deg,
            std_noise=rounded(np.sqrt(measured.variance_noise)),
            std_total=rounded(np.sqrt(measured.variance)),
            coherence=rounded(measured.coherence),
            even=DistortionSection.of(measured.even),
            odd=DistortionSection.of(measured.odd),
            fit=Polar(frequency_hz=rounded(grid), magnitude=fitted, phase_deg=fitted_deg),
        )


class MechanicsResponse(Polar):
    """The response of an axis, velocity over torque, with its errors."""

    std_total: Numbers
    coherence: Numbers

    @classmethod
    def of(cls, measured: FrequencyResponse) -> MechanicsResponse:
        """Return what was measured of an axis."""
        magnitude, phase_deg = _polar(measured.response)
        return cls(
            frequency_hz=tuple(measured.frequency_hz.tolist()),
            magnitude=magnitude,
            phase_deg=phase_deg,
            std_total=rounded(np.sqrt(measured.variance)),
            coherence=rounded(measured.coherence),
        )


class LoopMargins(Section):
    """How far an open loop is from instability; None where there is no such crossing.

    Attributes:
        gain, gain_db: The factor by which its gain may grow, and the same in decibels.
        phase_deg: The phase that it may lose.
        crossover_hz, phase_crossover_hz: Where its gain is 1, and where its phase is -180 degrees.
    """

    gain: float | None
    phase_deg: float | None
    crossover_hz: float | None
    phase_crossover_hz: float | None
    gain_db: float | None

    @property
    def words(self) -> tuple[str, str]:
        """Phase and gain margin."""
        phase, gain = self.phase_deg, self.gain_db
        return (
            "no crossover" if phase is None else f"{phase:.0f}° at {self.crossover_hz:.2g} Hz",
            "any gain" if gain is None else f"{gain:.1f} dB",
        )


class OpenLoop(Section):
    """An opened loop over the cascade's frequencies, with its margins."""

    magnitude: Numbers
    phase_deg: Numbers
    margins: LoopMargins

    @classmethod
    def of(cls, response: np.ndarray[Any, Any], margins: LoopMargins) -> OpenLoop:
        """Return an opened loop."""
        magnitude, phase_deg = _polar(response)
        return cls(magnitude=magnitude, phase_deg=phase_deg, margins=margins)


class CascadeCurves(Section):
    """The opened velocity and position loop of an axis, modelled, and the latter as measured."""

    frequency_hz: Numbers
    velocity: OpenLoop
    position: OpenLoop
    measured: Polar

    @classmethod
    def of(
        cls, controller: FrequencyResponse, mechanics: FrequencyResponse, cascade: Cascade
    ) -> CascadeCurves:
        """Return what is drawn of a cascade."""
        highest = min(HIGHEST_HZ, 0.45 / cascade.cycle_time_s)
        grid = np.geomspace(LOWEST_HZ, highest, CASCADE_POINTS)
        f = controller.frequency_hz
        opened = controller.response * mechanics.response
        modelled = cascade.position_loop(f) / cascade.closed_velocity_loop(f)
        measured = modelled * opened / (1.0 + opened)
        shown = f <= highest
        magnitude, phase_deg = _polar(measured[shown])
        return cls(
            frequency_hz=rounded(grid),
            velocity=OpenLoop.of(
                cascade.velocity_loop(grid), LoopMargins.from_attributes(cascade.velocity_margins)
            ),
            position=OpenLoop.of(
                cascade.position_loop(grid), LoopMargins.from_attributes(cascade.position_margins)
            ),
            measured=Polar(
                frequency_hz=rounded(f[shown]), magnitude=magnitude, phase_deg=phase_deg
            ),
        )


def _polar(response: np.ndarray[Any, Any]) -> tuple[Numbers, Numbers]:
    """Return magnitude and phase, the phase between -360 and 0 degrees at its start."""
    phase: FloatArray = np.degrees(np.unwrap(np.angle(response)))
    phase = phase - 360.0 * np.ceil(phase[0] / 360.0 - 1e-9) if len(phase) else phase
    return rounded(np.abs(response), 6), rounded(phase)
