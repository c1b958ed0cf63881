"""`PlateZeroSection`: a force plate's offsets with their uncertainty, and whether they hold."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from acquisition.recording.plate_geometry import WRENCH_NAMES, WRENCH_UNITS
from config.cell.plate import CHANNEL_NAMES, PlateConfig, PlateZero
from rid_daq.blocks.formats import format_measured
from rid_daq.report.sections.section import Numbers, Section, Texts
from rid_daq.report.sections.verdict import VerdictCheck, VerdictSection

if TYPE_CHECKING:
    from acquisition.plate_zero.plate_zero import PlateOffset, ZeroTurn

DIGITS = 4
"""Decimals of a zero in a cell file: a tenth of a millinewton."""


class ChannelZero(Section):
    """The offset [N] and the drift [N/s] of a channel, with standard deviations."""

    name: str
    offset_n: float
    offset_std_n: float
    drift_n_s: float
    drift_std_n_s: float


class GravityComponent(Section):
    """A component of gravity's wrench in the first pose, with its standard deviation, in `unit`."""

    name: str
    unit: str
    value: float
    std: float


class PlateZeroSection(Section):
    """The channels, the moment of gravity, and how they were told apart.

    Attributes:
        sentences: In words.
        turn_degrees: By how much axis 1 was turned.
        first_pose, second_pose: The poses of the readings [rad or m].
        seconds: How long all of it took [s].
        channels: One a channel.
        gravity: One a component of the wrench.
    """

    sentences: Texts
    turn_degrees: float
    first_pose: Numbers
    second_pose: Numbers
    seconds: float
    channels: tuple[ChannelZero, ...]
    gravity: tuple[GravityComponent, ...]

    @classmethod
    def of(cls, found: PlateOffset, turn: ZeroTurn) -> PlateZeroSection:
        """Return what the readings show."""
        degrees = math.degrees(turn.turn_rad)
        return cls(
            sentences=(
                f"Axis 1 was turned by {degrees:.0f} degrees and back, {found.seconds:.0f} s in"
                f" all. {_how(turn)}",
                f"Gravity's moment in the first pose: {_moment(found)}. The robot's weight is taken"
                " for offset.",
            ),
            turn_degrees=degrees,
            first_pose=tuple(turn.first.tolist()),
            second_pose=tuple(turn.second.tolist()),
            seconds=found.seconds,
            channels=ChannelZero.for_each(
                name=CHANNEL_NAMES,
                offset_n=found.offset_n,
                offset_std_n=found.offset_sigma_n,
                drift_n_s=found.drift_n_s,
                drift_std_n_s=found.drift_sigma_n_s,
            ),
            gravity=GravityComponent.for_each(
                name=WRENCH_NAMES, unit=WRENCH_UNITS, value=found.gravity, std=found.gravity_sigma
            ),
        )


def as_zero(found: PlateOffset, turn: ZeroTurn) -> PlateZero:
    """Return what was found as a cell file's `plate.zero`."""
    offset, drift, pose, rest = (
        tuple(round(value, digits) for value in values.tolist())
        for values, digits in (
            (found.offset_n, DIGITS),
            (found.drift_n_s, DIGITS + 2),
            (turn.first, DIGITS + 2),
            (found.rest_n, DIGITS),
        )
    )
    return PlateZero(offset_n=offset, drift_n_s=drift, pose=pose, rest_n=rest)


def zero_verdict(found: PlateOffset, turn: ZeroTurn, plate: PlateConfig) -> VerdictSection:
    """Return whether the zero holds.

    What axis 1 cannot have turned, forces and the moment about it, shows a plate that is described
    wrongly, or a robot that touches something.
    """
    from acquisition.session.plate_preparation import ZERO_LIMIT_N

    forces = float(np.abs(found.gravity[:3]).max())
    about = float(abs(turn.axis @ found.gravity[3:]))
    drift = float(np.abs(found.drift_n_s).max())
    certain = 2.0 * float(found.offset_sigma_n.max())
    reach_m = max(plate.a_m, plate.b_m)
    checks = [
        VerdictCheck.of("largest force that came from turning", forces, "≤", ZERO_LIMIT_N, "N"),
        VerdictCheck.of(
            "moment about axis 1 that came from turning", about, "≤", ZERO_LIMIT_N * reach_m, "N m"
        ),
        VerdictCheck.of("least certain offset, 2σ", certain, "≤", ZERO_LIMIT_N, "N"),
        VerdictCheck.of("fastest drift", drift, "≤", plate.drift_limit_n_s, "N/s"),
    ]
    failed = [line.text for line in checks if not line.passed]
    worst = int(np.abs(found.offset_n).argmax())
    offset, reach = format_measured(
        float(found.offset_n[worst]), 2.0 * float(found.offset_sigma_n[worst])
    )
    sentence = f"Largest offset {offset} ± {reach} N ({CHANNEL_NAMES[worst]})."
    headline = f"Failed: {', '.join(failed)}" if failed else "Passed: the force plate is zeroed"
    return VerdictSection.of(checks, headline, sentence)


def _how(turn: ZeroTurn) -> str:
    if turn.is_half:
        return (
            "Half the sum of the readings is the offset, half their difference the moment of"
            " gravity."
        )
    return (
        "That is less than half a turn, as far as the limits allow: the offset is half the"
        f" sum of the readings and {0.5 / math.tan(0.5 * turn.turn_rad):.3g} times their"
        " difference, a quarter turn on, and less certain by that."
    )


def _moment(found: PlateOffset) -> str:
    parts = []
    for k in (3, 4):
        value, reach = format_measured(float(found.gravity[k]), 2.0 * float(found.gravity_sigma[k]))
        parts.append(f"{WRENCH_NAMES[k]} {value} ± {reach} N m")
    return ", ".join(parts)
