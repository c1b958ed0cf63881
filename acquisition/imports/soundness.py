"""`drop_unsound_rows`: reports and drops impossible rows; nothing is repaired."""

from __future__ import annotations

from itertools import chain

import numpy as np

from acquisition.clock.repeats import repeated_rows
from acquisition.clock.samples import Samples
from acquisition.imports.columns import ImportRows
from acquisition.imports.report import DamagedRow
from acquisition.imports.table import find_unordered
from acquisition.maps.import_map import ImportMap
from acquisition.processing.smoothing import GAP_STEPS
from config.arrays import BoolArray
from config.column_file import each_column, has_few_values

JUMP_FACTOR = 1.5
JUMP_SLACK = 1e-3
LEAP_STEPS = 1000.0
SHORT_RUN = 10
LONG_RUN = 100
FINE_VALUES = 50
MISSING_SHARE = 0.2
FEWEST_MISSING = 5
MISSING_TIMES = 4.0
"""A number stands for a missing torque if jumps reach it at least this many times as often as they
reach 90 % of the other numbers. The two most frequent numbers do not count as others. Peaks of a
noisy torque reach all numbers about equally often."""
STUCK_ROWS = 100
STUCK_TIMES = 5.0
FAST_PERCENTILE = 99.0
COLDEST_K = 223.15
HOTTEST_K = 473.15


def drop_copies(rows: ImportRows) -> ImportRows:
    """Return the rows without exact copies of the previous row, including its time stamp."""
    measured = (rows.position, rows.velocity, rows.torque, rows.temperature, rows.command)
    fresh = np.ones(len(rows.row), dtype=np.bool_)
    fresh[1:] = rows.time_s[1:] != rows.time_s[:-1]
    for column in (column for values in measured for column in each_column(values)):
        if fresh.all():
            break
        values = np.nan_to_num(column)
        fresh[1:] |= values[1:] != values[:-1]
    return rows.keep(fresh)


def drop_unsound_rows(
    rows: ImportRows, import_map: ImportMap, damaged: list[DamagedRow]
) -> tuple[ImportRows, tuple[str, ...]]:
    """Drop rows with absurd, missing or stuck values, out of order, or at unreachable positions.

    Args:
        rows: Rows as read.
        import_map: Limits of plausible values.
        damaged: List to which the dropped rows are appended.

    Returns:
        The sound rows, whose stamps increase, and their oddities, one sentence each.
    """
    rows = _drop_absurd_rows(rows, import_map, damaged)
    doubled, disordered = find_unordered(rows.time_s)
    for mask, reason in (
        (doubled, "with a repeated time stamp"),
        (disordered, "with a time stamp out of order"),
    ):
        damaged.extend(
            DamagedRow(int(row), reason, f"time stamp is {stamp:.9g} s")
            for row, stamp in zip(rows.row[mask], rows.time_s[mask], strict=True)
        )
    rows = rows.keep(~(doubled | disordered))
    rows = _drop_missing_torques(rows, import_map, damaged)
    rows = _drop_stuck_rows(rows, import_map, damaged)
    # After repeated rows, the position jumps at the source's next update; such a jump is not
    # damage.
    fresh = ~repeated_rows(Samples(rows.time_s, rows.position, rows.velocity, rows.torque))
    sound, notes = _rows_without_jumps(rows.keep(fresh), import_map, damaged)
    return rows.keep(sound[np.cumsum(fresh) - 1]), notes


