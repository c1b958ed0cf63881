"""Excitation by the two-harmonic heuristic (3.22): one low and one high harmonic per axis.

The low harmonic moves the joint through its range, and the high one causes accelerations.
Harmonics, amplitude fractions, offsets and phases are drawn from a seed. Each draw is within the
position, velocity and acceleration limits by construction; torques are not considered. Of the draws
without collisions, the one whose regressor has the smallest condition number (2.25, 2.26) is used.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from config.errors import ConfigError
from config.ranges import Harmonics, LimitFraction, PeriodS, Periods, Ranged, Seed, Tries
from config.robot.bodies import Workspace
from config.robot.robot import Joint, RobotDescription
from dynamics.geometry.clearances import Clearances
from dynamics.model.robot_model import RobotModel, regressor
from identification.model.base_parameters import BaseParameters, base_parameters

POINTS_PER_HIGHEST_HARMONIC = 8
DECIMALS = 6


@dataclass(frozen=True)
class TwoHarmonicOptions(Ranged):
    """Options of the random draws.

    Attributes:
        period_s: The period [s], a whole number of the cell's cycles.
        highest_harmonic: The highest harmonic of the period that may be used, at least 2.
        limit_fraction: Usable fraction of the position, velocity and acceleration limits.
        tries, seed: Number of draws that are compared, and their random seed.
        periods: Number of recorded periods of the motion.
    """

    period_s: PeriodS
    highest_harmonic: Harmonics = 8
    limit_fraction: LimitFraction = 0.85
    tries: Tries = 200
    seed: Seed = 0
    periods: Periods = 16


def design_two_harmonic(
    robot: RobotDescription,
    options: TwoHarmonicOptions,
    sample_period_s: float,
    *,
    workspace: Workspace | None = None,
) -> FourierMotion:
    """Design a periodic excitation and verify it, including its ramps.

    Args:
        robot: The robot with its limits.
        options: Options of the draws.
        sample_period_s: The cell's cycle time [s].
        workspace: Surroundings of the robot; its own bodies are in its description.

    Raises:
        ConfigError: The period is not a whole number of cycles, or no draw passes the verification.
    """
    model = RobotModel.from_description(robot)
    base = base_parameters(model)
    drawn = sorted(
        itertools.islice(two_harmonic_draws(robot, options), options.tries),
        key=lambda motion: _condition_number(robot, model, base, motion),
    )
    clearances = Clearances.of(robot, workspace)
    for motion in drawn:
        samples = motion.plan(robot, sample_period_s)
        if clearances.is_clear(samples.position):
            return motion
    raise ConfigError(
        f"none of {options.tries} draws stays clear of the robot's own bodies and of the"
        " workspace: use more --tries, or the method `optimal`, which avoids obstacles",
        code="RID-DESIGN-NONE",
    )


def two_harmonic_draws(
    robot: RobotDescription, options: TwoHarmonicOptions
) -> Iterator[FourierMotion]:
    """Yield random motions without end; `options.tries` is not used."""
    random = np.random.default_rng(options.seed)
    while True:
        yield FourierMotion(
            kind="fourier",
            robot=robot.name,
            period_s=options.period_s,
            periods=options.periods,
            joints=tuple(_draw(joint, options, random) for joint in robot.joints),
        )


def condition_number(robot: RobotDescription, motion: FourierMotion) -> float:
    """Return the condition number of a motion's base regressor (2.25, 2.26).

    Rows are divided by their joint's torque limit, columns by their length.
    """
    model = RobotModel.from_description(robot)
    return _condition_number(robot, model, base_parameters(model), motion)


def _condition_number(
    robot: RobotDescription, model: RobotModel, base: BaseParameters, motion: FourierMotion
) -> float:
    harmonics = max(len(joint.sine) for joint in motion.joints)
    points = POINTS_PER_HIGHEST_HARMONIC * harmonics
    trajectory = motion.trajectory(robot, motion.period_s / points)
    times = trajectory.sample_times_s
    phi = base.columns(
        regressor(
            model,
            trajectory.position(times),
            trajectory.velocity(times),
            trajectory.acceleration(times),
        )
    )
    torque = np.array([joint.limits.torque for joint in robot.joints])
    rows = (phi / torque[:, np.newaxis]).reshape(-1, len(base))
    size = np.linalg.norm(rows, axis=0)
    if (size == 0.0).any() or len(rows) < len(base):
        return math.inf
    singular = np.linalg.svd(rows / size, compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 0.0 else math.inf


def _draw(joint: Joint, options: TwoHarmonicOptions, random: np.random.Generator) -> FourierJoint:
    """Draw one joint's motion; its two harmonics share every limit, so that their sum fits."""
    limits, limit_fraction = joint.limits, options.limit_fraction
    highest_harmonic = options.highest_harmonic
    half_range = (limits.position_max - limits.position_min) / 2.0
    low = int(random.integers(1, max(1, highest_harmonic // 4) + 1))
    high = int(random.integers(max(low, highest_harmonic // 2) + 1, highest_harmonic + 1))
    share = float(random.uniform(0.4, 0.9))
    sine, cosine = np.zeros(high), np.zeros(high)
    total = 0.0
    for harmonic, part in ((low, share), (high, 1.0 - share)):
        omega = 2.0 * math.pi * harmonic / options.period_s
        largest = min(half_range, limits.velocity / omega, limits.acceleration / omega**2)
        amplitude = limit_fraction * part * largest
        phase = random.uniform(0.0, 2.0 * math.pi)
        sine[harmonic - 1] = amplitude * math.cos(phase)
        cosine[harmonic - 1] = amplitude * math.sin(phase)
        total += amplitude
    middle = (limits.position_max + limits.position_min) / 2.0
    room = max(0.0, limit_fraction * half_range - total)
    return FourierJoint(
        joint=joint.name,
        offset=round(middle + room * float(random.uniform(-1.0, 1.0)), DECIMALS),
        sine=tuple(np.round(sine, DECIMALS).tolist()),
        cosine=tuple(np.round(cosine, DECIMALS).tolist()),
    )
