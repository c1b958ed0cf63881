"""`fit_elastic`: a model of the links from the motion of the motors, if the gears are elastic.

Encoders at the motors measure theta, but the links are at q. Below the resonance of a link on its
gear, the link moves more than its motor. A model that is fitted to theta therefore overestimates
the inertia of the links. A payload lowers the resonance and makes the error larger.

The measured torques are replaced by those that rigid gears would need for the same motion of the
motors (`with_rigid_gears`). They are computed with the previous estimate, so the fit is repeated.
Friction and the inertia of the motors depend on theta, and need no conversion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from acquisition.processing.periods import PeriodAverage
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from identification.elasticity.gear_torque import has_stiffness, with_rigid_gears
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import FittedPeriods, fit_periodic
from identification.estimation.options import EstimationOptions
from identification.model.known_loads import Bodies, known_values

MOST_FITS: Final = 12
SETTLED_SHARE: Final = 1e-3
"""Change of a torque between two fits, relative to the torque of the joint (RMS)."""


def fit_elastic(
    robot: RobotDescription,
    averages: Sequence[PeriodAverage],
    options: EstimationOptions | None = None,
    *,
    payload: Sequence[bool] | None = None,
    bodies: Sequence[Bodies] | None = None,
) -> FittedPeriods:
    """Solve the equations of averaged periods for the motion of the links.

    Models with the base wrench (`ModelOptions.kind`) are fitted as if the gears were rigid.

    Args:
        robot: Robot file with stiffness, damping and motor inertia of the gears; a gear of unknown
            stiffness counts as rigid.
        averages, options, payload, bodies: As for `fit_periodic`.

    Raises:
        EstimationError: The repeated fits do not converge, or as for `fit_periodic`.
    """
    fitted = fit_periodic(robot, averages, options, payload=payload, bodies=bodies)
    if not has_stiffness(robot) or fitted.options.kind != "internal":
        return fitted
    before = averages
    for _ in range(MOST_FITS):
        loaded = fitted.problem.payload
        rigid = _rigid(fitted.estimate(), averages, payload=loaded, bodies=bodies)
        if all(map(_is_settled, rigid, before)):
            changes = [
                new.torque_nm - own.torque_nm for new, own in zip(rigid, averages, strict=True)
            ]
            mean_square = np.mean([np.mean(np.square(each), axis=0) for each in changes], axis=0)
            return replace(fitted, gear_torque_nm=np.sqrt(mean_square))
        fitted = fit_periodic(robot, rigid, options, payload=payload, bodies=bodies)
        before = rigid
    raise EstimationError(
        f"the model of the links has not converged in {MOST_FITS} fits: check the stiffness of the"
        " gears, or use an excitation with lower frequencies",
        code="RID-STIFFNESS-UNSETTLED",
    )


def rigid_averages(
    estimate: Estimate,
    averages: Sequence[PeriodAverage],
    *,
    payload: Sequence[bool] | None = None,
    bodies: Sequence[Bodies] | None = None,
) -> list[PeriodAverage]:
    """Return the mean periods to which an estimate was fitted.

    For a model of the links behind elastic gears, the torques are those that rigid gears would need
    (`with_rigid_gears`).

    Args:
        averages: The measured mean periods.
        payload, bodies: As for `fit_periodic`.

    Raises:
        EstimationError: The deflection does not converge.
    """
    if estimate.gear_torque_nm is None:
        return list(averages)
    return _rigid(estimate, averages, payload=payload, bodies=bodies)


def _rigid(
    estimate: Estimate,
    averages: Sequence[PeriodAverage],
    *,
    payload: Sequence[bool] | None,
    bodies: Sequence[Bodies] | None,
) -> list[PeriodAverage]:
    known = known_values(estimate.model, estimate.base, bodies or [{}] * len(averages))
    return [
        with_rigid_gears(average, replace(estimate, values=estimate.values + more), payload=loaded)
        for average, loaded, more in zip(
            averages, payload or [False] * len(averages), known, strict=True
        )
    ]


def _is_settled(average: PeriodAverage, before: PeriodAverage) -> bool:
    """Return True if the torques of two mean periods hardly differ."""
    change = np.std(average.torque_nm - before.torque_nm, axis=0)
    return bool(np.all(change <= SETTLED_SHARE * np.std(average.torque_nm, axis=0)))
