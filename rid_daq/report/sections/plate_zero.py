"""`PlateZeroSection`: offsets of a force plate with their uncertainties, and a verdict on them."""

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
"""Decimals of an offset [N] in a cell file: a tenth of a millinewton."""


class ChannelZero(Section):
    """Offset and drift of one channel of a force plate.

    Attributes:
        name: Name of the channel.
        offset_n: Offset [N].
        offset_std_n: Standard deviation of the offset [N].
        drift_n_s: Drift [N/s].
        drift_std_n_s: Standard deviation of the drift [N/s].
    """

    name: str
    offset_n: float
    offset_std_n: float
    drift_n_s: float
    drift_std_n_s: float


class GravityComponent(Section):
    """One component of the gravity wrench in the first pose, in `unit`.

    Attributes:
        name: Name of the component.
        unit: Unit of the component.
        value: Value of the component.
        std: Standard deviation of the value.
    """

    name: str
    unit: str
    value: float
    std: float


class PlateZeroSection(Section):
    """Offsets of a force plate, separated from gravity by readings in two poses of axis 1.

    Attributes:
        sentences: Description of the measurement in words.
        turn_degrees: Angle by which axis 1 was turned [degrees].
        first_pose: Pose of the first reading [rad or m].
        second_pose: Pose of the second reading [rad or m].
        seconds: Duration of the measurement [s].
        channels: Offset and drift of each channel.
        gravity: Gravity wrench, component by component.
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
        """Return the section for the offsets from two readings."""
        degrees = math.degrees(turn.turn_rad)
        return cls(
            sentences=(
                f"Axis 1 was turned by {degrees:.0f} degrees and back in {found.seconds:.0f} s."
                f" {_offset_sentence(turn)}",
                f"Gravity's moment in the first pose: {_gravity_moment(found)}. The offset"
                " contains the robot's weight.",
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
    """Return the offsets as the entry `plate.zero` of a cell file."""
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
    """Return the verdict on a plate's zero.

    A turn of axis 1 cannot change forces or the moment about that axis. If they change, the plate's
    description is wrong or the robot touches something.
    """
    from acquisition.session.plate_preparation import ZERO_LIMIT_N

    forces = float(np.abs(found.gravity[:3]).max())
    about = float(abs(turn.axis @ found.gravity[3:]))
    drift = float(np.abs(found.drift_n_s).max())
    certain = 2.0 * float(found.offset_sigma_n.max())
    reach_m = max(plate.a_m, plate.b_m)
    checks = [
        VerdictCheck.of(
            "largest force that changed when axis 1 turned", forces, "≤", ZERO_LIMIT_N, "N"
        ),
        VerdictCheck.of(
            "moment about axis 1 that changed when it turned",
            about,
            "≤",
            ZERO_LIMIT_N * reach_m,
            "N m",
        ),
        VerdictCheck.of("largest uncertainty of an offset, 2σ", certain, "≤", ZERO_LIMIT_N, "N"),
        VerdictCheck.of("largest drift", drift, "≤", plate.drift_limit_n_s, "N/s"),
    ]
    failed = [line.text for line in checks if not line.passed]
    worst = int(np.abs(found.offset_n).argmax())
    offset, reach = format_measured(
        float(found.offset_n[worst]), 2.0 * float(found.offset_sigma_n[worst])
    )
    sentence = f"Largest offset {offset} ± {reach} N ({CHANNEL_NAMES[worst]})."
    headline = f"Failed: {', '.join(failed)}" if failed else "Passed: the force plate is zeroed"
    return VerdictSection.of(checks, headline, sentence)


def _offset_sentence(turn: ZeroTurn) -> str:
    if turn.is_half:
        return (
            "The offset is half the sum of the two readings; the moment of gravity is half their"
            " difference."
        )
    return (
        "The limits of axis 1 do not allow half a turn. The offset is therefore half the sum of"
        f" the two readings plus {0.5 / math.tan(0.5 * turn.turn_rad):.3g} times their"
        " difference, rotated by a quarter turn; its uncertainty is larger."
    )


def _gravity_moment(found: PlateOffset) -> str:
    parts = []
    for k in (3, 4):
        value, reach = format_measured(float(found.gravity[k]), 2.0 * float(found.gravity_sigma[k]))
        parts.append(f"{WRENCH_NAMES[k]} {value} ± {reach} N m")
    return ", ".join(parts)
