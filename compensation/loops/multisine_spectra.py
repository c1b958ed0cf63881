"""`MultisineSpectra`: amplitudes of a multisine run at each line, per period."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.processing.realisations import realisation_starts
from acquisition.recording.recording import Recording
from acquisition.signals.bins import filter_response
from config.arrays import FloatArray, IntArray
from config.cell.torque_filter import ButterworthFilter
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class MultisineSpectra:
    """Amplitudes of the measured motor signals at the lines, one row per period.

    Attributes:
        joint_names: Base to flange.
        frequency_hz: Shape (lines,). All harmonics of the period, from 0 [Hz].
        lines: For each joint, the numbers of the harmonics that it excites.
        reference: One complex array per joint, shape (realisations, lines of the joint). Amplitudes
            of the desired multisine [rad/s or m/s].
        torque, error, velocity: Shape (realisations, periods, lines, joints). Torque without the
            effect of its filter, velocity error of the drive, and velocity.
        cycle_time_s: Time between samples and between commands [s].
        torque_filter: Analog filter; its effect is already removed from the torque.
        left_out: Numbers of the realisations that are not included because rows are missing; the
            first is 1.
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

    The effect of the anti-alias filter is removed from the torques, and commands are converted to
    those that reach the velocity loops (`interpolation_response`). With a coupled wrist all signals
    are those of the motors, to which the loops belong.

    Args:
        recording: A run of this motion, recorded by a cell. Realisations with missing rows are left
            out.

    Raises:
        DataQualityError: The recording belongs to another robot, has no commands, or has no
            complete realisation.
    """
    step_s, commands = recording.sample_period_s, recording.velocity_command
    if commands is None or step_s is None:
        raise DataQualityError(
            "the recording has no velocity commands, or no uniform time stamps: use a run that"
            " rid-daq has recorded",
            code="RID-RUN-FOREIGN",
        )
    if recording.joint_names != robot.joint_names:
        raise DataQualityError(
            f"the recording has the joints {', '.join(recording.joint_names)}, robot"
            f" {robot.name!r} has {', '.join(robot.joint_names)}: use a recording of this robot",
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


def interpolation_response(frequency_hz: FloatArray, cycle_time_s: float) -> Complex:
    """Return the frequency response from commands, sent once per cycle, to the velocity loop.

    A command sent in cycle k acts from SYNC k+1 on, and the drive approaches it linearly within
    that cycle. The impulse response is therefore a triangle that is two cycles wide and delayed by
    two cycles.

    Args:
        frequency_hz: Shape (lines,). Frequencies [Hz].
        cycle_time_s: Cycle time [s].
    """
    late = np.exp(-2j * math.pi * frequency_hz * 2.0 * cycle_time_s)
    bent = np.sinc(frequency_hz * cycle_time_s) ** 2
    return np.asarray(bent * late, dtype=complex)
