"""`MultisineSpectra`: amplitudes of a multisine run at each harmonic, per period."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.maps.command_timing import CommandTiming
from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.processing.realisations import realisation_starts
from acquisition.recording.recording import Recording
from acquisition.signals.bins import filter_response
from config.arrays import FloatArray, IntArray
from config.cell.torque_filter import ButterworthFilter
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import convert_to_motors

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class MultisineSpectra:
    """Amplitudes of the measured motor signals at the harmonics, one row per period.

    Attributes:
        joint_names: Base to flange.
        frequency_hz: Shape (harmonics,). All harmonics of the period, from 0 [Hz].
        lines: For each joint, the numbers of the harmonics that it excites.
        reference: One complex array per joint, shape (realisations, lines of the joint). Amplitudes
            of the desired multisine [rad/s or m/s].
        torque, error, velocity: Shape (realisations, periods, harmonics, joints). Torque without
            the effect of its filter [N m or N], velocity error of the drive, and velocity [rad/s or
            m/s].
        cycle_time_s: Time between samples and between commands [s].
        timing: Time at which the drives use the commands.
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
    timing: CommandTiming
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
    step_s = require_commands(recording, robot)
    starts = realisation_starts(recording, motion, robot)
    whole = sorted(starts)
    rows = round(motion.period_s / step_s)
    timing = cell_timing(step_s)
    parts = [slice(starts[k], starts[k] + motion.periods * rows) for k in whole]
    torque, error, velocity = motor_spectra(recording, robot, parts, rows, timing)
    return MultisineSpectra(
        joint_names=robot.joint_names,
        frequency_hz=np.arange(rows // 2 + 1) / motion.period_s,
        lines=motion.excited_lines(robot),
        reference=tuple(phasors[whole] for phasors in motion.speed_phasors(robot)),
        torque=torque,
        error=error,
        velocity=velocity,
        cycle_time_s=step_s,
        timing=timing,
        torque_filter=recording.torque_filter,
        left_out=tuple(k + 1 for k in range(motion.realisations) if k not in starts),
    )


def require_commands(recording: Recording, robot: RobotDescription) -> float:
    """Return the sample period of a recording with velocity commands [s].

    Raises:
        DataQualityError: The recording belongs to another robot, or has no commands or no uniform
            time stamps.
    """
    step_s = recording.sample_period_s
    if recording.velocity_command is None or step_s is None:
        raise DataQualityError(
            "the recording has no velocity commands, or no uniform time stamps: use a run that"
            " rid-daq has recorded, or an import whose map has velocity_command and period_s",
            code="RID-RUN-FOREIGN",
        )
    if recording.joint_names != robot.joint_names:
        raise DataQualityError(
            f"the recording has the joints {', '.join(recording.joint_names)}, robot"
            f" {robot.name!r} has {', '.join(robot.joint_names)}: use a recording of this robot",
            code="RID-ROBOT-OTHER",
        )
    return step_s


def motor_spectra(
    recording: Recording,
    robot: RobotDescription,
    parts: Sequence[slice],
    rows: int,
    timing: CommandTiming,
) -> tuple[Complex, Complex, Complex]:
    """Return torque, velocity error and velocity of the motors at the harmonics of a period.

    The torque is without the effect of its filter.

    Args:
        recording: A recording with velocity commands and uniform time stamps.
        robot: The robot, for its coupling.
        parts: Rows of each realisation, whole periods.
        rows: Number of rows of a period.
        timing: Time at which the drives use the commands.

    Returns:
        Amplitudes, shape (realisations, periods, rows // 2 + 1, joints).
    """
    step_s, commands = recording.sample_period_s, recording.velocity_command
    assert step_s is not None
    assert commands is not None
    frequency_hz = np.arange(rows // 2 + 1) / (rows * step_s)

    def spectra(values: FloatArray) -> Complex:
        cut = np.array([values[part].reshape(-1, rows, values.shape[1]) for part in parts])
        return np.asarray(2.0 / rows * np.fft.rfft(cut, axis=2))

    torque = spectra(recording.torque_nm)
    if recording.torque_filter is not None:
        torque = torque / filter_response(recording.torque_filter, frequency_hz)[:, np.newaxis]
    reach = timing.response(frequency_hz, step_s)[:, np.newaxis]
    turn = 2j * math.pi * frequency_hz[:, np.newaxis]
    velocity = turn * spectra(convert_to_motors(robot, recording.position))
    sent = reach * spectra(convert_to_motors(robot, commands))
    return torque, sent - velocity, velocity


def cell_timing(cycle_time_s: float) -> CommandTiming:
    """Return the time at which the drives of a cell use a command.

    A command that is sent in cycle k acts from SYNC k+1 on, and the drive approaches it linearly
    within that cycle.
    """
    return CommandTiming(interpolation="linear", delay_s=cycle_time_s)


def interpolation_response(frequency_hz: FloatArray, cycle_time_s: float) -> Complex:
    """Return the frequency response from a cell's commands to the velocity loop.

    Args:
        frequency_hz: Shape (lines,). Frequencies [Hz].
        cycle_time_s: Cycle time [s].
    """
    return cell_timing(cycle_time_s).response(frequency_hz, cycle_time_s)
