"""`LoopMeasurement`: the loops of all axes that a multisine run excites, identified in two passes.

Commands are linear between samples, so their spectrum has images of each line around the multiples
of the cycle frequency. The axis follows these images slightly. Sampling then folds this motion back
onto the line: about 0.1 % of the velocity error at a sixth of the cycle frequency. The first pass
neglects the images and fits the loops. The second pass computes the images with these loops and
removes them.
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
from compensation.loops.velocity_loop import VelocityLoop, fit_velocity_loop
from config.robot.robot import RobotDescription

IMAGES: Final = (-2, -1, 1, 2)


@dataclass(frozen=True)
class LoopMeasurement:
    """Responses of the excited axes and their fits, in the same order.

    Attributes:
        controllers, mechanics: Frequency responses: torque over velocity error, and velocity over
            torque.
        cascades: Fitted loops of each axis.
        left_out: Numbers of the realisations that are not used because rows are missing; the first
            is 1.
    """

    controllers: tuple[FrequencyResponse, ...]
    mechanics: tuple[FrequencyResponse, ...]
    cascades: tuple[Cascade, ...]
    left_out: tuple[int, ...]

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
        EstimationError: As for `measure_loops`.
    """
    first = _measure(spectra, position_gain_per_s)
    if spectra.timing.interpolation == "none":
        return first  # sampled set-points contain no images
    return _measure(without_images(spectra, first.cascades), position_gain_per_s)


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


def _measure(spectra: MultisineSpectra, position_gain_per_s: float) -> LoopMeasurement:
    controllers, mechanics = controller_responses(spectra), mechanics_responses(spectra)
    return LoopMeasurement(
        controllers=controllers,
        mechanics=mechanics,
        cascades=tuple(
            Cascade(
                fit_velocity_loop(controller),
                fit_axis_mechanics(axis),
                position_gain_per_s,
                spectra.cycle_time_s,
            )
            for controller, axis in zip(controllers, mechanics, strict=True)
        ),
        left_out=spectra.left_out,
    )
