"""Someone else's recording, a CSV file, read by a map into a `Recording`.

Nothing is repaired: a row that cannot be true is named and left out, a file with too few true rows
is refused.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from acquisition.csv.columns import ImportColumns
from acquisition.csv.import_map import ImportMap, RowRange
from acquisition.csv.report import DamagedRow, ImportReport, group_damaged
from acquisition.motion.samples import Phase
from acquisition.processing.smoothing import GAP_STEPS, resample_periods
from acquisition.recording.recording import Recording
from config.arrays import BoolArray, FloatArray, IntArray
from config.errors import ConfigError, DataQualityError, system_errors
from config.formats.bounded_file import read_file
from config.robot.robot import RobotDescription

LARGEST_FILE_BYTES = 500_000_000
FEWEST_ROWS = 100
DAMAGED_FRACTION_LIMIT = 0.5
STANDSTILL = 1e-3
STANDSTILL_SPEED = 0.02
JUMP_FACTOR = 1.5
JUMP_SLACK = 1e-3
LEAP_STEPS = 1000.0
SHORT_RUN = 10
COLDEST_K = 223.15
HOTTEST_K = 473.15


@dataclass(frozen=True, eq=False)
class _Table:
    """Rows of a file in SI, link side; `row` counts from 1.

    Positions and velocities are still the actuators' where the robot has a coupling. Without
    temperatures that array has no columns.
    """

    row: IntArray
    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    torque: FloatArray
    temperature: FloatArray

    def keep(self, mask: BoolArray) -> _Table:
        return _Table(*(getattr(self, field.name)[mask] for field in fields(self)))


def import_csv(
    path: Path,
    import_map: ImportMap,
    robot: RobotDescription | None = None,
    *,
    run_id: str = "",
) -> tuple[Recording, ImportReport]:
    """Read a CSV file by a map; damaged rows are left out and named in the report.

    A row is damaged where it has another number of columns than the map says, holds no number in a
    column used, holds a value beyond `plausible`, has a time stamp out of order, or is further
    from its neighbours than the joints can move.

    Parameters
    ----------
    path : Path
        The file.
    import_map : ImportMap
        Its columns and units.
    robot : RobotDescription, optional
        The map's robot; needed where the map leaves gear ratios or torque constants to it.
    run_id : str
        Provenance of the recording.

    Returns
    -------
    Recording
        The sound rows, every one of the main phase, with their own time stamps; on a uniform
        grid of whole periods where the map has `period_s`.
    ImportReport
        What was read and left out.

    Raises
    ------
    ConfigError
        The file cannot be read, or map and robot leave out what turns its columns into SI.
    DataQualityError
        The file is hopeless: more than half of it damaged, too short, without motion, or with
        velocities that contradict the positions.
    """
    columns = ImportColumns.of(import_map, robot)
    table, damaged, rows_read = _read(path, import_map, columns)
    table = _leave_out_absurd(table, import_map, damaged)
    table = _leave_out_disorder(table, damaged)
    table = _leave_out_jumps(table, import_map, damaged)
    ranges = group_damaged(damaged)
    used = len(table.row)
    if len(damaged) > DAMAGED_FRACTION_LIMIT * rows_read or used < FEWEST_ROWS:
        named = "; ".join(str(rows) for rows in ranges[:5]) + ("; ..." if len(ranges) > 5 else "")
        raise DataQualityError(
            f"{path.name}: only {used} of {rows_read} rows are sound by map {import_map.name!r}"
            f" (at least half of them and {FEWEST_ROWS} are needed): wrong map or broken file."
            f" {named}"
        )
    position = columns.joint_positions(table.position)
    travel = np.ptp(position, axis=0)
    if travel.max() < STANDSTILL:
        raise DataQualityError(
            f"{path.name}: no joint moves more than {travel.max():.2g} rad in the rows used:"
            " nothing can be identified from standstill; check the position columns and rows"
        )
    steps = np.diff(table.time_s)
    report = ImportReport(
        file=path.name,
        map_name=import_map.name,
        rows_read=rows_read,
        rows_used=used,
        damaged=ranges,
        duration_s=float(table.time_s[-1] - table.time_s[0]),
        step_min_s=float(steps.min()),
        step_median_s=float(np.median(steps)),
        step_max_s=float(steps.max()),
        gaps=int(np.count_nonzero(steps > GAP_STEPS * np.median(steps))),
        travel=tuple(float(range_) for range_ in travel),
        velocity_ratio=_compare_velocities(table, import_map, path.name),
    )
    recording = Recording(
        joint_names=import_map.joint_names,
        time_s=table.time_s,
        position=position,
        torque_nm=table.torque,
        temperature_k=table.temperature if table.temperature.size else None,
        valid=np.ones(used, dtype=np.bool_),
        phase=np.full(used, Phase.MAIN, dtype=np.uint8),
        sample_index=np.full(used, -1, dtype=np.int64),
        source="import",
        robot_name=import_map.robot,
        run_id=run_id,
    )
    if import_map.period_s is not None:
        recording = resample_periods(recording, import_map.period_s)
    return recording, report


def refuse_rows_beyond(path: Path, rows: RowRange) -> None:
    """Refuse a range of rows that a file does not have: another file was meant, or other rows.

    Raises
    ------
    ConfigError
        It ends before, or cannot be read.
    """
    end = max((row for row, line in enumerate(_lines(path), start=1) if line.strip()), default=0)
    asked = rows.last or rows.first
    if asked > end:
        raise ConfigError(f"{path}: has {end} rows, and rows to {asked} are asked for")


def _read(
    path: Path, import_map: ImportMap, conversion: ImportColumns
) -> tuple[_Table, list[DamagedRow], int]:
    """Return the rows that parse, in SI, those that do not, and how many were read."""
    columns = conversion.columns
    separator = {"tab": "\t", "space": None}.get(import_map.delimiter, import_map.delimiter)
    damaged: list[DamagedRow] = []
    numbers: list[list[float]] = []
    rows: list[int] = []
    last = import_map.rows.last or math.inf
    first = max(import_map.rows.first, import_map.header_rows + 1)
    for row, line in enumerate(_lines(path), start=1):
        if row < first or row > last or not line.strip():
            continue
        if import_map.decimal == ",":
            line = line.replace(",", ".")
        fields = line.replace('"', "").split(separator)
        if len(fields) != import_map.columns:
            detail = f"{len(fields)} columns instead of {import_map.columns}"
            damaged.append(DamagedRow(row, "with a wrong number of columns", detail))
            continue
        try:
            numbers.append([float(fields[column]) for column in columns])
        except ValueError:
            damaged.append(DamagedRow(row, "without a number", _not_a_number(fields, columns)))
            continue
        rows.append(row)
    with np.errstate(over="ignore"):
        values = np.array(numbers, dtype=np.float64).reshape(-1, len(columns))
        values = values * conversion.factors + conversion.offsets
    n = len(import_map.joints)
    table = _Table(
        row=np.array(rows, dtype=np.int64),
        time_s=values[:, 0],
        position=values[:, 1 : 1 + n],
        torque=values[:, 1 + n : 1 + 2 * n],
        velocity=values[:, 1 + 2 * n : 1 + 3 * n],
        temperature=values[:, 1 + 3 * n :],
    )
    return table, damaged, len(rows) + len(damaged)


def _lines(path: Path) -> list[str]:
    with system_errors(ConfigError, f"cannot read {path}"):
        data = read_file(path, LARGEST_FILE_BYTES)
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    text = data.decode(encoding, errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _not_a_number(fields: list[str], columns: tuple[int, ...]) -> str:
    for column in columns:
        try:
            float(fields[column])
        except ValueError:
            return f"column {column} is {fields[column][:30]!r}"
    return "not a number"


def _leave_out_absurd(table: _Table, import_map: ImportMap, damaged: list[DamagedRow]) -> _Table:
    """Leave out rows with a value that is not finite or beyond what is plausible."""
    plausible = import_map.plausible
    sound = np.isfinite(table.time_s)
    damaged.extend(
        DamagedRow(int(row), "with an absurd value", "time stamp is not finite")
        for row in table.row[~sound]
    )
    table = table.keep(sound)
    sound = np.ones(len(table.row), dtype=np.bool_)
    has_velocity = np.array([joint.velocity is not None for joint in import_map.joints])
    velocity = np.where(has_velocity, table.velocity, 0.0)
    for quantity, values, low, high in (
        ("position", table.position, -plausible.position, plausible.position),
        ("velocity", velocity, -plausible.speed, plausible.speed),
        ("torque", table.torque, -plausible.torque, plausible.torque),
        ("temperature", table.temperature, COLDEST_K, HOTTEST_K),
    ):
        bad = ~((values >= low) & (values <= high))
        for row in np.flatnonzero(bad.any(axis=1) & sound):
            joint = int(np.argmax(bad[row]))
            detail = (
                f"{quantity} of {import_map.joint_names[joint]} is {values[row, joint]:.6g},"
                f" plausible is {low:g} to {high:g}"
            )
            damaged.append(DamagedRow(int(table.row[row]), "with an absurd value", detail))
        sound &= ~bad.any(axis=1)
    return table.keep(sound)


def _leave_out_disorder(table: _Table, damaged: list[DamagedRow]) -> _Table:
    """Leave out the fewest rows such that the time stamps increase."""
    stamps = table.time_s
    if (np.diff(stamps) > 0.0).all():
        return table
    # The longest increasing subsequence: ends[k] is the row that ends the best one of length k + 1.
    ends: list[int] = []
    end_stamps: list[float] = []
    before = np.full(len(stamps), -1)
    for row, stamp in enumerate(stamps.tolist()):
        length = bisect_left(end_stamps, stamp)
        before[row] = ends[length - 1] if length else -1
        ends[length : length + 1] = [row]
        end_stamps[length : length + 1] = [stamp]
    sound = np.zeros(len(stamps), dtype=np.bool_)
    chain = ends[-1]
    while chain >= 0:
        sound[chain] = True
        chain = int(before[chain])
    damaged.extend(
        DamagedRow(int(row), "with a time stamp out of order", f"time stamp is {stamp:.9g} s")
        for row, stamp in zip(table.row[~sound], stamps[~sound], strict=True)
    )
    return table.keep(sound)


def _leave_out_jumps(table: _Table, import_map: ImportMap, damaged: list[DamagedRow]) -> _Table:
    """Leave out rows that the joints cannot have reached, or whose stamps leap far away.

    Rows that their neighbours can be reached from form runs. The longest run is believed; from it
    outwards, in both directions, a run is believed that can be reached from the last believed one.
    """
    if len(table.row) < 2:
        return table
    leap_s = LEAP_STEPS * float(np.median(np.diff(table.time_s)))
    reach = JUMP_FACTOR * import_map.plausible.speed

    def reachable(first: int, second: int) -> bool:
        step_s = abs(table.time_s[second] - table.time_s[first])
        distance = np.abs(table.position[second] - table.position[first]).max()
        return bool(distance <= reach * step_s + JUMP_SLACK)

    steps = np.diff(table.time_s)
    distances = np.abs(np.diff(table.position, axis=0)).max(axis=1)
    cuts = np.flatnonzero((distances > reach * steps + JUMP_SLACK) | (steps > leap_s)) + 1
    starts = [0, *cuts.tolist()]
    stops = [*cuts.tolist(), len(table.row)]
    longest = int(np.argmax(np.subtract(stops, starts)))
    sound = np.zeros(len(table.row), dtype=np.bool_)
    sound[starts[longest] : stops[longest]] = True
    for runs, toward in (
        (range(longest + 1, len(starts)), 1),
        (range(longest - 1, -1, -1), -1),
    ):
        believed = stops[longest] - 1 if toward > 0 else starts[longest]
        for run in runs:
            near, far = starts[run], stops[run] - 1
            if toward < 0:
                near, far = far, near
            gap_s = abs(float(table.time_s[near] - table.time_s[believed]))
            short = abs(far - near) + 1 < SHORT_RUN
            if short and gap_s > leap_s:
                detail = f"time stamp is {gap_s:.6g} s away from the sound rows"
                reason = "with a time stamp out of order"
            elif not reachable(believed, near):
                distance = np.abs(table.position[near] - table.position[believed])
                joint = import_map.joint_names[int(distance.argmax())]
                detail = (
                    f"position of {joint} is {distance.max():.6g} away from the nearest sound row,"
                    f" {gap_s:.4g} s apart"
                )
                reason = "whose position jumps"
            else:
                sound[starts[run] : stops[run]] = True
                believed = far
                continue
            damaged.extend(
                DamagedRow(int(row), reason, detail) for row in table.row[starts[run] : stops[run]]
            )
    return table.keep(sound)


def _compare_velocities(
    table: _Table, import_map: ImportMap, name: str
) -> tuple[float | None, ...]:
    """Return velocity from positions over the velocity column; refuse where they contradict."""
    steps = np.diff(table.time_s)
    near = steps <= GAP_STEPS * np.median(steps)
    from_position = np.diff(table.position, axis=0)[near] / steps[near, np.newaxis]
    measured = (table.velocity[1:] + table.velocity[:-1])[near] / 2.0
    ratios: list[float | None] = []
    for column, joint in enumerate(import_map.joints):
        if joint.velocity is None:
            ratios.append(None)
            continue
        a, b = from_position[:, column], measured[:, column]
        size = max(float(np.sqrt(np.square(a).mean())), float(np.sqrt(np.square(b).mean())))
        if size < STANDSTILL_SPEED:
            ratios.append(None)
            continue
        if np.sqrt(np.square(a - b).mean()) > 0.5 * size:
            raise DataQualityError(
                f"{name}: the position of {joint.joint} (column {joint.position}) moves at"
                f" {np.sqrt(np.square(a).mean()):.3g} per second RMS, its velocity column"
                f" {joint.velocity} says {np.sqrt(np.square(b).mean()):.3g}, and they do not go"
                " together: correct the columns or units in the map"
            )
        ratios.append(float(a @ b / (b @ b)))
    return tuple(ratios)
