"""`MultisineSpectra`: what a multisine run holds at every line, period by period."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from acquisition.signals.bins import filter_response
from config.arrays import FloatArray, IntArray, PhaseArray
from config.cell.cell import ButterworthFilter
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class MultisineSpectra:
    """Amplitudes of the measured signals at the lines, a row a period; the motors' own signals.

    Attributes:
        joint_names: Base to flange.
        frequency_hz: Shape (lines,). Of every harmonic of the period, from 0.
        lines: The harmonics that each joint excites.
        reference: Tuple of ndarray of complex, shape (realisations, own lines). The multisines that
            were asked for [rad/s or m/s].
        torque, error, velocity: Shape (realisations, periods, lines, joints). Torque in front of
            its filter, velocity error of the drive, and velocity.
        cycle_time_s: Time between samples and between commands [s].
        torque_filter: The analog filter, already divided out of the torque.
        left_out: Realisations that are not in it, counted from 1: rows of them are missing.
    """

    joint_names: tuple[str, ...]
    frequency_hz: FloatArray
    lines: tuple[IntArray, ...]
    reference: tuple[Complex, ...]
    torque: Complex
    error: Complex
    velocity: Complex
    cycle_time_s: float
    torque_filter: ButterworthFilter | None
    left_out: tuple[int, ...]


def multisine_spectra(
    recording: Recording, motion: MultisineMotion, robot: RobotDescription
) -> MultisineSpectra:
    """Return the spectra of a multisine run.

    The anti-alias filter in front of the torques is divided out, and commands are taken as they
    reach the velocity loops (`interpolation_response`). With a coupled wrist everything is the
    motors', whose loops they are.

    Args:
        recording: Of that motion, by a cell. Realisations of which rows are missing are left out.

    Raises:
        DataQualityError: The recording is of another robot, holds no commands, or no whole
            realisation.
    """
    step_s, commands = recording.sample_period_s, recording.velocity_command
    if commands is None or step_s is None:
        raise DataQualityError(
            "the recording holds no velocity commands: frequency responses need one of this"
            " program's own",
            code="RID-RUN-FOREIGN",
        )
    if recording.joint_names != robot.joint_names:
        raise DataQualityError(
            f"the recording is of joints {', '.join(recording.joint_names)}, robot {robot.name!r}"
            f" has {', '.join(robot.joint_names)}",
            code="RID-ROBOT-OTHER",
        )
    starts = realisation_starts(recording, motion, robot)
    whole = sorted(starts)
    rows = round(motion.period_s / step_s)
    frequency_hz = np.arange(rows // 2 + 1) / motion.period_s
    coupling = WristCoupling.of_robot(robot)

    def spectra(values: FloatArray) -> Complex:
        """Return amplitudes, (realisations, periods, lines, joints)."""
        parts = np.array(
            [
                values[starts[k] : starts[k] + motion.periods * rows].reshape(
                    motion.periods, rows, -1
                )
                for k in whole
            ]
        )
        return np.asarray(2.0 / rows * np.fft.rfft(parts, axis=2))

    def of_motors(values: FloatArray) -> FloatArray:
        return values if coupling is None else coupling.to_motors(values)

    torque = spectra(recording.torque_nm)
    if recording.torque_filter is not None:
        torque = torque / filter_response(recording.torque_filter, frequency_hz)[:, np.newaxis]
    reach = interpolation_response(frequency_hz, step_s)[:, np.newaxis]
    turn = 2j * math.pi * frequency_hz[:, np.newaxis]
    velocity = turn * spectra(of_motors(recording.position))
    return MultisineSpectra(
        joint_names=robot.joint_names,
        frequency_hz=frequency_hz,
        lines=motion.excited_lines(robot),
        reference=tuple(phasors[whole] for phasors in motion.speed_phasors(robot)),
        torque=torque,
        error=reach * spectra(of_motors(commands)) - velocity,
        velocity=velocity,
        cycle_time_s=step_s,
        torque_filter=recording.torque_filter,
        left_out=tuple(k + 1 for k in range(motion.realisations) if k not in starts),
    )


def realisation_starts(
    recording: Recording, motion: MultisineMotion, robot: RobotDescription
) -> dict[int, int]:
    """Return the recording's row at which each whole realisation's counted periods start.

    Realisations count from 0; those of which rows are missing or not valid are left out.

    Raises:
        DataQualityError: None is whole.
    """
    assert recording.sample_period_s is not None
    length = motion.periods * round(motion.period_s / recording.sample_period_s)
    parts = _main_parts(recording.phase)
    numbers = list(range(len(parts)))
    if len(parts) != motion.realisations:
        # Some are missing altogether: where each stands in the motion tells which it is.
        planned = motion.plan(robot, recording.sample_period_s).phase
        expected = np.array([first for first, _ in _main_parts(planned)])
        indices = [int(recording.sample_index[first]) for first, _ in parts]
        numbers = [int(np.argmin(np.abs(expected - index))) for index in indices]
    found = {}
    for number, (first, end) in zip(numbers, parts, strict=True):
        index = recording.sample_index[first:end]
        whole = end - first == length and bool((np.diff(index) == 1).all())
        if whole and recording.valid[first:end].all():
            found[number] = first
    if not found:
        raise DataQualityError(
            f"the recording holds none of the multisine's {motion.realisations} realisations with"
            " all its rows: record it again",
            code="RID-RECORDING-ROWS-LOST",
        )
    return found


def _main_parts(phase: PhaseArray) -> list[tuple[int, int]]:
    """Return first row and end of every stretch that counts."""
    main = np.concatenate([[0], (phase == Phase.MAIN).astype(int), [0]])
    edges = np.flatnonzero(np.diff(main)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def interpolation_response(frequency_hz: FloatArray, cycle_time_s: float) -> Complex:
    """Return how commands that are sent once a cycle reach the velocity loop.

    What is sent in cycle k acts from SYNC k+1 on, and the drive goes to it linearly within that
    cycle: a triangle two cycles wide, two cycles late.

    Args:
        frequency_hz: Shape (lines,). Where.
        cycle_time_s: The cycle [s].
    """
    late = np.exp(-2j * math.pi * frequency_hz * 2.0 * cycle_time_s)
    bent = np.sinc(frequency_hz * cycle_time_s) ** 2
    return np.asarray(bent * late, dtype=complex)
