"""`FrequencyResponse`: how a velocity controller's torque answers its velocity error.

The controller works in a closed loop, so torque and velocity error both hold the loop's noise, and
their plain ratio is biased. The multisine is what they have in common and the noise has not: both
are referred to it, realisation by realisation (Pintelon and Schoukens 2012, chapter 7; physics:
section 13). What differs between periods is noise, what differs between realisations more than that
is nonlinear distortion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import control
import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import FloatArray, IntArray, read_only
from acquisition.motion_samples import Phase
from acquisition.multisine import excited_lines, speed_phasors
from acquisition.recording import Recording
from acquisition.spectrum import filter_response
from config.errors import DataQualityError
from config.motion import MultisineMotion
from config.robot import RobotDescription

Complex = NDArray[np.complex128]

FEWEST_PERIODS: Final = 2


@dataclass(frozen=True, eq=False)
class Distortion:
    """The torque at lines that no joint excites.

    Attributes
    ----------
    frequency_hz : ndarray, shape (lines,)
        Where.
    level_nm, noise_nm : ndarray, shape (lines,)
        RMS over realisations of the amplitude that repeats in every period, and what noise alone
        would leave of it.
    """

    frequency_hz: FloatArray
    level_nm: FloatArray
    noise_nm: FloatArray


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """The best linear approximation of one velocity controller, from error to torque.

    Attributes
    ----------
    joint_name : str
        The joint.
    frequency_hz : ndarray, shape (lines,)
        Excited lines.
    response : ndarray of complex, shape (lines,)
        Torque over velocity error [N m s/rad or N s/m].
    variance_noise, variance : ndarray, shape (lines,)
        Of the response, E|dG|^2: by noise between periods, and in all, larger by what realisations
        differ more than that, over all lines.
    coherence : ndarray, shape (lines,)
        Between the multisine and the torque, over all periods, 0 to 1.
    even, odd : Distortion
        Torque at even lines, and at odd lines left empty.
    realisations, periods : int
        What was averaged.
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
    def frd(self) -> control.FrequencyResponseData:
        """The response as python-control's object, over rad/s."""
        return control.FRD(self.response, 2.0 * math.pi * self.frequency_hz)


def interpolation_response(frequency_hz: FloatArray, cycle_time_s: float) -> Complex:
    """Return how commands that are sent once a cycle reach the velocity loop.

    What is sent in cycle k acts from SYNC k+1 on, and the drive goes to it linearly within that
    cycle: a triangle two cycles wide, two cycles late.

    Parameters
    ----------
    frequency_hz : ndarray, shape (lines,)
        Where.
    cycle_time_s : float
        The cycle [s].
    """
    late = np.exp(-2j * math.pi * frequency_hz * 2.0 * cycle_time_s)
    bent = np.sinc(frequency_hz * cycle_time_s) ** 2
    return np.asarray(bent * late, dtype=complex)


def frequency_responses(
    recording: Recording, motion: MultisineMotion, robot: RobotDescription
) -> tuple[FrequencyResponse, ...]:
    """Return the response of each joint that the motion excites.

    The anti-alias filter in front of the torques is divided out, and commands are taken as they
    reach the velocity loops (`interpolation_response`).

    Parameters
    ----------
    recording : Recording
        Of that motion, by a cell.
    motion : MultisineMotion
        The motion.
    robot : RobotDescription
        The robot.

    Raises
    ------
    DataQualityError
        The recording holds no commands, or less than one whole realisation.
    """
    step_s, commands = recording.sample_period_s, recording.velocity_command
    if commands is None or step_s is None:
        raise DataQualityError(
            "the recording holds no velocity commands: frequency responses need one of this"
            " program's own"
        )
    rows = round(motion.period_s / step_s)
    starts = realisation_starts(recording, motion, rows)
    bins = rows // 2
    frequency_hz = np.arange(bins + 1) / motion.period_s
    turn = 2j * math.pi * frequency_hz[:, np.newaxis]

    def spectra(values: FloatArray) -> Complex:
        """Return amplitudes, (realisations, periods, bins, n)."""
        parts = np.array(
            [
                values[start : start + motion.periods * rows].reshape(motion.periods, rows, -1)
                for start in starts
            ]
        )
        return np.asarray(2.0 / rows * np.fft.rfft(parts, axis=2)[:, :, : bins + 1])

    torque = spectra(recording.torque_nm)
    if recording.torque_filter is not None:
        passed = filter_response(recording.torque_filter, frequency_hz)
        torque = torque / np.where(np.abs(passed) > 1e-3, passed, np.inf)[:, np.newaxis]
    reach = interpolation_response(frequency_hz, step_s)[:, np.newaxis]
    error = reach * spectra(commands) - turn * spectra(recording.position)
    lines, phasors = excited_lines(motion, robot), speed_phasors(motion, robot)
    every = np.concatenate(lines)
    return tuple(
        _response(
            joint.name,
            frequency_hz,
            lines[j],
            every,
            phasors[j][: len(starts)],
            (torque[..., j], error[..., j]),
        )
        for j, joint in enumerate(robot.joints)
        if len(lines[j])
    )


