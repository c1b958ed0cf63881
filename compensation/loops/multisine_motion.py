"""A multisine motion for a cell, as large as the robot's limits comfortably allow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from acquisition.motion.kinds.multisine import MultisineJoint, MultisineMotion
from acquisition.motion.samples import MotionSamples
from compensation.loops.frequency_response import ONE_REALISATION
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.ranges import FrequencyHz, PeriodS, Periods, Ranged, Realisations, Seed
from config.robot.robot import RobotDescription
from dynamics.geometry.clearances import Clearances
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import torque
from identification.design.model import design_model
from identification.estimation.estimate import Estimate
from identification.estimation.limit_torque import limit_torque

PERIOD_S: Final = 8.0
LOWEST_HZ: Final = 0.5
SHARE_OF_FILTER: Final = 0.5
SHARE_OF_CYCLE: Final = 1.0 / 6.0
SHARE_OF_ACCELERATION: Final = 0.5
SHARE_OF_RANGE: Final = 0.04
SHARE_OF_SPEED: Final = 0.2
LARGEST_USE: Final = 0.8
SMALLER: Final = 0.8
ATTEMPTS: Final = 16
POSES: Final = 2000
PATH_STRIDE: Final = 10


def velocity_loop_band_hz(cell: CellConfig) -> tuple[float, float]:
    """Return the lowest and the highest frequency that multisines of a cell have [Hz].

    What the cell file states; else up to half the torque filter's cutoff, or to a sixth of the
    cycle's frequency where that is less: as high as torque is measured and commands are followed.
    """
    if cell.velocity_loop_band_hz is not None:
        return cell.velocity_loop_band_hz
    highest = SHARE_OF_CYCLE / cell.cycle_time_s
    if cell.torque_filter is not None:
        highest = min(highest, SHARE_OF_FILTER * cell.torque_filter.cutoff_hz)
    return LOWEST_HZ, highest


@dataclass(frozen=True)
class MultisineOptions(Ranged):
    """What multisines are asked for.

    Attributes:
        band_hz: Lowest and highest frequency [Hz]; the cell's (`velocity_loop_band_hz`), if None.
        period_s: The period [s], whole cycles; some 8 s, if None.
        periods, realisations: How many count.
        grid, phases: As in `MultisineMotion`.
        slow: Whether there is a slow sine beneath.
        seed: Of phases, of the lines left empty, and of poses where the middle of the ranges
            touches.
    """

    band_hz: tuple[FrequencyHz, FrequencyHz] | None = None
    period_s: PeriodS | None = None
    periods: Periods = 4
    realisations: Realisations = 4
    grid: Literal["odd", "random_odd", "full"] = "random_odd"
    phases: Literal["random", "schroeder"] = "random"
    slow: bool = True
    seed: Seed = 0


def multisine_motion(
    robot: RobotDescription,
    cell: CellConfig,
    options: MultisineOptions,
    estimate: Estimate | None = None,
) -> MultisineMotion:
    """Return a multisine about the middle of every joint's range, verified within the limits.

    RMS speeds start where half of the joint's acceleration would be needed at the highest line. A
    joint's multisine shrinks until speed, acceleration and torque stay within 80 % of their limits;
    the slow sine beneath it, which keeps friction from sticking most of the time, where position
    limits or clearances ask for it. Torque is held where a model or the robot's `cad` tells it.

    Args:
        cell: Cycle time, band, workspace.
        options: What is asked for.
        estimate: A model, for the torque limits.

    Raises:
        ConfigError: Not even a small one holds the limits, or period and band do not suit the cell.
    """
    cycle_s, period_s, seed = cell.cycle_time_s, options.period_s, options.seed
    realisations, band_hz = options.realisations, options.band_hz
    if period_s is None:
        period_s = round(round(PERIOD_S / cycle_s) * cycle_s, 6)
    lowest_hz, highest_hz = velocity_loop_band_hz(cell) if band_hz is None else band_hz
    if not 0.0 < lowest_hz < highest_hz < 0.5 / cycle_s:
        raise ConfigError(
            f"a band from {lowest_hz:g} to {highest_hz:g} Hz: it must rise, from above 0 to below"
            f" half the cycle's frequency, {0.5 / cycle_s:g} Hz",
            code="RID-MOTION-BAND",
        )
    if lowest_hz * period_s < 2.0 - 1e-9:
        raise ConfigError(
            f"a band from {lowest_hz:g} Hz needs a period of at least {2.0 / lowest_hz:g} s, it is"
            f" {period_s:g} s: the first harmonic is the slow sine's",
            code="RID-MOTION-BAND",
        )
    if options.phases == "schroeder" and realisations > 1:
        raise ConfigError(
            f"Schroeder's phases are the same in all {realisations} realisations: ask for one, or"
            " for random phases",
            code="RID-OPTION-EXCLUSIVE",
        )
    if realisations == 1 and options.grid != "random_odd":
        raise ConfigError(
            f"one realisation on grid {options.grid} leaves no odd line empty, and does not show"
            " what distortion adds to the response: take --grid random_odd, or two realisations or"
            " more",
            code=ONE_REALISATION,
        )
    limits = [joint.limits for joint in robot.joints]
    speed = SHARE_OF_ACCELERATION * np.array([each.acceleration for each in limits])
    speed /= 2.0 * math.pi * highest_hz
    swing = np.array(
        [
            min(
                SHARE_OF_RANGE * (each.position_max - each.position_min),
                SHARE_OF_SPEED * each.velocity * period_s / (2.0 * math.pi),
            )
            for each in limits
        ]
    )
    swing *= float(options.slow)
    clearances = Clearances.of(robot, cell.workspace)
    low = np.array([each.position_min for each in limits])
    high = np.array([each.position_max for each in limits])
    middle = 0.5 * (low + high)
    drawn = np.random.default_rng(seed).uniform(-0.3, 0.3, (POSES, len(low)))
    pose = clearances.clear_pose(middle, middle + drawn * (high - low), robot.name)
    reason = ""
    for _ in range(ATTEMPTS):
        motion = MultisineMotion(
            kind="multisine",
            robot=robot.name,
            period_s=period_s,
            lowest_hz=lowest_hz,
            highest_hz=highest_hz,
            grid=options.grid,
            phases=options.phases,
            seed=seed,
            realisations=realisations,
            periods=options.periods,
            joints=tuple(
                MultisineJoint(
                    joint=joint.name,
                    offset=round(float(at), 6),
                    velocity=round(float(rms), 6),
                    slow_amplitude=round(float(amplitude), 6),
                )
                for joint, at, rms, amplitude in zip(robot.joints, pose, speed, swing, strict=True)
            ),
        )
        try:
            samples = motion.plan(robot, cycle_s)
        except ConfigError as error:
            reason = str(error)
            speed, swing = SMALLER * speed, SMALLER * swing
            continue
        if not clearances.is_clear(samples.position[::PATH_STRIDE]):
            reason = "the robot comes too near to itself or to the workspace"
            speed, swing = SMALLER * speed, SMALLER * swing
            continue
        use = limit_use(samples, robot, estimate).max(axis=1)
        if (use <= LARGEST_USE).all():
            return motion
        reason = f"limits are used by {', '.join(f'{100.0 * x:.0f}' for x in use)} % of them"
        speed = np.where(use > LARGEST_USE, SMALLER * speed, speed)
    raise ConfigError(
        f"no multisine holds the limits of robot {robot.name!r}: {reason}", code="RID-DESIGN-NONE"
    )


def limit_use(
    samples: MotionSamples, robot: RobotDescription, estimate: Estimate | None = None
) -> FloatArray:
    """Return the largest share of speed, acceleration and torque limit that a motion uses.

    Returns:
        Shape (joints, 3). Torque is 0 where neither a model nor the robot's `cad` tells it.
    """
    moved = (samples.position, samples.velocity, samples.acceleration)
    torque_nm = np.zeros_like(samples.position)
    if estimate is not None:
        torque_nm = limit_torque(estimate, *moved)
    elif robot.cad is not None:
        model = design_model(robot)
        torque_nm = torque(model, *moved, cad_parameters(model, robot)[0])
    limits = np.array(
        [[x.limits.velocity, x.limits.acceleration, x.limits.torque] for x in robot.joints]
    )
    used = [np.abs(values).max(axis=0) for values in (*moved[1:], torque_nm)]
    return np.asarray(np.array(used).T / limits)
