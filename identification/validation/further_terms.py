"""Friction terms and torque filters that a model lacks, found by predictions of held-out data."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.errors import EstimationError
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from identification.equations.bus_delay import RefusedChannel, split_implausible_channel
from identification.equations.segments import thin_rows
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.validation.held_out import held_out_errors
from identification.validation.model_choice import first_channel

ASKED: Final[tuple[FrictionTerm, ...]] = ("offset", "cubic", "load")
LEAST_GAIN: Final = 0.1
"""Smallest relative decrease of the RMS error on held-out data by a useful term."""
SIGMAS: Final = 2.0
FEWEST_SECONDS: Final = 10


def further_term_findings(
    robot: RobotDescription, signals: Sequence[SmoothedSignals], options: EstimationOptions
) -> tuple[str, ...]:
    """Name joints whose torque on held-out data is predicted better with a further friction term.

    A term counts if the squared error per second falls by more than two standard errors, and the
    RMS error by at least a tenth.

    Args:
        robot: The robot with the terms that were identified.
        signals: The recordings.
        options: The options of the estimate. If they contain friction terms instead of those of the
            robot file, no further terms are tried.
    """
    if not options.model.friction or options.model.friction_terms is not None:
        return ()
    parts = [thin_rows(run) for run in signals]
    asked: dict[str, list[str]] = {}
    try:
        plain = fit_smoothed(robot, parts, options)
        for term in ASKED:
            joints = tuple(
                joint
                if term in joint.friction
                else joint.model_copy(update={"friction": (*joint.friction, term)})
                for joint in robot.joints
            )
            full = fit_smoothed(robot.model_copy(update={"joints": joints}), parts, options)
            errors = held_out_errors(plain, full)
            for j, joint in enumerate(robot.joints):
                own = errors[:, :, j]
                own = own[:, np.isfinite(own.sum(axis=0))]
                if term in joint.friction or own.shape[1] < FEWEST_SECONDS:
                    continue
                gain = own[0] - own[1]
                sure = gain.mean() > SIGMAS * np.std(gain, ddof=1) / math.sqrt(len(gain))
                before, after = np.sqrt(own.mean(axis=1))
                if sure and after < (1.0 - LEAST_GAIN) * before:
                    asked.setdefault(joint.name, []).append(f"{term} ({before:.3g} to {after:.3g})")
    except EstimationError:  # the recording is too short, or does not determine the terms
        return ()
    if not asked:
        return ()
    shown = "; ".join(
        f"{name}: {', '.join(asked[name])}" for name in robot.joint_names if name in asked
    )
    return (
        "Further friction terms predict held-out parts of the runs better than the terms of the"
        f" robot file. Joint, term, and RMS error [N m or N] without and with it: {shown}."
        " `rid-daq identify --choose` compares these terms and uses those that help.",
    )


def filter_findings(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions,
    known: Collection[str] = (),
) -> tuple[str, ...]:
    """Name joints whose recorded torque passed a filter, as `--choose` would find it.

    Args:
        robot: The robot.
        signals: The recordings, not periodic and with a known clock.
        options: The options of the estimate.
        known: Joints whose filter or delay another finding already names.
    """
    try:
        channel = first_channel(robot, signals, options)
    except EstimationError:  # the recording is too short, or does not determine the friction
        return ()
    channel, refused = split_implausible_channel(channel, signals[0].sample_period_s)
    new = np.array([name not in known for name in robot.joint_names])
    time_s = np.where(new, np.maximum(channel.lag_s, channel.width_s), 0.0)
    slow = RefusedChannel(
        filter_s=tuple(
            own if is_new else 0.0 for own, is_new in zip(refused.filter_s, new, strict=True)
        )
    )
    filtered = np.flatnonzero(time_s)
    if not len(filtered):
        return slow.findings(robot.joint_names)
    shown = ", ".join(
        f"{robot.joint_names[j]} at {1.0 / (2.0 * np.pi * time_s[j]):.2g} Hz" for j in filtered
    )
    phase = "without a delay (a zero-phase filter)" if np.any(channel.width_s) else "first order"
    return (
        f"The recorded torques seem to be low-passed, {phase}: {shown}. The parameters contain the"
        " filter's effect. Record the torques without this filter, or estimate it with"
        " `rid-daq identify --choose`.",
        *slow.findings(robot.joint_names),
    )
