"""Checks of sound torques: reports stuck, clipped and large torques, and refuses wrapped ones."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acquisition.imports.columns import ImportRows
from acquisition.maps.import_joint import ImportJoint
from acquisition.maps.import_map import ImportMap
from acquisition.processing.clipping import clipped_ends
from config.arrays import FloatArray
from config.column_file import each_column
from config.errors import DataQualityError
from config.robot.robot import RobotDescription

STANDSTILL = 1e-3
"""Largest travel of a joint that counts as at rest [rad or m]."""
STUCK_ROWS = 100
STUCK_SHARE = 0.2
WRAP_SPEED = 0.3
WRAP_SHARE = 0.9
FEWEST_WRAPS = 4
WRAP_ROWS = 3


def _joints_torques_positions(
    rows: ImportRows, import_map: ImportMap
) -> Iterator[tuple[ImportJoint, FloatArray, FloatArray]]:
    columns = each_column(rows.torque), each_column(rows.position)
    yield from zip(import_map.joints, *columns, strict=True)


def stuck_torque_findings(rows: ImportRows, import_map: ImportMap) -> Iterator[str]:
    """Yield a finding for each torque that is constant while its joint moves."""
    for joint, torque, position in _joints_torques_positions(rows, import_map):
        travel = float(np.ptp(position))
        if travel < STANDSTILL:
            continue
        edges = np.flatnonzero(np.diff(torque) != 0.0) + 1
        starts, stops = np.concatenate([[0], edges]), np.concatenate([edges, [len(torque)]])
        longest = int(np.argmax(stops - starts))
        first, last = int(starts[longest]), int(stops[longest]) - 1
        if last - first + 1 < STUCK_ROWS:
            continue
        moved = float(np.ptp(position[first : last + 1]))
        if moved > STUCK_SHARE * travel:
            column = joint.torque if joint.current is None else joint.current
            yield (
                f"{joint.joint}: its torque (column {column}) is constant at {torque[first]:.4g}"
                f" from row {rows.row[first]} to row {rows.row[last]} while the joint moves by"
                f" {moved:.3g}. The joint's parameters cannot be identified from these rows:"
                " correct the column, or leave these rows out"
            )


def clipped_torque_findings(rows: ImportRows, import_map: ImportMap) -> Iterator[str]:
    """Yield a finding for each torque with an extreme value that is far more frequent than others.

    Only rows in which the joint moves count: at rest the torque is constant.
    """
    for joint, torque, position in _joints_torques_positions(rows, import_map):
        step = np.abs(np.gradient(position))
        torque = torque[step > 0.1 * float(np.sqrt(np.square(step).mean()))]
        if ends := clipped_ends(torque):
            column = joint.torque if joint.current is None else joint.current
            yield (
                f"{joint.joint}: its torque (column {column}) is {ends.phrase}. If this is not the"
                " drive's own limit, the logger clips the torque, and the model will be wrong:"
                " enlarge its range"
            )


def refuse_wrapped_torques(rows: ImportRows, import_map: ImportMap) -> None:
    """Refuse a torque that often jumps by its whole range while its joint moves.

    The number of bits of its counter is too small. Friction also jumps, but only at standstill.

    Raises:
        DataQualityError: A torque wraps.
    """
    for joint, torque, position in _joints_torques_positions(rows, import_map):
        step = np.abs(np.diff(position))
        jumps = np.abs(np.diff(torque))
        moves = step > WRAP_SPEED * float(np.sqrt(np.square(step).mean()))
        span = float(np.ptp(torque))
        wraps = np.flatnonzero(moves & (jumps > WRAP_SHARE * span))
        wraps = wraps[np.diff(wraps, prepend=-WRAP_ROWS) >= WRAP_ROWS]
        wraps = wraps[(wraps > 0) & (wraps < len(jumps) - 1)]
        steps = np.diff(torque)
        # before and after a wrap, the torque changes in the direction opposite to the jump
        back = -np.sign(steps[wraps])
        continued = (back * steps[wraps - 1] > 0.0) & (back * steps[wraps + 1] > 0.0)
        if len(wraps) >= FEWEST_WRAPS and continued.mean() >= WRAP_SHARE:
            column = joint.torque if joint.current is None else joint.current
            raise DataQualityError(
                f"the torque of {joint.joint} (column {column}) jumps {len(wraps)} times by its"
                f" whole range of {span:.4g} while the joint moves (first in row"
                f" {rows.row[wraps[0] + 1]}): its counter has too few bits, so that large values"
                " wrap. Record it with more bits, or correct the column",
                code="RID-IMPORT-UNITS",
            )


def large_torque_findings(torque: FloatArray, robot: RobotDescription) -> Iterator[str]:
    """Yield a finding for each torque that exceeds its limit by 10 % in over 1 % of the rows."""
    for joint, values in zip(robot.joints, each_column(torque), strict=True):
        most = float(np.percentile(np.abs(values), 99.0))
        if most > 1.1 * joint.limits.torque:
            yield (
                f"{joint.name}: its torque reaches {most:.4g}, but the robot file's limit is"
                f" {joint.limits.torque:g}: its torque constant or unit is probably too large by"
                f" a factor of {most / joint.limits.torque:.2g} or more"
            )