def _drop_absurd_rows(
    rows: ImportRows, import_map: ImportMap, damaged: list[DamagedRow]
) -> ImportRows:
    """Drop rows with a value that is not finite or exceeds a plausible limit."""
    plausible = import_map.plausible
    sound = np.isfinite(rows.time_s)
    damaged.extend(
        DamagedRow(int(row), "with an absurd value", "time stamp is not finite")
        for row in rows.row[~sound]
    )
    rows = rows.keep(sound)
    sound = np.ones(len(rows.row), dtype=np.bool_)
    has_velocity = [joint.velocity is not None for joint in import_map.joints]
    for quantity, key, values, low, high in (
        ("position", ".position", rows.position, -plausible.position, plausible.position),
        ("velocity", ".speed", rows.velocity, -plausible.speed, plausible.speed),
        ("torque", ".torque", rows.torque, -plausible.torque, plausible.torque),
        ("velocity command", ".speed", rows.command, -plausible.speed, plausible.speed),
        ("temperature", "", rows.temperature, COLDEST_K, HOTTEST_K),
    ):
        found: list[DamagedRow] = []
        for joint, column in enumerate(each_column(values)):
            if quantity == "velocity" and not has_velocity[joint]:
                continue
            bad = sound & ~((column >= low) & (column <= high))
            for row in np.flatnonzero(bad):
                detail = (
                    f"{quantity} of {import_map.joint_names[joint]} is {column[row]:.6g},"
                    f" plausible{key} is {low:g} to {high:g}"
                )
                found.append(DamagedRow(int(rows.row[row]), "with an absurd value", detail))
            sound &= ~bad
        damaged.extend(sorted(found, key=lambda each: each.row))
    return rows.keep(sound)


def _drop_missing_torques(
    rows: ImportRows, import_map: ImportMap, damaged: list[DamagedRow]
) -> ImportRows:
    """Drop rows in which a torque jumps for one row, several times to exactly the same number.

    Such a number, often 0 or 9999, stands for a value that the source did not have.
    """
    sound = np.ones(len(rows.row), dtype=np.bool_)
    for name, torque in zip(import_map.joint_names, each_column(rows.torque), strict=True):
        if len(torque) < STUCK_ROWS or has_few_values(torque, FINE_VALUES):
            continue
        least = MISSING_SHARE * float(np.subtract(*np.percentile(torque, [95.0, 5.0])))
        steps = np.diff(torque)
        large = np.abs(steps) > least
        jumps = np.flatnonzero(large[:-1] & large[1:] & (steps[:-1] * steps[1:] < 0.0)) + 1
        values, counts = np.unique(torque[jumps], return_counts=True)
        others = np.sort(counts)[:-2]
        usual = float(np.percentile(others, 90.0)) if len(others) else 0.0
        least_often = max(FEWEST_MISSING, MISSING_TIMES * usual)
        missing = jumps[np.isin(torque[jumps], values[counts >= least_often])]
        sound[missing] = False
        damaged.extend(
            DamagedRow(
                int(rows.row[row]),
                "whose torque is missing",
                f"torque of {name} jumps to {torque[row]:g}",
            )
            for row in missing
        )
    return rows.keep(sound)


def _drop_stuck_rows(
    rows: ImportRows, import_map: ImportMap, damaged: list[DamagedRow]
) -> ImportRows:
    """Drop rows in which a position stays constant and then jumps, because its source was stuck.

    A joint that leaves its rest has a speed that it also has elsewhere. The jump at the end of a
    stuck position is far faster. Copies of whole rows are not dropped here: the clock's checks
    judge them.
    """
    sound = np.ones(len(rows.row), dtype=np.bool_)
    if len(rows.row) < STUCK_ROWS:
        return rows
    others = np.zeros(len(rows.row) - 1, dtype=np.bool_)
    for column in chain(each_column(rows.position), each_column(rows.torque)):
        others |= column[1:] != column[:-1]
    for name, position in zip(import_map.joint_names, each_column(rows.position), strict=True):
        moved = np.flatnonzero(position[1:] != position[:-1])
        constant = np.diff(moved, prepend=-1) - 1  # number of rows without motion before each move
        ends = moved[constant >= STUCK_ROWS]
        if not len(ends):
            continue
        steps = np.abs(np.diff(position))
        speed = steps / np.diff(rows.time_s)
        fastest = float(np.percentile(speed[moved], FAST_PERCENTILE))
        ends = ends[speed[ends] > STUCK_TIMES * fastest]
        for last in ends.tolist():
            first = last - int(constant[np.searchsorted(moved, last)])
            if np.count_nonzero(others[first:last]) < STUCK_ROWS:
                continue
            sound[first + 1 : last + 1] = False
            detail = f"position of {name} is constant and then changes by {steps[last]:.4g}"
            damaged.extend(
                DamagedRow(int(row), "with a stuck position", detail)
                for row in rows.row[first + 1 : last + 1]
            )
    return rows.keep(sound)


