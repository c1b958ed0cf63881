"""Someone else's recording, read by a map into a `Recording`.

A row that cannot be true is named and left out, a file with too few true rows is refused. Rows
that repeat the one before are left out as well, and the times are rebuilt if the stamps are wrong
and positions and velocities show the true ones (`acquisition.clock`). All else stays as recorded.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from acquisition.clock.judgement import judge_clock
from acquisition.clock.samples import Samples
from acquisition.imports.between_steps import between_steps, position_steps
from acquisition.imports.causes import cause_of_loss
from acquisition.imports.columns import ImportColumns
from acquisition.imports.findings import find
from acquisition.imports.import_map import ImportMap
from acquisition.imports.report import DamagedRow, ImportReport, group_damaged
from acquisition.imports.soundness import leave_out, without_copies
from acquisition.imports.tables import read_tables
from acquisition.motion.samples import Phase
from acquisition.processing.smoothing import GAP_STEPS, resample_periods
from acquisition.recording.recording import Recording
from config.errors import DataQualityError
from config.robot.robot import RobotDescription

FEWEST_ROWS = 100


def import_csv(
    file: Path,
    import_map: ImportMap,
    robot: RobotDescription | None = None,
    *,
    further: Sequence[Path] = (),
) -> tuple[Recording, ImportReport]:
    """Read CSV files by a map; damaged rows are left out and named in the report.

    A row is damaged where it has another number of columns than the map says, holds no number in a
    column used, holds a value beyond `plausible`, has a time stamp that is doubled or out of order,
    or is further from its neighbours than the joints can move.

    Args:
        import_map: Its columns and units.
        robot: The map's robot; needed where the map leaves gear ratios or torque constants to it,
            and to hold positions, speeds and torques against its limits.
        further: The map's `further_files`.

    Returns:
        The sound rows, every one of the main phase, with their own time stamps or rebuilt times; on
            a uniform grid of whole periods where the map has `period_s`.
        What was read and left out, and what is odd about the rest.

    Raises:
        ConfigError: A file cannot be read, or map and robot leave out what turns its columns into
            SI.
        DataQualityError: More of it is damaged than the map's `left_out_limit`, it is too short,
            its velocities contradict the positions, or these are far beyond the robot's limits.
    """
    columns = ImportColumns.of(import_map, robot)
    damaged: list[DamagedRow] = []
    table = read_tables((file, *further), import_map, columns.columns, damaged)
    read = columns.rows(table, len(import_map.joints))
    original = without_copies(read)
    rows, notes = leave_out(original, import_map, damaged)
    used = len(rows.row)
    share = len(damaged) / max(table.rows_read, 1)
    if share > import_map.left_out_limit or used < FEWEST_ROWS:
        needed = f"{FEWEST_ROWS} are needed"
        if used >= FEWEST_ROWS:
            needed = (
                f"{100.0 * share:.1f} % are left out, left_out_limit in the map allows"
                f" {100.0 * import_map.left_out_limit:g} %"
            )
        cause = cause_of_loss(read, damaged, columns, import_map, robot)
        raise DataQualityError(
            f"{file.name}: only {used} of {table.rows_read} rows are sound by map"
            f" {import_map.name!r} ({needed}): {_counted(damaged)}; wrong map or broken file:"
            f" {cause}.{_first_of_each(damaged)}",
            code="RID-IMPORT-ROWS",
        )
    stamps = rows.time_s
    judged = judge_clock(
        Samples(rows.time_s, rows.position, rows.velocity, rows.torque),
        robot,
        columns.coupling,
        copies=len(read.row) - len(original.row),
        left_out=len(damaged),
    )
    clock, used = judged.report, int(np.count_nonzero(judged.kept))
    if used < FEWEST_ROWS:
        raise DataQualityError(
            f"{file.name}: only {used} of {table.rows_read} rows are fresh by map"
            f" {import_map.name!r} ({FEWEST_ROWS} are needed): {clock.repeated_rows} repeat the row"
            " before although the robot moves. Record for longer, or as fast as the source renews",
            code="RID-IMPORT-REPEATED-ROWS",
        )
    rows = replace(rows.keep(judged.kept), time_s=judged.time_s, position=judged.position)
    try:
        findings = find(rows, columns, import_map, robot)
    except DataQualityError as error:
        raise DataQualityError(f"{file.name}: {error}", code=error.refusal) from None
    position_step = position_steps(rows)
    position = columns.joint_positions(between_steps(rows, position_step))
    steps = np.diff(stamps)
    of_robot = () if robot is None else robot.kinematics.notes
    report = ImportReport(
        file=file.name,
        map_name=import_map.name,
        rows_read=table.rows_read,
        rows_used=used,
        damaged=group_damaged(damaged),
        duration_s=float(stamps[-1] - stamps[0]),
        step_min_s=float(steps.min()),
        step_median_s=float(np.median(steps)),
        step_max_s=float(steps.max()),
        gaps=int(np.count_nonzero(steps > GAP_STEPS * np.median(steps))),
        travel=tuple(np.ptp(position, axis=0).tolist()),
        velocity_ratio=findings.velocity_ratio,
        refined_step=tuple(
            step if joint.velocity is not None else None
            for step, joint in zip(position_step, import_map.joints, strict=True)
        ),
        findings=(
            *table.notes,
            *notes,
            *clock.findings(import_map.joint_names),
            *findings.sentences,
            *of_robot,
        ),
        clock=clock,
        static=findings.static,
    )
    recording = Recording(
        joint_names=import_map.joint_names,
        time_s=rows.time_s,
        position=position,
        torque_nm=rows.torque,
        temperature_k=rows.temperature if rows.temperature.size else None,
        valid=np.ones(used, dtype=np.bool_),
        phase=np.full(used, Phase.MAIN, dtype=np.uint8),
        sample_index=np.full(used, -1, dtype=np.int64),
        source="import",
        robot_name=import_map.robot,
    )
    if import_map.period_s is not None:
        recording = resample_periods(recording, import_map.period_s)
    return recording, report


def _counted(damaged: Sequence[DamagedRow]) -> str:
    """Return how many rows are damaged for which reason."""
    counts = Counter(row.reason for row in damaged).most_common()
    return ", ".join(f"{count} {reason}" for reason, count in counts) or "the file is short"


def _first_of_each(damaged: Sequence[DamagedRow]) -> str:
    """Return the first row that is damaged for each reason, as a sentence."""
    first: dict[str, DamagedRow] = {}
    for row in sorted(damaged, key=lambda each: each.row):
        first.setdefault(row.reason, row)
    rows = "; ".join(f"row {row.row}: {row.detail}" for row in first.values())
    which = "of each kind" if len(first) > 1 else "one"
    last = max(row.row for row in damaged) if damaged else 0
    return f" The first {which} is {rows}; the last is row {last}" if rows else ""
