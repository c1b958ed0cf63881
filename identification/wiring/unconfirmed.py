"""`unconfirmed_entries`: mistakes that recordings would not show.

A recording in which no mistake is found does not confirm every entry of the files. Slow motion does
not show wrong lengths. A bare flange does not show the direction of the last joint. Each probe of
this module is a mistake; if the data fit as well with it, they do not confirm the entry.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from config.robot.robot import RobotDescription
from identification.wiring.file_entries import (
    POSITION_FACTOR,
    SCALE_ERROR,
    ZERO_ERROR_DEG,
    EntryKind,
    UnconfirmedEntry,
)
from identification.wiring.fine_search import ABOUT, table_factors
from identification.wiring.flexible_fit import FlexibleFit
from identification.wiring.mistakes import (
    Mistake,
    position_factor,
    reversed_joint,
    torque_factor,
    zero_mistake,
)
from identification.wiring.signals import WiredSignals

SCALES: Final = (1.0 - SCALE_ERROR, 1.0 / (1.0 - SCALE_ERROR))
POSITIONS: Final = (1.0 / POSITION_FACTOR, POSITION_FACTOR)
ZERO_RAD: Final = math.radians(ZERO_ERROR_DEG)
AS_GOOD: Final = 1.03
"""Largest ratio of squared errors on held-out parts at which a mistake fits as well."""
STUDENT: Final = 2.0
"""Difference of log errors that is not significant, in standard errors of its mean."""


def unconfirmed_entries(signals: WiredSignals) -> tuple[UnconfirmedEntry, ...] | None:
    """Return the entries of the files that recordings do not confirm, one for each kind.

    Args:
        signals: The signals and the robot as stated in the files; no mistake was found in them.

    Returns:
        None if there are too few data for a comparison.
    """
    stated = FlexibleFit.of(signals)
    if stated is None:
        return None
    found: dict[EntryKind, set[int]] = {}
    for kind, mistake in probes(signals):
        if kind in found and set(mistake.joints) <= found[kind]:
            continue
        if fits_as_well(mistake, signals, stated):
            found.setdefault(kind, set()).update(mistake.joints)
    if not signals.robot.is_drawn:
        found[EntryKind.COMMON_TORQUE_SCALE] = set()
    return tuple(
        UnconfirmedEntry(kind, tuple(sorted(found[kind]))) for kind in EntryKind if kind in found
    )


def probes(signals: WiredSignals) -> Iterator[tuple[EntryKind, Mistake]]:
    """Yield one or two mistakes of each entry that matter, except those of joints at rest."""
    robot, n = signals.robot, len(signals.robot.joints)
    rows = range(len(robot.kinematics.rows))
    for factor in SCALES:
        lengths = {i: {"a_m": factor, "d_m": factor} for i in rows}
        yield EntryKind.LENGTHS, table_factors(robot, (), "", lengths)
    for i in _twisted(robot):
        yield EntryKind.TWISTS, table_factors(robot, (i,), "", {i: {"alpha_rad": -1.0}})
    for j in np.flatnonzero(signals.moving).tolist():
        yield EntryKind.DIRECTION, reversed_joint(n, j)
        if robot.joints[j].type == "revolute":
            for angle in (ZERO_RAD, -ZERO_RAD):
                yield EntryKind.ZERO_POSITION, zero_mistake(robot, j, angle)
        for factor in POSITIONS:
            yield EntryKind.POSITION_SCALE, position_factor(n, j, factor)
        for factor in SCALES:
            yield EntryKind.TORQUE_SCALE, torque_factor(n, j, factor)


def fits_as_well(mistake: Mistake, signals: WiredSignals, stated: FlexibleFit) -> bool:
    """Return True if the data fit the files with this mistake about as well as the user's files."""
    fit = stated.fit_other(mistake.correct(signals), mistake.torque)
    if float(fit.held_out.sum()) > AS_GOOD * float(stated.held_out.sum()):
        return False
    worse = np.log(fit.held_out / stated.held_out)
    spread = float(np.std(worse, ddof=1)) / math.sqrt(len(worse))
    return float(np.mean(worse)) <= STUDENT * spread or spread == 0.0


def _twisted(robot: RobotDescription) -> list[int]:
    rows = robot.kinematics.rows
    return [i for i, row in enumerate(rows) if abs(math.sin(row.alpha_rad)) > ABOUT]