def _rows_without_jumps(
    rows: ImportRows, import_map: ImportMap, damaged: list[DamagedRow]
) -> tuple[BoolArray, tuple[str, ...]]:
    """Return False for rows that the joints cannot have reached, or with stamps far from others.

    A run is a series of rows, each of which the joints can have reached from the previous one, and
    whose stamps are near each other. The longest run is sound. Starting from it, the other runs are
    checked in both directions:
    - A run of a few rows is damaged if its stamps are far from the last sound run.
    - Any other run is sound if the joints can have reached it from the last sound run.
    - A long run is also sound if they can have reached it within 5 median steps. Then a time stamp
      was wrong, not a position.
    """
    if len(rows.row) < 2:
        return np.ones(len(rows.row), dtype=np.bool_), ()
    steps = np.diff(rows.time_s)
    leap_s = LEAP_STEPS * float(np.median(steps))
    speed = import_map.plausible.speed
    reach = JUMP_FACTOR * speed
    distances = np.zeros(len(steps))
    for column in each_column(rows.position):
        np.maximum(distances, np.abs(np.diff(column)), out=distances)
    cuts = np.flatnonzero((distances > reach * steps + JUMP_SLACK) | (steps > leap_s)) + 1
    starts = [0, *cuts.tolist()]
    stops = [*cuts.tolist(), len(rows.row)]
    longest = int(np.argmax(np.subtract(stops, starts)))
    sound = np.zeros(len(rows.row), dtype=np.bool_)
    sound[starts[longest] : stops[longest]] = True
    jumps: list[str] = []
    for runs, toward in (
        (range(longest + 1, len(starts)), 1),
        (range(longest - 1, -1, -1), -1),
    ):
        last_sound = stops[longest] - 1 if toward > 0 else starts[longest]
        for run in runs:
            near, far = starts[run], stops[run] - 1
            if toward < 0:
                near, far = far, near
            gap_s = abs(float(rows.time_s[near] - rows.time_s[last_sound]))
            jitter_s = max(gap_s, GAP_STEPS * float(np.median(steps)))
            length = abs(far - near) + 1
            distance = np.abs(rows.position[near] - rows.position[last_sound])
            joint = import_map.joint_names[int(distance.argmax())]
            away = (
                f"position of {joint} changes by {distance.max():.6g} from the nearest sound row"
                f" in {gap_s:.4g} s, faster than plausible.speed {speed:g}"
            )
            if length < SHORT_RUN and gap_s > leap_s:
                reason = "with a time stamp out of order"
                away = f"time stamp is {gap_s:.6g} s away from the sound rows"
            elif distance.max() <= reach * (jitter_s if length >= LONG_RUN else gap_s) + JUMP_SLACK:
                if distance.max() > reach * gap_s + JUMP_SLACK:
                    jumps.append(f"row {rows.row[near]}: {away}")
                sound[starts[run] : stops[run]] = True
                last_sound = far
                continue
            else:
                reason = "whose position jumps"
            damaged.extend(
                DamagedRow(int(row), reason, away) for row in rows.row[starts[run] : stops[run]]
            )
    if jumps:
        jumps = [
            f"The clock jitters: at {len(jumps)} places the stamps are too close for the change"
            f" of position (first {jumps[0]}); the rows on both sides are used. Raise"
            " plausible.speed if a joint is that fast"
        ]
    return sound, tuple(jumps)
