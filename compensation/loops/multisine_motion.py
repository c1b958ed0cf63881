"""Design of a cell's multisine motion, as large as the robot's limits allow with a margin."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from acquisition.motion.kinds.multisine import MultisineJoint, MultisineMotion
from acquisition.motion.samples import MotionSamples
from compensation.loops.frequency_response import ONE_REALISATION
from compensation.loops.velocity_loop import FEWEST_LINES
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.ranges import FrequencyHz, PeriodS, Periods, Ranged, Realisations, Seed
from config.robot.robot import RobotDescription
from dynamics.geometry.clearances import Clearances
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import torque
from identification.design.model import design_model
from identification.elasticity.limit_torque import limit_torque
from identification.estimation.estimate import Estimate

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
    """Return the lowest and highest frequency of multisines for a cell [Hz].

    If the cell file has no band, the band begins at 0.5 Hz. It ends at the lower of two
    frequencies: half the cutoff frequency of the torque filter, up to which the torque is measured,
    and a sixth of the cycle frequency, up to which the drives follow commands.
    """
    if cell.velocity_loop_band_hz is not None:
        return cell.velocity_loop_band_hz
    highest = SHARE_OF_CYCLE / cell.cycle_time_s
    if cell.torque_filter is not None:
        highest = min(highest, SHARE_OF_FILTER * cell.torque_filter.cutoff_hz)
    return LOWEST_HZ, highest


@dataclass(frozen=True)
class MultisineOptions(Ranged):
    """Options of a multisine.

    Attributes:
        band_hz: Lowest and highest frequency [Hz] (default: `velocity_loop_band_hz`).
        period_s: Period [s], a whole number of cycles (default: about 8 s).
        periods, realisations: Numbers of measured periods and realisations.
        grid, phases: As in `MultisineMotion`.
        slow: True to add a slow sine, which reduces stiction.
        seed: Random seed of phases and empty lines, and of poses if bodies touch in the middle of
            the ranges.
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
    """Return a multisine at or near the middle of the joints' ranges, checked against the limits.

    The first attempt has the RMS speed that needs half of the joint's acceleration limit at the
    highest line. A joint's multisine is then reduced until speed, acceleration and torque stay
    within 80 % of their limits. Unless `options.slow` is False, a slow sine is added, which keeps
    the joint from sticking most of the time. If a position limit or a clearance is violated,
    multisine and slow sine are both reduced. Torque is checked if a model or the robot's `cad`
    predicts it.

    Args:
        cell: The cell, with cycle time, band and workspace.
        options: Options of the multisine.
        estimate: Model that predicts the torques (default: the robot's `cad`, if it has one).

    Raises:
        ConfigError: Even the smallest tried multisine exceeds the limits, bodies touch in all tried
            poses, options exclude one another, or period and band do not fit the cell or give a
            joint too few lines.
    """
    cycle_s, period_s, seed = cell.cycle_time_s, options.period_s, options.seed
    realisations, band_hz = options.realisations, options.band_hz
    if period_s is None:
        period_s = round(round(PERIOD_S / cycle_s) * cycle_s, 6)
    lowest_hz, highest_hz = velocity_loop_band_hz(cell) if band_hz is None else band_hz
    if not 0.0 < lowest_hz < highest_hz < 0.5 / cycle_s:
        raise ConfigError(
            f"invalid band {lowest_hz:g} to {highest_hz:g} Hz: choose a rising band between 0 and"
            f" half the cycle frequency, {0.5 / cycle_s:g} Hz",
            code="RID-MOTION-BAND",
        )
    if lowest_hz * period_s < 2.0 - 1e-9:
        raise ConfigError(
            f"a band from {lowest_hz:g} Hz needs a period of at least {2.0 / lowest_hz:g} s,"
            " because the first harmonic is reserved for the slow sine; the period is"
            f" {period_s:g} s: give a longer one",
            code="RID-MOTION-BAND",
        )
    if options.phases == "schroeder" and realisations > 1:
        raise ConfigError(
            f"Schroeder phases are equal in all {realisations} realisations: use one realisation"
            " or random phases",
            code="RID-OPTION-EXCLUSIVE",
        )
    if realisations == 1 and options.grid != "random_odd":
        raise ConfigError(
            f"one realisation on grid {options.grid} has no empty odd line and does not show the"
            " error that distortion causes in the response: use --grid random_odd, or at least"
            " two realisations",
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
        _require_lines(motion, robot)
        try:
            samples = motion.plan(robot, cycle_s)
        except ConfigError as error:
            reason = str(error)
            speed, swing = SMALLER * speed, SMALLER * swing
            continue
        if not clearances.is_clear(samples.position[::PATH_STRIDE]):
            reason = "the robot comes too close to itself or to the workspace"
            speed, swing = SMALLER * speed, SMALLER * swing
            continue
        use = limit_use(samples, robot, estimate).max(axis=1)
        if (use <= LARGEST_USE).all():
            return motion
        reason = f"the joints use {', '.join(f'{100.0 * x:.0f}' for x in use)} % of their limits"
        speed = np.where(use > LARGEST_USE, SMALLER * speed, speed)
    raise ConfigError(
        f"no multisine stays within the limits of robot {robot.name!r}: {reason}",
        code="RID-DESIGN-NONE",
    )


def _require_lines(motion: MultisineMotion, robot: RobotDescription) -> None:
    """Refuse a multisine with too few lines for the fit of a velocity loop.

    Raises:
        ConfigError: A joint has fewer than `FEWEST_LINES` lines.
    """
    lines = [len(own) for own in motion.excited_lines(robot)]
    if min(lines) < FEWEST_LINES:
        raise ConfigError(
            f"{robot.joint_names[int(np.argmin(lines))]} would have {min(lines)} lines between"
            f" {motion.lowest_hz:g} and {motion.highest_hz:g} Hz, but the fit of a velocity loop"
            f" needs at least {FEWEST_LINES}: give a longer period than {motion.period_s:g} s, or a"
            " wider band",
            code="RID-MOTION-BAND",
        )


def limit_use(
    samples: MotionSamples, robot: RobotDescription, estimate: Estimate | None = None
) -> FloatArray:
    """Return the largest fraction of each speed, acceleration and torque limit that a motion uses.

    Returns:
        Shape (joints, 3). Torque is 0 if neither a model nor the robot's `cad` predicts it.
    """
    moved = (samples.position, samples.velocity, samples.acceleration)
    torque_nm = np.zeros_like(samples.position)
    if estimate is not None:
        torque_nm = limit_torque(estimate, *moved, samples.sample_period_s)
    elif robot.cad is not None:
        model = design_model(robot)
        torque_nm = torque(model, *moved, cad_parameters(model, robot)[0])
    limits = np.array(
        [[x.limits.velocity, x.limits.acceleration, x.limits.torque] for x in robot.joints]
    )
    used = [np.abs(values).max(axis=0) for values in (*moved[1:], torque_nm)]
    return np.asarray(np.array(used).T / limits)
