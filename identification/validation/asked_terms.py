"""Friction terms that held-out data ask for, beside those of the robot file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.errors import EstimationError
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from identification.equations.segments import thinned
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.validation.held_out import held_out_errors

ASKED: Final[tuple[FrictionTerm, ...]] = ("offset", "cubic", "load")
LEAST_GAIN: Final = 0.1
"""Share of the RMS error on held-out data that a term must take off."""
SIGMAS: Final = 2.0
FEWEST_SECONDS: Final = 10


def asked_findings(
    robot: RobotDescription, signals: Sequence[SmoothedSignals], options: EstimationOptions
) -> tuple[str, ...]:
    """Name joints whose torque a further friction term predicts better on data left out of a fit.

    A term counts if the squared error falls by more than two standard errors, second by second,
    and the RMS error by at least a tenth.

    Args:
        robot: The robot with the terms that were identified.
        signals: The recordings.
        options: How they were identified; terms that a request names in place of the robot file's
            are kept.
    """
    if not options.model.friction or options.model.friction_terms is not None:
        return ()
    parts = [thinned(run) for run in signals]
    asked: dict[str, list[str]] = {}
    try:
        plain = fit_smoothed(robot, parts, options)
        for term in ASKED:
            joints = tuple(
                joint
                if term in joint.friction
                else joint.model_copy(update={"friction": (*joint.friction, term)})
                for joint in robot.joints
            )
            full = fit_smoothed(robot.model_copy(update={"joints": joints}), parts, options)
            errors = held_out_errors(plain, full)
            for j, joint in enumerate(robot.joints):
                own = errors[:, :, j]
                own = own[:, np.isfinite(own.sum(axis=0))]
                if term in joint.friction or own.shape[1] < FEWEST_SECONDS:
                    continue
                gain = own[0] - own[1]
                sure = gain.mean() > SIGMAS * np.std(gain, ddof=1) / math.sqrt(len(gain))
                before, after = np.sqrt(own.mean(axis=1))
                if sure and after < (1.0 - LEAST_GAIN) * before:
                    asked.setdefault(joint.name, []).append(f"{term} ({before:.3g} to {after:.3g})")
    except EstimationError:  # the recording is too short, or does not show the richer model
        return ()
    if not asked:
        return ()
    told = "; ".join(
        f"{name}: {', '.join(asked[name])}" for name in robot.joint_names if name in asked
    )
    return (
        "Held-out parts of the runs ask for friction terms that the robot file does not have, with"
        f" the RMS error [N m or N] without and with each: {told}. `rid-daq identify --choose`"
        " compares them and takes those that help.",
    )
