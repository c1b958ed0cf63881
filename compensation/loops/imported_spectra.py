"""`imported_spectra`: spectra of a multisine that another program has recorded.

The phases of the multisine are not known. They are not needed, because there is one realisation:
the phases cancel in the ratio of the mean spectra of output and input over its periods (Pintelon
and Schoukens 2012, section 2.6). The excited lines are those of the velocity commands.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.maps.command_timing import CommandTiming
from acquisition.recording.recording import Recording
from compensation.loops.multisine_spectra import (
    Complex,
    MultisineSpectra,
    motor_spectra,
    require_commands,
)
from compensation.loops.velocity_loop import FEWEST_LINES
from config.arrays import IntArray
from config.errors import DataQualityError
from config.robot.robot import RobotDescription

FIRST_LINE: Final = 2
"""Lowest harmonic that can be a line of the multisine; harmonic 1 may be a slow sine."""
LEAST_AMPLITUDE: Final = 0.2
"""Smallest amplitude of an excited line, relative to the fourth largest of the joint."""
LEAST_OF_LARGEST: Final = 0.02
"""Smallest amplitude of an excited line, relative to the largest of the joint."""
LEAST_SNR: Final = 10.0
"""Smallest amplitude of an excited line in standard deviations of its mean over the periods."""
MOST_OF_OTHERS: Final = 1.0 / 3.0
"""Largest amplitude of another joint at an excited line, relative to that of the line's joint."""


def imported_spectra(
    recording: Recording, robot: RobotDescription, timing: CommandTiming
) -> MultisineSpectra:
    """Return the spectra of an imported multisine: one realisation, whole periods.

    Args:
        recording: An import of whole periods with velocity commands.
        robot: The robot.
        timing: Time at which the drives use the commands.

    Raises:
        DataQualityError: The recording belongs to another robot, has no commands, fewer than two
            whole periods or missing rows, or excites no joint at enough separate lines.
    """
    step_s = require_commands(recording, robot)
    rows = recording.samples_per_period
    if rows is None or len(recording) < 2 * rows:
        raise DataQualityError(
            "the import has fewer than two whole periods: state period_s, the period of the"
            " multisine, in the map, and record at least two periods",
            code="RID-RECORDING-PERIODS",
        )
    if not recording.valid.all():
        raise DataQualityError(
            f"{np.count_nonzero(~recording.valid)} rows of the periods are missing, so that their"
            " spectra are wrong: import only periods without gaps (--rows)",
            code="RID-RECORDING-ROWS-LOST",
        )
    whole = slice(0, len(recording) // rows * rows)
    torque, error, velocity = motor_spectra(recording, robot, [whole], rows, timing)
    frequency_hz = np.arange(rows // 2 + 1) / (rows * step_s)
    commands = (error + velocity)[0]
    lines = excited_lines(commands)
    if not any(len(own) for own in lines):
        raise DataQualityError(
            f"no joint has {FEWEST_LINES} lines at which only its velocity command is strong:"
            " excite one joint after the other, or each joint at its own frequencies, by a"
            " multisine with the period period_s",
            code="RID-LOOP-WEAK",
        )
    mean = commands.mean(axis=0)
    return MultisineSpectra(
        joint_names=robot.joint_names,
        frequency_hz=frequency_hz,
        lines=lines,
        reference=tuple(mean[np.newaxis, own, joint] for joint, own in enumerate(lines)),
        torque=torque,
        error=error,
        velocity=velocity,
        cycle_time_s=step_s,
        timing=timing,
        torque_filter=recording.torque_filter,
        left_out=(),
    )


def excited_lines(commands: Complex) -> tuple[IntArray, ...]:
    """Return the harmonics at which the velocity command of each joint alone is strong.

    Args:
        commands: Shape (periods, harmonics, joints). Amplitudes of the commands.

    Returns:
        One array per joint; empty for a joint with fewer than `FEWEST_LINES` lines.
    """
    mean = commands.mean(axis=0)
    size = np.abs(mean)
    noise = np.sqrt(
        np.sum(np.abs(commands - mean) ** 2, axis=0) / (len(commands) - 1) / len(commands)
    )
    found = []
    for joint in range(size.shape[1]):
        own = size[:, joint]
        top = np.sort(own[FIRST_LINE:])[-FEWEST_LINES] if len(own) > FEWEST_LINES + 1 else np.inf
        others = np.delete(size, joint, axis=1).max(axis=1, initial=0.0)
        strong = (own >= LEAST_AMPLITUDE * top) & (own >= LEAST_SNR * noise[:, joint])
        strong &= (own > LEAST_OF_LARGEST * own[FIRST_LINE:].max(initial=0.0)) & (own > 0.0)
        strong &= others <= MOST_OF_OTHERS * own
        strong[:FIRST_LINE] = False
        lines = np.flatnonzero(strong)
        found.append(lines if len(lines) >= FEWEST_LINES else lines[:0])
    return tuple(found)
