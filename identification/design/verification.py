"""`MotionCheck`: objective of a periodic motion, and the check of its limits on a dense grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.samples import Phase
from acquisition.recording.plate_geometry import WRENCH_NAMES, WRENCH_UNITS
from config.arrays import FloatArray
from config.errors import ConfigError
from dynamics.model.base_wrench import base_wrench
from dynamics.model.robot_model import regressor, torque
from identification.design.criteria import Condition, DOptimal
from identification.design.problem import ExcitationProblem

DENSE_POINTS_PER_HARMONIC = 200
ACTIVE_SHARE = 0.98
ACTIVE_DISTANCE_M = 0.01


@dataclass(frozen=True)
class LimitUse:
    """Use of one limit by a motion.

    Attributes:
        what: The quantity, such as "torque of joint2".
        used, limit: Largest magnitude (for a position: from the middle of the range), or smallest
            distance.
        unit: Unit of both.
        is_met: True if the motion satisfies the limit.
        active: True if the motion nearly reaches the usable fraction of the limit.
    """

    what: str
    used: float
    limit: float
    unit: str
    is_met: bool
    active: bool


@dataclass(frozen=True)
class MotionCheck:
    """Result of the check of a motion.

    Attributes:
        objective: The criterion; smaller is better.
        condition_number: Condition number of the model with its discontinuous sign (2.25, 2.26),
            with scaled columns and rows divided by the expected noise.
        log_det: Log determinant of the information about the base parameters, per parameter.
        uses: Positions, speeds, accelerations, torques, base wrench and distances, including ramps.
        broken: Violated limits in words; empty if the motion may be executed.
    """

    objective: float
    condition_number: float
    log_det: float
    uses: tuple[LimitUse, ...]
    broken: tuple[str, ...]


class _Rows(NamedTuple):
    q: FloatArray
    v: FloatArray
    a: FloatArray


def check_motion(
    problem: ExcitationProblem, motion: FourierMotion, sample_period_s: float
) -> MotionCheck:
    """Check a motion against every limit of a design task, including its ramps.

    Position, speed and acceleration are also checked between the cell's samples. Torques, base
    wrench and distances are checked on a separate grid over the period, and at the samples of the
    ramps.

    Args:
        problem: The design task.
        sample_period_s: The cell's cycle time [s].

    Raises:
        ConfigError: The motion is not for the robot's joints.
    """
    points = DENSE_POINTS_PER_HARMONIC * max(len(joint.sine) for joint in motion.joints)
    grid = motion.trajectory(problem.robot, motion.period_s / points)
    times = grid.sample_times_s
    period = _Rows(grid.position(times), grid.velocity(times), grid.acceleration(times))
    broken: list[str] = []
    rows = period
    try:
        rows = _with_ramps(problem, motion, sample_period_s, period)
    except ConfigError as error:
        broken.append(str(error))
    uses = (*_motion_uses(problem, rows), *_torque_uses(problem, rows))
    uses += (*_base_uses(problem, rows), *_distance_uses(problem, rows))
    broken += [
        f"{use.what}: {use.used:.4g} {use.unit}, but the limit is {use.limit:.4g} {use.unit}"
        for use in uses
        if not use.is_met
    ]
    information = problem.information(problem.weighted_rows(regressor(problem.model, *period)))
    known = bool((np.diagonal(information) > 0.0).all())
    return MotionCheck(
        objective=problem.criterion.objective(information) if known else math.inf,
        condition_number=Condition().objective(information) if known else math.inf,
        log_det=-DOptimal().objective(information) if known else -math.inf,
        uses=uses,
        broken=tuple(broken),
    )


def _with_ramps(
    problem: ExcitationProblem, motion: FourierMotion, sample_period_s: float, period: _Rows
) -> _Rows:
    """Return a period and the ramps, as the cell would execute them."""
    once = motion.model_copy(update={"periods": 1, "transient_periods": 0})
    plan = once.plan(problem.robot, sample_period_s)
    ramps = np.isin(plan.phase, (Phase.RUN_IN, Phase.RUN_OUT))
    planned = (plan.position, plan.velocity, plan.acceleration)
    return _Rows(
        *(
            np.vstack([dense, samples[ramps]])
            for dense, samples in zip(period, planned, strict=True)
        )
    )


def _motion_uses(problem: ExcitationProblem, rows: _Rows) -> tuple[LimitUse, ...]:
    uses: list[LimitUse] = []
    for j, joint in enumerate(problem.robot.joints):
        limits = joint.limits
        half = (limits.position_max - limits.position_min) / 2.0
        for what, values, limit, per in (
            ("range", rows.q[:, j] - limits.position_min - half, half, ""),
            ("speed", rows.v[:, j], limits.velocity, "/s"),
            ("acceleration", rows.a[:, j], limits.acceleration, "/s²"),
        ):
            largest = float(np.abs(values).max())
            uses.append(
                _limit_use(problem, f"{what} of {joint.name}", largest, limit, joint.unit + per)
            )
    return tuple(uses)


def _torque_uses(problem: ExcitationProblem, rows: _Rows) -> tuple[LimitUse, ...]:
    if problem.parameters is None:
        return ()
    largest = np.abs(torque(problem.model, *rows, problem.parameters)).max(axis=0)
    return tuple(
        _limit_use(
            problem,
            f"torque of {joint.name}",
            float(tau),
            problem.torque_share * joint.limits.torque,
            joint.torque_unit,
        )
        for joint, tau in zip(problem.robot.joints, largest, strict=True)
    )


def _base_uses(problem: ExcitationProblem, rows: _Rows) -> tuple[LimitUse, ...]:
    if problem.base_limits is None or problem.parameters is None:
        return ()
    largest = np.abs(base_wrench(problem.model, *rows, problem.parameters)).max(axis=0)
    return tuple(
        _limit_use(problem, f"{name} on the base", float(used), float(limit), unit)
        for name, unit, used, limit in zip(
            WRENCH_NAMES, WRENCH_UNITS, largest, problem.base_limits, strict=True
        )
    )


def _limit_use(
    problem: ExcitationProblem, what: str, used: float, limit: float, unit: str
) -> LimitUse:
    active = used >= ACTIVE_SHARE * problem.limit_fraction * limit
    return LimitUse(what, used, limit, unit, is_met=used <= limit * (1.0 + 1e-9), active=active)


def _distance_uses(problem: ExcitationProblem, rows: _Rows) -> tuple[LimitUse, ...]:
    clearances = problem.clearances
    margin = clearances.margin_m
    return tuple(
        LimitUse(
            f"distance between {name}",
            float(distance),
            margin,
            "m",
            is_met=bool(distance >= margin),
            active=bool(distance < margin + ACTIVE_DISTANCE_M),
        )
        for name, distance in zip(clearances.names, clearances.nearest(rows.q), strict=True)
    )
