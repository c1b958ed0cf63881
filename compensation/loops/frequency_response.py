"""`FrequencyResponse`: the best linear approximation of one part of a drive's cascade.

The measurement is in closed loop. Input and output therefore contain the same noise, and their
plain ratio is biased. The multisine is known and free of noise, so both signals are referred to it
in each realisation (Pintelon and Schoukens 2012, chapter 7; theory: section 13).
- Differences between periods are noise.
- Differences between realisations that noise does not explain are nonlinear distortion.
- Output at lines that were not excited is also distortion, unless input at these lines explains it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.recording.recording import Recording
from compensation.loops.multisine_spectra import MultisineSpectra, multisine_spectra
from config.arrays import BoolArray, FloatArray, read_only
from config.errors import DataQualityError
from config.robot.robot import RobotDescription

if TYPE_CHECKING:
    import control

Complex = NDArray[np.complex128]

ONE_REALISATION: Final = "RID-LOOP-ONE-REALISATION"


@dataclass(frozen=True, eq=False)
class Distortion:
    """Output at lines that no joint excites.

    Levels are the RMS over realisations of the mean over periods. Input at these lines causes
    output through the linear response; the remaining output is the distortion.

    Attributes:
        frequency_hz: Shape (lines,). Frequencies [Hz].
        output: Shape (lines,). Amplitude of the output, in its unit.
        level: Shape (lines,). Output that the linear response does not explain, divided by the
            input at the neighbouring excited lines; in the unit of the response.
        noise: Shape (lines,). Value that `level` would have if there were only noise.
    """

    frequency_hz: FloatArray
    output: FloatArray
    level: FloatArray
    noise: FloatArray

    def __post_init__(self) -> None:
        frequency = read_only("frequency_hz", self.frequency_hz, float, (None,), DataQualityError)
        object.__setattr__(self, "frequency_hz", frequency)
        for name in ("output", "level", "noise"):
            values = read_only(name, getattr(self, name), float, frequency.shape, DataQualityError)
            object.__setattr__(self, name, values)


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Best linear approximation from input to output, for one joint.

    Attributes:
        joint_name: The joint; with a coupled wrist, the motor with the joint's number.
        frequency_hz: Shape (lines,). Excited lines [Hz].
        response: Shape (lines,). Output over input.
        variance_noise: Shape (lines,). Variance E|dG|^2 of the response due to noise, from the
            differences between periods.
        variance: Shape (lines,). Total variance of the response: `variance_noise` times a factor
            for distortion. With several realisations, the factor comes from their differences at
            all lines; with one realisation, from the odd lines that the multisine leaves empty.
        coherence: Shape (lines,). Coherence of multisine and output over all periods, 0 to 1.
        even, odd: Distortion at even lines, and at odd lines that the multisine leaves empty.
        realisations, periods: Numbers of averaged realisations and periods.
    """

    joint_name: str
    frequency_hz: FloatArray
    response: Complex
    variance_noise: FloatArray
    variance: FloatArray
    coherence: FloatArray
    even: Distortion
    odd: Distortion
    realisations: int
    periods: int

    def __post_init__(self) -> None:
        frequency = read_only("frequency_hz", self.frequency_hz, float, (None,), DataQualityError)
        shape = frequency.shape
        response = read_only("response", self.response, complex, shape, DataQualityError)
        object.__setattr__(self, "frequency_hz", frequency)
        object.__setattr__(self, "response", response)
        for name in ("variance_noise", "variance", "coherence"):
            values = read_only(name, getattr(self, name), float, shape, DataQualityError)
            object.__setattr__(self, name, values)

    @property
    def noise_freedom(self) -> int:
        """Complex degrees of freedom of each line's noise variance."""
        return self.realisations * (self.periods - 1)

    @property
    def frd(self) -> control.FrequencyResponseData:
        """The response as a python-control frequency response, over rad/s."""
        import control

        return control.FRD(self.response, 2.0 * math.pi * self.frequency_hz)


def frequency_responses(
    recording: Recording, motion: MultisineMotion, robot: RobotDescription
) -> tuple[FrequencyResponse, ...]:
    """Return the velocity controllers' responses of a multisine run.

    Parameters are those of `multisine_spectra`, units those of `controller_responses`; the errors
    are those of both.
    """
    return controller_responses(multisine_spectra(recording, motion, robot))


def controller_responses(spectra: MultisineSpectra) -> tuple[FrequencyResponse, ...]:
    """Return torque over velocity error of each excited joint's velocity controller.

    Args:
        spectra: Spectra of a multisine run.

    Returns:
        Responses in N m s/rad or N s/m.

    Raises:
        DataQualityError: There is one realisation, and it has no empty odd lines, or a signal is 0.
    """
    return _responses(spectra, spectra.error, spectra.torque)


def mechanics_responses(spectra: MultisineSpectra) -> tuple[FrequencyResponse, ...]:
    """Return velocity over motor torque of each excited joint, with the other joints controlled.

    Args:
        spectra: Spectra of a multisine run.

    Returns:
        Responses in rad/(N m s) or m/(N s).

    Raises:
        DataQualityError: There is one realisation, and it has no empty odd lines, or a signal is 0.
    """
    return _responses(spectra, spectra.torque, spectra.velocity)


