"""`calibrate`: identify an arm's geometry and gear compliances from measured points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import t as student

from acquisition.tracker.pose_file import MeasuredPoses
from config.arrays import BoolArray, FloatArray
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from identification.kinematics.arm import PlacedArm
from identification.kinematics.fit import ArmFit, fit_arm
from identification.kinematics.gravity import Gravity
from identification.kinematics.held_out import (
    FOLDS,
    HeldOut,
    cross_validate,
    distinct_poses,
    judge,
)
from identification.kinematics.parameters import (
    KinematicParameter,
    choose_identifiable,
    compliance_candidates,
    geometry_candidates,
    scaled_condition,
)

FEWEST_SPARE: Final = 6
"""Smallest number of equations minus parameters in a fit without the held-out poses."""
LARGEST_SPREAD: Final = 5.0
"""Largest predicted error of the point within the joints' ranges, over the error of one position;
with more, the poses do not determine the geometry."""
LARGEST_MISFIT_M: Final = 0.1
"""Largest RMS distance between the measured points and the nominal geometry."""
SHOWN: Final = 2.0
"""A compliance counts as shown if it is larger than this many standard deviations."""
PRECISE: Final = 0.2
"""Relative standard deviation up to which a compliance counts as identified."""
SUSPICIOUS: Final = 5.0
"""Held-out error over its prediction, as a multiple of the median, above which a pose is listed."""
CONTRADICTS: Final = 12.0
"""Multiple of the median above which an error contradicts the calibration. An effect that the model
lacks causes up to 9 times."""
LARGEST_EXCESS: Final = 5.0
"""Ratio of held-out errors to their prediction above which they contradict the calibration."""
_PROBES: Final = 200


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result of a kinematic calibration.

    Attributes:
        robot: The nominal robot.
        nominal: The nominal arm with the base frame that fits the poses best.
        fit: The fit to all poses.
        rank: Number of identifiable geometric parameters; at most 4 R + 2 P + 3 for R revolute and
            P prismatic joints.
        condition: Condition number of the fit, columns scaled to length one.
        fixed: Geometric parameters that the points cannot show separately.
        hidden: Joints whose compliance the poses do not show; it is held at the robot file's value,
            or 0.
        before: Held-out errors of the nominal geometry.
        rigid: Held-out errors of calibrated geometry with rigid gears; None if no compliance was
            estimated.
        after: Held-out errors of the calibration.
        own: Held-out errors at the poses of the fit.
        poses: The poses of the fit.
        check: The poses of `after`; None if they are those of the fit.
    """

    robot: RobotDescription
    nominal: PlacedArm
    fit: ArmFit
    rank: int
    condition: float
    fixed: tuple[KinematicParameter, ...]
    hidden: tuple[str, ...]
    before: HeldOut
    rigid: HeldOut | None
    after: HeldOut
    own: HeldOut
    poses: MeasuredPoses
    check: MeasuredPoses | None = None

    @property
    def improves(self) -> bool:
        """True if the calibration reduces the RMS error at held-out poses."""
        return self.after.rms_m < self.before.rms_m

    @property
    def suspicious(self) -> BoolArray:
        """True for poses of the fit with a conspicuous error, (poses,)."""
        return np.asarray(self.own.ratio > SUSPICIOUS)

    @property
    def judged(self) -> tuple[tuple[MeasuredPoses, HeldOut], ...]:
        """The poses of the fit, and those of the check, with their held-out errors."""
        of_fit = (self.poses, self.own)
        return (of_fit,) if self.check is None else (of_fit, (self.check, self.after))

    @property
    def is_contradicted(self) -> bool:
        """True if a single held-out error contradicts the calibration, or all errors do."""
        single = any((errors.ratio > CONTRADICTS).any() for _, errors in self.judged)
        return single or self.after.excess > LARGEST_EXCESS

    @property
    def holds(self) -> bool:
        """True if the calibration improves and is not contradicted."""
        return self.improves and not self.is_contradicted

    @property
    def widening(self) -> float:
        """Factor by which errors at held-out poses exceed their prediction.

        All intervals are widened by it.
        """
        return max(1.0, self.after.excess)

    @property
    def sigmas(self) -> FloatArray:
        """Standard deviations of the parameters, (p,).

        They are enlarged for three reasons: residuals above the stated errors, held-out errors
        above their prediction (`widening`), and few degrees of freedom (Student's t relative to the
        normal distribution).
        """
        scale = self.fit.scale
        if self.poses.sigma_m is not None:
            scale = max(1.0, scale)
        few = float(student.ppf(0.975, self.fit.freedom)) / 1.96
        own = np.sqrt(np.diag(self.fit.covariance))
        return np.asarray(scale * self.widening * few * own)

    @property
    def imprecise(self) -> tuple[int, ...]:
        """Joints whose compliance was fitted with a relative standard deviation above `PRECISE`."""
        return tuple(
            each.joint
            for each, value, sigma in zip(
                self.fit.parameters, self.values, self.sigmas, strict=True
            )
            if each.kind == "compliance" and sigma > PRECISE * value
        )

    @property
    def values(self) -> FloatArray:
        """Calibrated values of the parameters, (p,)."""
        return np.array([self.fit.arm.value(each) for each in self.fit.parameters])

    @property
    def changes(self) -> FloatArray:
        """Changes of the parameters from the nominal robot, (p,).

        For the base frame, they are relative to the best fit of the nominal robot.
        """
        return self.values - [self.nominal.value(each) for each in self.fit.parameters]


