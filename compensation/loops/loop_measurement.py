"""`LoopMeasurement`: the loops of all axes that a multisine run excites, identified in passes.

Commands are linear between samples, so their spectrum has images of each line around the multiples
of the cycle frequency. The axis follows these images slightly. Sampling then folds this motion and
its torque back onto the line. At a sixth of the cycle frequency this is about 0.1 % of the velocity
error for a slow loop. It is 12 % of the torque for a loop that is faster than the cycle, if no
filter removes the images from the measured torque. The first pass neglects the images and fits the
loops. Each further pass computes the images with the loops of the previous pass and removes them.

The images look like a delay. A controller with this delay would predict a loop that is nearly
unstable at the images' frequencies, and the passes would diverge. Therefore the controllers of the
first pass have no delay and no lag.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.recording.recording import Recording
from acquisition.signals.bins import filter_response
from compensation.loops.axis_mechanics import fit_axis_mechanics
from compensation.loops.cascade import Cascade
from compensation.loops.frequency_response import (
    FrequencyResponse,
    controller_responses,
    mechanics_responses,
)
from compensation.loops.multisine_spectra import (
    MultisineSpectra,
    multisine_spectra,
)
from compensation.loops.velocity_loop import (
    CHOICES,
    PLAIN,
    Extra,
    VelocityLoop,
    fit_velocity_loop,
)
from config.errors import EstimationError
from config.robot.robot import RobotDescription

IMAGES: Final = (-2, -1, 1, 2)
LARGEST_UNEXPLAINED: Final = 0.05
"""Fraction of a controller's torque at empty lines that it may leave unexplained. In simulations it
was below 0.01; with a limited torque, or a command that the drive filters for 5 ms, it was 0.06 to
0.5, and the gain was wrong by 9 to 70 %."""
CLEAR_OF_NOISE: Final = 1.5
PASSES_WITHOUT_IMAGES: Final = 3
"""The gains of loops of 600 rad/s at a cycle of 8 ms then change by less than 0.2 %."""


@dataclass(frozen=True)
class LoopMeasurement:
    """Responses of the excited axes and their fits, in the same order.

    Attributes:
        controllers, mechanics: Frequency responses: torque over velocity error, and velocity over
            torque.
        cascades: Fitted loops of each axis.
        left_out: Numbers of the realisations that are not used because rows are missing; the first
            is 1.
        unexplained: Fraction of each controller's torque at lines without excitation that it leaves
            unexplained. The intervals of gain and integral time contain it as an error.
    """

    controllers: tuple[FrequencyResponse, ...]
    mechanics: tuple[FrequencyResponse, ...]
    cascades: tuple[Cascade, ...]
    left_out: tuple[int, ...]
    unexplained: tuple[float, ...]

    @property
    def loops(self) -> tuple[VelocityLoop, ...]:
        """The fitted velocity loops."""
        return tuple(cascade.loop for cascade in self.cascades)


def measure_loops(
    recording: Recording,
    motion: MultisineMotion,
    robot: RobotDescription,
    position_gain_per_s: float,
) -> LoopMeasurement:
    """Measure and fit the loops of each axis that a multisine excites.

    Args:
        recording: A run of this motion, recorded by a cell.
        position_gain_per_s: K_v of the cell [1/s].

    Raises:
        DataQualityError: The recording belongs to another robot, has no commands, or has no
            complete realisation.
        EstimationError: There are too few excited lines, or the response is not that of a velocity
            loop.
    """
    return measure_spectra(multisine_spectra(recording, motion, robot), position_gain_per_s)


def measure_spectra(spectra: MultisineSpectra, position_gain_per_s: float) -> LoopMeasurement:
    """Measure and fit the loops of each excited axis.

    Args:
        spectra: Spectra of a multisine run.
        position_gain_per_s: K_v of the position loop for which margins are computed [1/s].

    Raises:
        DataQualityError: A signal is 0, or there is one realisation and it has no empty odd lines.
        EstimationError: As for `measure_loops`, or a controller contradicts the torque at lines
            without excitation.
    """
    if spectra.timing.interpolation == "none":  # sampled set-points contain no images
        found = _measure(spectra, position_gain_per_s)
    else:
        found, measured = _measure(spectra, position_gain_per_s, (PLAIN,)), spectra
        for _ in range(PASSES_WITHOUT_IMAGES):
            spectra = without_images(measured, found.cascades)
            found = _measure(spectra, position_gain_per_s)
    shares = tuple(unexplained_share(spectra, loop) for loop in found.loops)
    for loop, share in zip(found.loops, shares, strict=True):
        if share > LARGEST_UNEXPLAINED:
            raise EstimationError(
                f"joint {loop.joint_name}: at frequencies without excitation, the torque differs by"
                f" {100.0 * share:.2g} % from that of the controller that is fitted to the excited"
                " ones (gain"
                f" {loop.gain:.4g}), so this gain is wrong: check that no torque was limited or"
                " clipped (reduce the amplitude), that the drive does not filter its commands or"
                " velocities, and the command_timing of an import",
                code="RID-LOOP-CONTRADICTED",
            )
    widened = tuple(
        replace(cascade, loop=cascade.loop.widened(share))
        for cascade, share in zip(found.cascades, shares, strict=True)
    )
    return replace(found, cascades=widened, unexplained=shares)


def unexplained_share(spectra: MultisineSpectra, loop: VelocityLoop) -> float:
    """Return the fraction of the torque at lines without excitation that a controller leaves.

    Friction and other joints cause velocity errors at these lines, too, and the drive's controller
    is linear. The fraction is relative to the torque that the velocity errors of neighbouring
    excited lines cause; RMS over the even or the odd lines, whichever is larger; 0 if noise can
    explain it.

    Args:
        spectra: Spectra without images.
        loop: Fitted controller of an excited joint.
    """
    joint = spectra.joint_names.index(loop.joint_name)
    lines = spectra.lines[joint]
    between = np.arange(lines[0], lines[-1] + 1)
    empty = np.setdiff1d(between, np.concatenate(spectra.lines))
    frequency_hz, error = spectra.frequency_hz[empty], spectra.error[..., joint]
    response = loop.response(frequency_hz)
    strength = np.sqrt(np.mean(np.abs(error[:, :, lines].mean(axis=1)) ** 2, axis=0))
    beside = np.interp(frequency_hz, spectra.frequency_hz[lines], strength)
    left = spectra.torque[..., joint][:, :, empty] / response - error[:, :, empty]
    mean, periods = left.mean(axis=1), left.shape[1]
    scatter = np.sum(np.abs(left - mean[:, np.newaxis]) ** 2, axis=1) / (periods - 1) / periods
    shares = [0.0]
    for own in (empty % 2 == 0, empty % 2 == 1):
        if own.any():
            level = float(np.mean(np.abs(mean[:, own] / beside[own]) ** 2))
            noise = float(np.mean(scatter[:, own] / beside[own] ** 2))
            if level > CLEAR_OF_NOISE**2 * noise:
                shares.append(float(np.sqrt(level - noise)))
    return max(shares)


def without_images(spectra: MultisineSpectra, cascades: Sequence[Cascade]) -> MultisineSpectra:
    """Return spectra without the images that sampling folds back onto the lines.

    Args:
        spectra: Measured spectra.
        cascades: Fitted loops, which predict the images; the spectra of other joints are not
            changed.
    """
    f, step_s = spectra.frequency_hz, spectra.cycle_time_s
    torque, error, velocity = (
        values.copy() for values in (spectra.torque, spectra.error, spectra.velocity)
    )
    analog = spectra.torque_filter
    for cascade in cascades:
        j = spectra.joint_names.index(cascade.loop.joint_name)
        sent = (error[..., j] + velocity[..., j]) / spectra.timing.response(f, step_s)
        of_velocity, of_torque = np.zeros((2, len(f)), dtype=np.complex128)
        for image in IMAGES:
            at = f + image / step_s
            closed = cascade.closed_velocity_loop(at)
            follows = closed * spectra.timing.response(at, step_s)
            of_velocity += f / at * follows
            drives = follows / cascade.mechanics.response(at)
            if analog is not None:
                drives = drives * filter_response(analog, at) / filter_response(analog, f)
            of_torque += drives
        velocity[..., j] -= of_velocity * sent
        error[..., j] += of_velocity * sent
        torque[..., j] -= of_torque * sent
    return replace(spectra, torque=torque, error=error, velocity=velocity)


def _measure(
    spectra: MultisineSpectra,
    position_gain_per_s: float,
    choices: Sequence[tuple[Extra, ...]] = CHOICES,
) -> LoopMeasurement:
    controllers, mechanics = controller_responses(spectra), mechanics_responses(spectra)
    return LoopMeasurement(
        controllers=controllers,
        mechanics=mechanics,
        cascades=tuple(
            Cascade(
                fit_velocity_loop(controller, choices),
                fit_axis_mechanics(axis),
                position_gain_per_s,
                spectra.cycle_time_s,
            )
            for controller, axis in zip(controllers, mechanics, strict=True)
        ),
        left_out=spectra.left_out,
        unexplained=(0.0,) * len(controllers),
    )
