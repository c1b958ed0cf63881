"""Choice of the joints whose friction has presliding hysteresis, from the data.

With presliding, a model can also predict samples at standstill and reversal. Held-out errors
therefore include these samples. The rules are those of `nested_choice`:
- A joint gets presliding if its held-out error falls enough.
- The presliding fraction of its friction is below one if this again lowers the error enough; the
  rest of the friction is then rigid (Coulomb).
- A distance is rejected if the data do not distinguish it from zero; a fraction, if they do not
  distinguish it from zero and from one. Values at a bound are rejected as well.

Stribeck friction was chosen before, from rows away from reversals. The nonlinear parameters are
fitted to all data and are the same in every fold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.equations.segments import thin_rows
from identification.estimation.fitted_signals import FittedSignals, fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.regression.nested_choice import DISTINCT_SIGMAS, joints_that_gain
from identification.validation.held_out import FOLDS, held_out_errors, identified_values
from identification.validation.robot_terms import with_presliding

STARTS: Final = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
"""Candidate starting values of a joint's presliding distance [rad or m]; the best is used."""
HALF: Final = 0.5
"""Starting value of the presliding fraction, if it is below 1."""


@dataclass(frozen=True, eq=False)
class PreslidingChoice:
    """The joints with presliding, and its effect on the error.

    Attributes:
        joint_names: Joints from base to flange.
        distances: Presliding distance of each joint that has it [rad or m].
        shares: Presliding fraction of each joint's friction, from 0 to 1.
        error_nm: Shape (2, n). RMS error of each joint without and with presliding on held-out
            parts, including standstill and reversal [N m or N].
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
    """Choose the joints whose friction has presliding.

    Args:
        robot: The robot with its other friction terms.
        signals: The recordings of the training runs. Their rows are thinned (`thin_rows`).
        options: The other terms of the model, and the speed above which a joint counts as moving.
        folds: Number of parts of the recordings.

    Raises:
        EstimationError: The recordings are too short, or do not determine the model.
    """
    options, n = options or EstimationOptions(), len(robot.joints)
    robot = with_presliding(robot, [None] * n)
    parts = [thin_rows(run) for run in signals]
    plain = fit_smoothed(robot, parts, options)
    whole, partly = (
        fit_smoothed(
            with_presliding(robot, _start_distances(robot, plain, options, share), [share] * n),
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
        _resolved_distances(identified_values(richer.estimate(), own, "dp"), shortest)
        for richer, own in zip((whole, partly), errors, strict=True)
    ]
    better = joints_that_gain(*held_out_errors(whole, partly, folds))
    shares = [
        share if worth and distance is not None else None
        for share, worth, distance in zip(
            _distinct_fractions(partly, errors[1]), better, distances[1], strict=True
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


def _resolved_distances(distances: Sequence[float | None], shortest: float) -> list[float | None]:
    """Return the distances that exceed the displacement between two rows at the lowest speed.

    A joint moves through a shorter distance within one row, so that no row shows presliding.
    """
    return [own if own is not None and own > shortest else None for own in distances]


def _distinct_fractions(partly: FittedSignals, errors: FloatArray) -> list[float | None]:
    """Return each joint's presliding fraction if the data distinguish it from zero and one."""
    estimate = partly.estimate()
    sigma = dict(zip(partly.model.nonlinear_names, estimate.nonlinear_sigma, strict=True))
    return [
        share if share is not None and 1.0 - share > DISTINCT_SIGMAS * sigma[f"sp_{name}"] else None
        for name, share in zip(
            partly.model.joint_names, identified_values(estimate, errors, "sp"), strict=True
        )
    ]


def _start_distances(
    robot: RobotDescription, plain: FittedSignals, options: EstimationOptions, share: float
) -> list[float]:
    """Return the distance of `STARTS` that fits each joint best, with lossless gears."""
    residuals = []
    for distance in STARTS:
        tried = with_presliding(robot, [distance] * len(robot.joints), [share] * len(robot.joints))
        residuals.append(plain.problem.fit(options.model.build(tried), None).residual_nm)
    return [STARTS[k] for k in np.argmin(residuals, axis=0)]