def calibrate(
    robot: RobotDescription,
    poses: MeasuredPoses,
    gravity: Gravity | None,
    point_m: FloatArray,
    check: MeasuredPoses | None = None,
) -> Calibration:
    """Identify geometry and compliance of an arm from the measured positions of one point.

    Gravity's direction in frame 0 is taken from the robot file. It is not estimated, because it
    affects the points only through the deflection of the gears.

    Args:
        robot: The nominal robot. Compliances that are not estimated have the values of the file.
        poses: Measured points.
        gravity: Torques at rest; None for rigid gears.
        point_m: Shape (3,). Nominal point in the frame of the last link.
        check: Poses that judge the result; if not given, each fifth of `poses` is predicted from
            the others.

    Raises:
        DataQualityError: There are too few poses, they do not determine the parameters, or the
            points are far from the geometry of the robot file.
        EstimationError: A fit fails.
    """
    nominal = nominal_arm(robot, gravity, point_m)
    geometry = geometry_candidates(nominal.chain, robot.joint_names)
    gears = compliance_candidates(nominal.chain, robot.joint_names) if gravity else ()
    probes = probe_positions(robot)
    no_load = np.zeros(len(probes))
    wanted = choose_identifiable(nominal.slopes(probes, no_load, geometry), geometry)
    _require_enough(poses, len(wanted))
    nominal = nominal.registered(poses.position, poses.point_m)
    candidates = (*geometry, *gears)
    slopes = nominal.slopes(poses.position, poses.load_kg, candidates)
    chosen = choose_identifiable(slopes, candidates)
    shown = [each for each in chosen if each.kind != "compliance"]
    if len(shown) < len(wanted):
        missing = [each.name for each in wanted if each not in shown]
        raise DataQualityError(
            f"{poses.name}: the {len(poses)} poses show {len(shown)} of {len(wanted)} geometric"
            f" parameters; not shown: {', '.join(missing)}: move every joint in the poses",
            code="RID-KINEMATICS-POSES",
        )
    _require_enough(poses, len(chosen))
    plain = [each for each in chosen if each.kind in ("frame", "point")]
    start = fit_arm(nominal, poses, plain)
    misfit = float(np.sqrt(np.mean(np.sum(start.residual_m**2, axis=1))))
    if misfit > LARGEST_MISFIT_M:
        raise DataQualityError(
            f"{poses.name}: the points differ from the robot file's geometry by"
            f" {1e3 * misfit:.0f} mm RMS, more than {1e3 * LARGEST_MISFIT_M:.0f} mm: check that"
            " joint positions, points and robot file belong together, and the signs and units",
            code="RID-KINEMATICS-POSES",
        )
    placed = start.arm
    fit = _fit_shown(placed, poses, chosen)
    spread = fit.scale * fit.point_sigma(probes, no_load).max()
    one = fit.scale * (1.0 if poses.sigma_m is None else float(np.median(poses.sigma_m)))
    if spread > LARGEST_SPREAD * one:
        raise DataQualityError(
            f"{poses.name}: a calibration with these {len(poses)} poses would predict the measured"
            f" point with an uncertainty of up to {1e3 * spread:.3g} mm (1 sigma) in other poses"
            f" within the joints' ranges, {spread / one:.3g} times that of one measurement"
            f" ({1e3 * one:.3g} mm): measure poses that are spread over the ranges",
            code="RID-KINEMATICS-POSES",
        )
    has_gears = any(each.kind == "compliance" for each in fit.parameters)
    rigid = [each for each in fit.parameters if each.kind != "compliance"]

    def held_out(start: PlacedArm, parameters: Sequence[KinematicParameter]) -> HeldOut:
        if check is not None:
            return judge(fit_arm(start, poses, parameters), check)
        return cross_validate(start, poses, parameters)

    after = held_out(fit.arm, fit.parameters)
    own = after if check is None else cross_validate(fit.arm, poses, fit.parameters)
    kept = {each.joint for each in fit.parameters if each.kind == "compliance"}
    return Calibration(
        robot,
        nominal,
        fit,
        len(wanted),
        scaled_condition(fit.arm.slopes(poses.position, poses.load_kg, fit.parameters)),
        tuple(each for each in geometry if each not in shown),
        tuple(name for joint, name in enumerate(robot.joint_names) if joint not in kept),
        held_out(placed, plain),
        held_out(placed, rigid) if has_gears else None,
        after,
        own,
        poses,
        check,
    )


