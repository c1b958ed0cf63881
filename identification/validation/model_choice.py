"""`choose_model`: choice of a recording's torque channel and a robot's friction from the data.

The channel is estimated before the friction terms, with flexible friction, and again with the
chosen terms. Presliding and warming, which need nonlinear fits, are tried last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from acquisition.processing.torque_channel import ChannelKind, TorqueChannel
from config.arrays import BoolArray, FloatArray
from config.errors import EstimationError
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from identification.equations.block_grams import (
    PLAIN,
    Grams,
    columns_of_terms,
    speeds_of,
    term_of_column,
)
from identification.equations.bus_delay import RefusedChannel
from identification.equations.candidate_equations import CandidateEquations
from identification.equations.friction_columns import FLEXIBLE
from identification.equations.gear_load import with_gear_load
from identification.equations.segments import thin_rows
from identification.equations.warming import Warming
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.base_parameters import base_parameters
from identification.regression.nested_choice import joints_that_gain
from identification.validation.channel_choice import KINDS, choose_channel
from identification.validation.friction_choice import FrictionChoice, choose_terms
from identification.validation.held_out import held_out_errors, identified_values
from identification.validation.presliding_choice import PreslidingChoice, choose_presliding
from identification.validation.robot_terms import (
    with_friction,
    with_speeds,
)
from identification.validation.warming_choice import choose_warming

BLOCK_S: Final = 2.0
SHORTEST_BLOCK_S: Final = 1.0
BLOCKS: Final = 20
ROUNDS: Final = 2
STEPS: Final = 4
"""Steps of the progress: channel, friction, presliding, warm-up."""
DELAYS_ALONE: Final[tuple[ChannelKind, ...]] = ("none", "delay")

Watch = Callable[[int, int, str], None]
"""Progress function; arguments: finished steps, number of steps, name of the next step."""


@dataclass(frozen=True, eq=False)
class ModelChoice:
    """The chosen model.

    Attributes:
        joint_names: Joints from base to flange.
        terms: Friction terms of each joint, without presliding and temperature.
        stribeck_rad_s: Stribeck speed of each joint that has one [rad/s or m/s].
        thinning_rad_s: Speed of shear thinning of each joint that has it [rad/s or m/s].
        error_nm: Shape (2, n). RMS error of each joint on blocks left out of the fit, with Coulomb
            and viscous friction and with the chosen terms, both with the channel applied [N m or
            N].
        channel: Delay and filter of the recorded torque.
        presliding: Joints with presliding; None if the data do not identify it.
        warming: Joints that warm up; None if no joint shows it.
        refused: Delays and filters of the torques that are implausible and not in `channel`.
    """

    joint_names: tuple[str, ...]
    terms: tuple[tuple[FrictionTerm, ...], ...]
    stribeck_rad_s: tuple[float | None, ...]
    thinning_rad_s: tuple[float | None, ...]
    error_nm: FloatArray
    channel: TorqueChannel
    presliding: PreslidingChoice | None = None
    warming: Warming | None = None
    refused: RefusedChannel = field(default_factory=RefusedChannel)

    def robot(self, robot: RobotDescription) -> RobotDescription:
        """Return a robot with the chosen friction."""
        robot = with_speeds(with_friction(robot, self.terms), "stribeck", self.stribeck_rad_s)
        robot = with_speeds(robot, "shear_thinning", self.thinning_rad_s)
        robot = robot if self.presliding is None else self.presliding.robot(robot)
        return robot if self.warming is None else self.warming.robot(robot)


def choose_model(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions | None = None,
    *,
    kinds: Sequence[ChannelKind] = tuple(KINDS),
    watch: Watch | None = None,
) -> ModelChoice:
    """Choose the torque channel and each joint's friction.

    Args:
        robot: The robot; its own friction terms are ignored.
        signals: The recordings of the training runs; never those of the validation.
        options: The other terms of the model, and the speed above which a joint counts as moving.
        kinds: Kinds of channel to try, from the simplest to the richest; the first is "none".
        watch: Function to call with the progress.

    Raises:
        EstimationError: The recordings are too short, or do not identify Coulomb and viscous
            friction.
    """
    options = options or EstimationOptions()
    tell = watch or (lambda done, steps, name: None)
    tell(0, STEPS, "torque channel and friction")
    chosen = _channel_and_friction(robot, signals, options, kinds)
    known = [replace(run, channel=chosen.channel) for run in signals]
    tell(2, STEPS, "presliding")
    with suppress(EstimationError):  # presliding is left out if it cannot be identified
        presliding = choose_presliding(chosen.robot(robot), known, options)
        chosen = _confirm_stribeck(replace(chosen, presliding=presliding), robot, known, options)
    tell(3, STEPS, "warm-up")
    with suppress(EstimationError):
        chosen = replace(chosen, warming=choose_warming(chosen.robot(robot), known, options))
    return chosen


def _confirm_stribeck(
    chosen: ModelChoice,
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions,
) -> ModelChoice:
    """Return a choice in which joints with presliding keep Stribeck friction only if confirmed.

    Presliding and Stribeck friction have similar effects at a reversal. Therefore Stribeck friction
    is tested again, together with presliding.
    """
    assert chosen.presliding is not None
    both = [
        speed is not None and distance is not None
        for speed, distance in zip(chosen.stribeck_rad_s, chosen.presliding.distances, strict=True)
    ]
    if not any(both):
        return chosen
    speeds = [
        None if twice else speed for twice, speed in zip(both, chosen.stribeck_rad_s, strict=True)
    ]
    without = replace(
        chosen,
        stribeck_rad_s=tuple(speeds),
        terms=tuple(
            tuple(term for term in own if not twice or term != "stribeck")
            for own, twice in zip(chosen.terms, both, strict=True)
        ),
    )
    parts = [thin_rows(run) for run in signals]
    plain, full = (fit_smoothed(each.robot(robot), parts, options) for each in (without, chosen))
    shown = identified_values(full.estimate(), held_out_errors(plain, full), "vs")
    kept = [not twice or value is not None for twice, value in zip(both, shown, strict=True)]
    confirmed = replace(
        chosen,
        stribeck_rad_s=tuple(
            speed if keep else None for speed, keep in zip(chosen.stribeck_rad_s, kept, strict=True)
        ),
        terms=tuple(
            old if keep else new
            for old, new, keep in zip(chosen.terms, without.terms, kept, strict=True)
        ),
    )
    return _confirm_thinning(confirmed, ~np.array(kept), robot, parts, options)


def _confirm_thinning(
    chosen: ModelChoice,
    lost: BoolArray,
    robot: RobotDescription,
    parts: Sequence[SmoothedSignals],
    options: EstimationOptions,
) -> ModelChoice:
    """Return a choice in which joints in `lost` keep shear thinning only if confirmed.

    Shear thinning was chosen together with Stribeck friction, and one of the two curves can
    compensate the other. Therefore it is tested again after Stribeck friction was removed.

    Args:
        lost: Shape (n,). True for joints that lost Stribeck friction.
    """
    doubtful = lost & np.array([speed is not None for speed in chosen.thinning_rad_s])
    if not doubtful.any():
        return chosen
    viscous = _with_viscous(chosen, doubtful)
    plain, thin = (fit_smoothed(each.robot(robot), parts, options) for each in (viscous, chosen))
    return _with_viscous(chosen, doubtful & ~joints_that_gain(*held_out_errors(plain, thin)))


def _with_viscous(chosen: ModelChoice, joints: BoolArray) -> ModelChoice:
    """Return a choice in which viscous friction replaces the shear thinning of some joints."""
    return replace(
        chosen,
        thinning_rad_s=tuple(
            None if changes else speed
            for speed, changes in zip(chosen.thinning_rad_s, joints, strict=True)
        ),
        terms=tuple(
            tuple("viscous" if changes and term == "shear_thinning" else term for term in own)
            for own, changes in zip(chosen.terms, joints, strict=True)
        ),
    )


def first_channel(
    robot: RobotDescription, signals: Sequence[SmoothedSignals], options: EstimationOptions
) -> TorqueChannel:
    """Return the torque channel that the data show with flexible friction.

    Args:
        robot: The robot; its own friction terms are ignored.
        signals: The recordings.
        options: The other terms of the model, and the speed above which a joint counts as moving.

    Raises:
        EstimationError: The recordings are too short, or do not identify Coulomb and viscous
            friction.
    """
    return _first_channel(robot, signals, options, tuple(KINDS))[2]


def _first_channel(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions,
    kinds: Sequence[ChannelKind],
) -> tuple[CandidateEquations, float, TorqueChannel]:
    """Return the equations, the length of a block [s], and the channel with flexible friction."""
    plain = replace(options.model, friction=False, friction_terms=None, nonlinear=None)
    model = plain.build(robot)
    base = base_parameters(model)
    equations = CandidateEquations.of(model, base, signals, options.standstill_rad_s)
    n, terms = equations.joints, (PLAIN,) * equations.joints
    block_s = float(np.clip(equations.duration_s / BLOCKS, SHORTEST_BLOCK_S, BLOCK_S))
    grams = _grams(equations, TorqueChannel.none(n), block_s)
    equations = with_gear_load(equations, grams, terms, TorqueChannel.none(n), block_s)
    return equations, block_s, choose_channel(equations, [FLEXIBLE] * n, block_s, kinds)


def _channel_and_friction(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions,
    kinds: Sequence[ChannelKind],
) -> ModelChoice:
    equations, block_s, channel = _first_channel(robot, signals, options, kinds)
    terms = (PLAIN,) * equations.joints
    rounds = 0
    while True:
        rounds += 1
        grams = _grams(equations, channel, block_s)
        equations = with_gear_load(equations, grams, terms, channel, block_s)
        grams = _grams(equations, channel, block_s)
        friction = choose_terms(grams)
        equations = with_gear_load(equations, grams, friction.terms, channel, block_s)
        columns = [columns_of_terms(own) for own in friction.terms]
        before, channel = channel, choose_channel(equations, columns, block_s, kinds, channel)
        settled = channel.kind == before.kind and friction.terms == terms
        terms = friction.terms
        if settled or rounds == ROUNDS:
            break
    return _choice(robot, friction, channel, grams.scale_nm)


def _grams(equations: CandidateEquations, channel: TorqueChannel, block_s: float) -> Grams:
    try:
        return Grams.of(equations, channel, block_s)
    except np.linalg.LinAlgError:
        raise EstimationError(
            "the motion does not identify a model with Coulomb and viscous friction: record a"
            " motion that moves every joint",
            code="RID-MOTION-UNINFORMATIVE",
        ) from None


def _choice(
    robot: RobotDescription, friction: FrictionChoice, channel: TorqueChannel, scale_nm: FloatArray
) -> ModelChoice:
    errors = [np.nanmean(fit.errors, axis=0) for fit in (friction.plain, friction.fit)]
    return ModelChoice(
        joint_names=robot.joint_names,
        terms=tuple(tuple(term_of_column(term) for term in own) for own in friction.terms),
        stribeck_rad_s=tuple(
            next(iter(speeds_of(own, "stribeck")), None) for own in friction.terms
        ),
        thinning_rad_s=tuple(
            next(iter(speeds_of(own, "shear_thinning")), None) for own in friction.terms
        ),
        error_nm=np.sqrt(errors) * scale_nm,
        channel=channel,
    )