def realisation_starts(recording: Recording, motion: MultisineMotion, rows: int) -> list[int]:
    """Return the row at which each whole realisation's counted periods start.

    Raises
    ------
    DataQualityError
        There is none, or rows of one are missing or not valid.
    """
    main = recording.phase == Phase.MAIN
    edges = np.flatnonzero(np.diff(np.concatenate([[0], main.astype(int), [0]])))
    length = motion.periods * rows
    starts = [int(a) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a == length]
    if not starts or len(starts) > motion.realisations:
        raise DataQualityError(
            f"the recording holds {len(starts)} whole realisations of the multisine, its motion"
            f" file says {motion.realisations}: record it again"
        )
    for number, start in enumerate(starts):
        part = slice(start, start + length)
        index = recording.sample_index[part]
        if not recording.valid[part].all() or (np.diff(index) != 1).any():
            raise DataQualityError(
                f"realisation {number + 1} of the multisine misses rows: record it again"
            )
    return starts


def _response(
    name: str,
    frequency_hz: FloatArray,
    lines: IntArray,
    every: IntArray,
    reference: Complex,
    spectra: tuple[Complex, Complex],
) -> FrequencyResponse:
    torque, error = spectra
    realisations, periods = torque.shape[:2]
    # Referred to the multisine, (realisations, periods, lines).
    y, e = (values[:, :, lines] / reference[:, np.newaxis, :] for values in (torque, error))
    mean_y, mean_e = y.mean(axis=(0, 1)), e.mean(axis=(0, 1))
    response = mean_y / mean_e
    misfit = y - response * e
    by_realisation = misfit.mean(axis=1)
    size = np.abs(mean_e) ** 2
    scatter = np.sum(np.abs(misfit - by_realisation[:, np.newaxis]) ** 2, axis=(0, 1))
    noise = scatter / (realisations * (periods - 1)) / (realisations * periods) / size
    more = 1.0
    if realisations > 1:
        apart = np.sum(np.abs(by_realisation) ** 2, axis=0)
        total = apart / (realisations - 1) / realisations / size
        # A line's own scatter over a few realisations says little: all lines together say more.
        more = max(1.0, float(np.mean(total / noise)))
    power = np.mean(np.abs(y) ** 2, axis=(0, 1))
    beyond = np.arange(1, len(frequency_hz))
    beyond = beyond[(beyond >= 2) & (beyond <= every.max())]
    return FrequencyResponse(
        joint_name=name,
        frequency_hz=frequency_hz[lines],
        response=response,
        variance_noise=noise,
        variance=more * noise,
        coherence=np.minimum(np.abs(mean_y) ** 2 / power, 1.0),
        even=_distortion(frequency_hz, torque, beyond[beyond % 2 == 0]),
        odd=_distortion(frequency_hz, torque, np.setdiff1d(beyond[beyond % 2 == 1], every)),
        realisations=realisations,
        periods=periods,
    )


def _distortion(frequency_hz: FloatArray, torque: Complex, lines: IntArray) -> Distortion:
    own = torque[:, :, lines]
    mean = own.mean(axis=1)
    periods = own.shape[1]
    scatter = np.sum(np.abs(own - mean[:, np.newaxis]) ** 2, axis=1) / (periods - 1)
    return Distortion(
        frequency_hz=frequency_hz[lines],
        level_nm=np.asarray(np.sqrt(np.mean(np.abs(mean) ** 2, axis=0))),
        noise_nm=np.asarray(np.sqrt(np.mean(scatter, axis=0) / periods)),
    )
