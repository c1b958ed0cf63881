"""`retime_path`: the fastest timing of a motion that keeps all limits, by an identified model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acquisition.motion.kinds.timed_path import TimedPathMotion, TimedWay
from acquisition.motion.samples import MotionSamples
from compensation.timing.joint_curve import curves_of
from compensation.timing.limits import TimingLimits
from compensation.timing.timed_path import INTERVALS, PathTimer, TimedPath
from compensation.timing.uncertainty import ModelMargin
from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from dynamics.model.one_sample import SampleTorque
from identification.calibration.base_reaction import weight_parameters, with_known_mass
from identification.estimation.estimate import Estimate

INTERVALS_A_RAD = 200
MOST_INTERVALS = 20_000


@dataclass(frozen=True, eq=False)
class TimedMotion:
    """A retimed motion, compared with the original.

    Attributes:
        motion: Content of its motion file.
        ways: Its parts from rest to rest.
        moving_s, original_s: Duration of the motion after and before retiming, without rests [s].
        off: Largest deviation of a joint of the curve from the original motion [rad or m].
        was_periodic: True if the original motion had periods. The retimed motion has none: its
            parts end at rests and at turning points.
        places: For each part, the path lengths of its rows in the original motion.
    """

    motion: TimedPathMotion
    ways: tuple[TimedPath, ...]
    moving_s: float
    original_s: float
    off: float
    was_periodic: bool = False
    places: tuple[FloatArray, ...] = ()

    @property
    def shorter(self) -> float:
        """Fraction of the original duration that is saved."""
        return 1.0 - self.moving_s / self.original_s


def with_robot_weight(estimate: Estimate, mass_kg: float | None) -> Estimate:
    """Return an estimate whose base wrench includes the robot's known weight.

    A force plate cannot distinguish the weight from its offset.

    Args:
        estimate: An estimate of the external or the combined model.
        mass_kg: Mass of all bodies on the base [kg] (default: from the robot's drawings, otherwise
            0).

    Raises:
        EstimationError: The estimate is of the internal model.
    """
    values, covariance, _ = with_known_mass(estimate, mass_kg)
    noise = estimate.covariance_noise
    if noise is not None:
        noise = noise.copy()
        constant = weight_parameters(estimate)
        noise[constant] = noise[:, constant] = 0.0
    return replace(estimate, values=values, covariance_jackknife=covariance, covariance_noise=noise)


def retime_path(
    samples: MotionSamples,
    robot: RobotDescription,
    estimate: Estimate,
    limits: TimingLimits,
    *,
    confidence: float = 0.0,
) -> TimedMotion:
    """Return a motion's path, from rest to rest, as fast as the limits allow.

    Args:
        samples: The motion as planned.
        estimate: Model of the robot.
        limits: Limits to keep.
        confidence: Probability that torques and base wrench of the robot are within their limits at
            any one instant; 0 for no margin.

    Raises:
        ConfigError: The motion does not move, or the limits include a base wrench that the model
            does not predict.
        EstimationError: The model depends on the drives' temperature.
        LimitError: A limit cannot be kept; the message names the limit and the place.
    """
    if limits.base is not None and estimate.options.kind == "internal":
        raise ConfigError(
            "the internal model does not predict the base wrench: identify the combined model,"
            " from a run with a force plate",
            code="RID-MODEL-NOT-COMBINED",
        )
    speeds = [joint.limits.velocity for joint in robot.joints]
    rest_s, ways = curves_of(samples, speeds)
    margin = None
    if confidence:
        margin = ModelMargin(estimate, confidence, limits.base is not None)
    timer = PathTimer(
        robot,
        SampleTorque.of(estimate.model, estimate.standard_values),
        limits,
        samples.sample_period_s,
        margin,
        positions_alone=True,
    )
    paths, files = [], []
    for way in ways:
        points = np.asarray(way.curve.at(np.asarray(way.curve.curve.x))[0])
        travel = float(np.abs(np.diff(points, axis=0)).sum(axis=0).max())
        intervals = int(np.clip(INTERVALS_A_RAD * travel, INTERVALS, MOST_INTERVALS))
        found = replace(timer, intervals=intervals).timed(way.curve)
        rows = found.in_time
        paths.append(found)
        files.append(
            TimedWay(
                points=tuple(map(tuple, points.tolist())),
                length=tuple(np.asarray(way.curve.curve.x).tolist()),
                place=tuple(rows.length.tolist()),
                speed=tuple(rows.speed.tolist()),
                acceleration=tuple(rows.change.tolist()),
                rest_s=way.rest_s,
            )
        )
    step_s = samples.sample_period_s
    motion = TimedPathMotion(
        kind="timed_path", robot=robot.name, cycle_time_s=step_s, rest_s=rest_s, ways=tuple(files)
    )
    rests_s = rest_s + sum(way.rest_s for way in ways)
    return TimedMotion(
        motion=motion,
        ways=tuple(paths),
        moving_s=sum(len(way.torque) - 1 for way in paths) * step_s,
        original_s=samples.whole().duration_s - rests_s,
        off=max(way.off for way in ways),
        was_periodic=samples.periods > 0,
        places=tuple(way.place for way in ways),
    )