def _responses(
    spectra: MultisineSpectra, inputs: Complex, outputs: Complex
) -> tuple[FrequencyResponse, ...]:
    return tuple(
        _response(spectra, j, (inputs[..., j], outputs[..., j]))
        for j in range(len(spectra.joint_names))
        if len(spectra.lines[j])
    )


def _response(
    spectra: MultisineSpectra, joint: int, both: tuple[Complex, Complex]
) -> FrequencyResponse:
    lines, reference = spectra.lines[joint], spectra.reference[joint]
    inputs, outputs = both
    realisations, periods = outputs.shape[:2]
    # Both signals divided by the multisine, shape (realisations, periods, lines).
    x, y = (values[:, :, lines] / reference[:, np.newaxis, :] for values in both)
    mean_x, mean_y = x.mean(axis=(0, 1)), y.mean(axis=(0, 1))
    if not (mean_x.all() and mean_y.all()):
        raise DataQualityError(
            f"joint {spectra.joint_names[joint]}: its torque or its velocity is 0 at"
            f" {np.count_nonzero(mean_x * mean_y == 0.0)} of {len(lines)} excited lines: check that"
            " the joint moves, and the column of its torque",
            code="RID-LOOP-WEAK",
        )
    response = mean_y / mean_x
    misfit = y - response * x
    by_realisation = misfit.mean(axis=1)
    size = np.abs(mean_x) ** 2
    scatter = np.sum(np.abs(misfit - by_realisation[:, np.newaxis]) ** 2, axis=(0, 1))
    freedom = realisations * (periods - 1)
    noise = scatter / freedom / (realisations * periods) / size
    power = np.mean(np.abs(y) ** 2, axis=(0, 1))
    frequency_hz = spectra.frequency_hz
    every = np.concatenate(spectra.lines)
    between = np.arange(max(2, lines[0]), lines[-1] + 1)
    empty = np.setdiff1d(between, every)
    # Response and input at the empty lines, interpolated between the excited lines.
    where, at = frequency_hz[lines], frequency_hz[empty]
    amplitude = np.exp(np.interp(at, where, np.log(np.abs(response))))
    angle = np.interp(at, where, np.unwrap(np.angle(response)))
    strength = np.sqrt(np.mean(np.abs(inputs[:, :, lines].mean(axis=1)) ** 2, axis=0))
    beside = np.exp(np.interp(at, where, np.log(strength)))
    unexplained = outputs[:, :, empty] - amplitude * np.exp(1j * angle) * inputs[:, :, empty]

    def distortion(chosen: BoolArray) -> Distortion:
        own = unexplained[:, :, chosen]
        mean = own.mean(axis=1)
        squares = np.sum(np.abs(own - mean[:, np.newaxis]) ** 2, axis=1) / (periods - 1)
        output = outputs[:, :, empty[chosen]].mean(axis=1)
        return Distortion(
            frequency_hz=at[chosen],
            output=np.asarray(np.sqrt(np.mean(np.abs(output) ** 2, axis=0))),
            level=np.asarray(np.sqrt(np.mean(np.abs(mean) ** 2, axis=0)) / beside[chosen]),
            noise=np.asarray(np.sqrt(np.mean(squares, axis=0) / periods) / beside[chosen]),
        )

    even, odd = distortion(empty % 2 == 0), distortion(empty % 2 == 1)
    if realisations > 1:
        squares = np.sum(np.abs(by_realisation) ** 2, axis=0)
        total = squares / (realisations - 1) / realisations / size
        # The scatter of one line over a few realisations is uncertain: all lines are pooled.
        # The mean of a ratio of two variances of pure noise is freedom / (freedom - 1), not 1.
        unbiased = (freedom - 1) / freedom if freedom > 1 else 1.0
        more = unbiased * float(np.mean(total / noise))
    else:
        more = _distortion_factor(spectra.joint_names[joint], odd)
    return FrequencyResponse(
        joint_name=spectra.joint_names[joint],
        frequency_hz=where,
        response=response,
        variance_noise=noise,
        variance=max(1.0, more) * noise,
        coherence=np.minimum(np.abs(mean_y) ** 2 / power, 1.0),
        even=even,
        odd=odd,
        realisations=realisations,
        periods=periods,
    )


def _distortion_factor(joint_name: str, odd: Distortion) -> float:
    """Return the factor by which distortion enlarges the noise variance of one realisation.

    Odd lines that are not excited show the distortion that excited odd lines hide (Pintelon and
    Schoukens 2012, section 4.3).

    Raises:
        DataQualityError: No odd line was left empty.
    """
    if not len(odd.level):
        raise DataQualityError(
            f"joint {joint_name}: one realisation without empty odd lines does not show the error"
            " that distortion causes in the response: design the multisine with --grid"
            " random_odd, or with at least two realisations",
            code=ONE_REALISATION,
        )
    return float(np.mean(odd.level**2) / np.mean(odd.noise**2))
