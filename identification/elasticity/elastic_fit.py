"""`fit_elastic`: a model of the links from the motion of the motors, if the gears are elastic.

Encoders at the motors measure theta, but the links are at q = theta - tau_link / (k + s d). k and d
are the stiffness and damping of the gears, and s = j omega on the DFT bins. Below the resonance of
a link on its gear, the link moves more than its motor. A model that is fitted to
theta therefore overestimates the inertia of the links. A payload lowers the resonance and makes the
error larger.

The measured torques are replaced by those that rigid gears would need for the same motion of the
motors: tau + tau_link(theta) - tau_link(q). The two torques of the links are computed with the
previous estimate, so the fit is repeated. Friction and the inertia of the motors depend on theta,
and need no conversion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.processing.periods import PeriodAverage
from acquisition.signals.bins import Bins, filter_response, from_bins, to_bins
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import convert_to_joints
from identification.elasticity.gear_torque import (
    SETTLED_RAD,
    STEPS,
    damping_nm_s,
    deflection_band_hz,
    has_stiffness,
    stiffness_nm_rad,
)
from identification.elasticity.transmitted_torque import transmitted_torque
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
        estimate = fitted.estimate()
        known = known_values(estimate.model, estimate.base, bodies or [{}] * len(averages))
        rigid = [
            with_rigid_gears(
                average, replace(estimate, values=estimate.values + more), payload=loaded
            )
            for average, loaded, more in zip(averages, fitted.problem.payload, known, strict=True)
        ]
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


def with_rigid_gears(
    average: PeriodAverage, estimate: Estimate, *, payload: bool = False
) -> PeriodAverage:
    """Return a mean period with the torques that rigid gears would need for the motors' motion.

    Args:
        average: The measured mean period. It is returned unchanged if no stiffness is known.
        estimate: Model of the links; its robot states the stiffness.
        payload: True if the run carried the payload of the estimate.
    """
    robot, rows = estimate.robot, len(average.position)
    if not has_stiffness(robot):
        return average
    band_hz = deflection_band_hz(estimate, average.position, average.sample_period_s)
    harmonics = max(1, math.floor(band_hz * average.period_s))
    frequency_hz = np.arange(harmonics + 1) / average.period_s
    s = 2j * math.pi * frequency_hz[:, np.newaxis]
    gear = stiffness_nm_rad(robot) + s * damping_nm_s(robot)
    theta = to_bins(average.position, harmonics)

    def links_torque(position: Bins) -> FloatArray:
        motion = (from_bins(position * s**k, rows) for k in range(3))
        return transmitted_torque(estimate, robot, *motion, payload=payload)

    of_motors = torque = links_torque(theta)
    bent: NDArray[Any] = np.zeros_like(theta)
    for _ in range(STEPS):
        step = to_bins(torque, harmonics) / gear - bent
        bent = bent + step
        torque = links_torque(theta - convert_to_joints(robot, bent))
        if np.abs(step).sum(axis=0).max() < SETTLED_RAD:
            break
    more = to_bins(of_motors - torque, harmonics)
    if average.torque_filter is not None:
        more = more * filter_response(average.torque_filter, frequency_hz)[:, np.newaxis]
    return replace(average, torque_nm=average.torque_nm + from_bins(more, rows))


def _is_settled(average: PeriodAverage, before: PeriodAverage) -> bool:
    """Return True if the torques of two mean periods hardly differ."""
    change = np.std(average.torque_nm - before.torque_nm, axis=0)
    return bool(np.all(change <= SETTLED_SHARE * np.std(average.torque_nm, axis=0)))
