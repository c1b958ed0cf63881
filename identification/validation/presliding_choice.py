"""Which joints' friction remembers where it came from: chosen by the data, as other terms are.

With presliding the samples at rest and at reversal can be predicted. A joint gets it if its error
on parts of the recordings that a fit has not seen, rest and reversal included, falls by the rules
of `nested_choice`. By the same rules only a share of its friction gives way, and the rest holds at
once. Stribeck friction was chosen before, from rows away from reversals. The parameters
that are not linear are those of all data in every fold. A distance that the data do not tell from
zero, a share that they do not tell from zero and one, and what ends at a bound, is not taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.equations.segments import thinned
from identification.estimation.fitted_signals import FittedSignals, fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.regression.nested_choice import DISTINCT_SIGMAS, joints_that_gain
from identification.validation.held_out import FOLDS, held_out_errors, shown_values
from identification.validation.robot_terms import with_presliding

STARTS: Final = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
"""Presliding distances from which the fit begins [rad or m]: each joint from its best."""
HALF: Final = 0.5
"""Share of the friction from which the fit begins, where not all of it gives way."""


@dataclass(frozen=True, eq=False)
class PreslidingChoice:
    """Which joints have presliding, and what that is worth.

    Attributes:
        joint_names: Base to flange.
        distances: Presliding distance of each joint that has it [rad or m].
        shares: Share of each joint's friction that gives way so, from 0 to 1.
        error_nm: Shape (2, n). RMS error of each joint without and with it on parts left out,
            standstill and reversal included [N m or N].
    """

    joint_names: tuple[str, ...]
    distances: tuple[float | None, ...]
    shares: tuple[float, ...]
    error_nm: FloatArray

    def robot(self, robot: RobotDescription) -> RobotDescription:
        """Return a robot with the chosen presliding."""
        return with_presliding(robot, self.distances, self.shares)


def choose_presliding(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions | None = None,
    *,
    folds: int = FOLDS,
) -> PreslidingChoice:
    """Choose the joints whose friction has memory.

    Args:
        robot: The robot with its other friction terms.
        signals: The recordings of the training runs. They are `thinned`.
        options: The other terms of the model, and from which speed on a joint moves.
        folds: Parts that the recordings are cut into.

    Raises:
        EstimationError: The recordings are too short, or do not show the model.
    """
    options, n = options or EstimationOptions(), len(robot.joints)
    robot = with_presliding(robot, [None] * n)
    parts = [thinned(run) for run in signals]
    plain = fit_smoothed(robot, parts, options)
    whole, partly = (
        fit_smoothed(
            with_presliding(robot, _start(robot, plain, options, share), [share] * n),
            parts,
            options,
        )
        for share in (1.0, HALF)
    )
    errors = [held_out_errors(plain, richer, folds) for richer in (whole, partly)]
    shortest = options.standstill_rad_s * max(
        (run.unfiltered or run).sample_period_s for run in signals
    )
    distances = [
        _resolved(shown_values(richer.estimate(), own, "dp"), shortest)
        for richer, own in zip((whole, partly), errors, strict=True)
    ]
    better = joints_that_gain(*held_out_errors(whole, partly, folds))
    shares = [
        share if worth and distance is not None else None
        for share, worth, distance in zip(
            _shares(partly, errors[1]), better, distances[1], strict=True
        )
    ]
    use = [int(share is not None) for share in shares]
    rms = np.sqrt(np.nanmean(errors, axis=2))
    return PreslidingChoice(
        robot.joint_names,
        tuple(distances[k][j] for j, k in enumerate(use)),
        tuple(share or 1.0 for share in shares),
        np.stack([rms[k, :, j] for j, k in enumerate(use)], axis=1),
    )


def _resolved(distances: Sequence[float | None], shortest: float) -> list[float | None]:
    """Return distances that are longer than the way between two rows at the lowest speed.

    Within a shorter one no row stands: it describes how a joint sticks, not how it gives way.
    """
    return [own if own is not None and own > shortest else None for own in distances]


def _shares(partly: FittedSignals, errors: FloatArray) -> list[float | None]:
    """Return each joint's share where the data tell it from one, too."""
    estimate = partly.estimate()
    sigma = dict(zip(partly.model.nonlinear_names, estimate.nonlinear_sigma, strict=True))
    return [
        share if share is not None and 1.0 - share > DISTINCT_SIGMAS * sigma[f"sp_{name}"] else None
        for name, share in zip(
            partly.model.joint_names, shown_values(estimate, errors, "sp"), strict=True
        )
    ]


def _start(
    robot: RobotDescription, plain: FittedSignals, options: EstimationOptions, share: float
) -> list[float]:
    """Return the distance of `STARTS` that fits each joint best, gears losing nothing yet."""
    residuals = []
    for distance in STARTS:
        tried = with_presliding(robot, [distance] * len(robot.joints), [share] * len(robot.joints))
        residuals.append(plain.problem.fit(options.model.build(tried), None).residual_nm)
    return [STARTS[k] for k in np.argmin(residuals, axis=0)]