def nominal_arm(robot: RobotDescription, gravity: Gravity | None, point_m: FloatArray) -> PlacedArm:
    """Return the arm of a robot file, with frame 0 as the instrument's frame.

    Args:
        robot: The robot; a stated gear stiffness is used if `gravity` is known.
        gravity: Torques at rest; None for rigid gears.
        point_m: Shape (3,). The point in the frame of the last link.
    """
    stiffness = [joint.stiffness_nm_rad for joint in robot.joints]
    compliance = np.array([0.0 if each is None else 1.0 / each for each in stiffness])
    chain = replace(Chain.from_description(robot), tool_m=np.array(point_m))
    return PlacedArm(chain, np.eye(3), np.zeros(3), compliance, gravity)


def probe_positions(robot: RobotDescription, count: int = _PROBES) -> FloatArray:
    """Return random poses within the joints' ranges, (count, n), the same for each call."""
    low = np.array([joint.limits.position_min for joint in robot.joints])
    high = np.array([joint.limits.position_max for joint in robot.joints])
    return np.random.default_rng(0).uniform(low, high, (count, len(low)))


def fewest_poses(parameters: int) -> int:
    """Return the number of poses that a calibration of some parameters needs at least."""
    part = (FOLDS - 1) / FOLDS
    return math.ceil((parameters + FEWEST_SPARE) / (3.0 * part))


def _require_enough(poses: MeasuredPoses, parameters: int) -> None:
    fewest, count = fewest_poses(parameters), len(np.unique(distinct_poses(poses.position)))
    if count < fewest:
        raise DataQualityError(
            f"{poses.name}: has {count} different poses; {parameters} parameters need at least"
            f" {fewest}, and {2 * fewest} are better: measure more poses",
            code="RID-KINEMATICS-FEW",
        )


def _fit_shown(
    start: PlacedArm, poses: MeasuredPoses, chosen: Sequence[KinematicParameter]
) -> ArmFit:
    """Fit, and hold compliances that are not larger than their uncertainty, one after another."""
    parameters = list(chosen)
    while True:
        fit = fit_arm(start, poses, parameters)
        sigma = fit.scale * np.sqrt(np.diag(fit.covariance))
        weak = [
            (fit.arm.compliance[each.joint] / sigma[column], column)
            for column, each in enumerate(parameters)
            if each.kind == "compliance"
        ]
        if not weak or min(weak)[0] >= SHOWN:
            return fit
        del parameters[min(weak)[1]]
