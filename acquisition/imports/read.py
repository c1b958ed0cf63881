"""`import_csv`: reads another program's recording into a `Recording`, with an import map.

Impossible rows are reported and left out; a file with too few sound rows is refused. Repeated rows
are left out, too. The times are rebuilt if positions and velocities show that the stamps are wrong
(`acquisition.clock`). Positions that were recorded in steps follow the recorded velocity between
the steps (`between_steps.py`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from acquisition.clock.judgement import judge_clock
from acquisition.clock.samples import Samples
from acquisition.imports.between_steps import (
    position_steps,
    refine_between_steps,
    unrefined_steps,
)
from acquisition.imports.causes import likely_cause_of_damage
from acquisition.imports.columns import ImportColumns
from acquisition.imports.findings import check_rows
from acquisition.imports.grouped_digits import refuse_grouped_digits
from acquisition.imports.header import number_columns
from acquisition.imports.report import DamagedRow, ImportReport, group_damaged
from acquisition.imports.soundness import drop_copies, drop_unsound_rows
from acquisition.imports.tables import Watch, read_tables
from acquisition.imports.velocities import without_missing_velocities
from acquisition.maps.import_map import ImportMap
from acquisition.maps.time_column import numbered
from acquisition.maps.torque_meaning import torque_findings
from acquisition.motion.samples import Phase
from acquisition.processing.imported_periods import resample_periods
from acquisition.processing.smoothing import GAP_STEPS
from acquisition.recording.recording import Recording
from config.arrays import lock
from config.cell.torque_filter import ButterworthFilter
from config.column_file import each_column
from config.errors import DataQualityError
from config.robot.robot import RobotDescription

FEWEST_ROWS = 100


def import_csv(
    file: Path,
    import_map: ImportMap,
    robot: RobotDescription | None = None,
    *,
    further: Sequence[Path] = (),
    layout: ImportMap | None = None,
    watch: Watch | None = None,
) -> tuple[Recording, ImportReport]:
    """Read CSV files with a map; damaged rows are left out and listed in the report.

    A row is damaged if it:
    - has another number of columns than the map,
    - has no number in a used column,
    - exceeds a limit of `plausible`,
    - has no time stamp, or a repeated or disordered one,
    - repeats a joint's position for long while others change, or lacks a torque,
    - has no near value of another topic or file, or
    - is further from its neighbours than the joints can move.

    Args:
        file: The first file.
        import_map: Columns and units.
        robot: Robot of the map. It is needed if the map has no gear ratios or torque constants, and
            to check positions, speeds and torques against its limits.
        further: The map's `further_files`.
        layout: Map of these files, if they were made from files of another kind; `import_map` then
            has the names of that source, which messages show.
        watch: Function to call with the progress of the reading.

    Returns:
        The recording, and the report. The recording contains the sound rows, all in the main phase,
        with recorded or rebuilt times. If the map has `period_s`, its rows are on a uniform grid of
        whole periods. The report lists the rows that were left out, and findings about the others.

    Raises:
        ConfigError: A file cannot be read or does not fit the map, the robot has other joints than
            the map, or neither map nor robot gives a value that is needed for the conversion to SI
            units.
        ContradictionError: The velocities contradict the positions.
        DataQualityError: More rows are damaged than the map's `left_out_limit` permits, fewer than
            100 rows are sound and have new values, a column is empty, a check of `check_rows`
            fails, thousands separators would be read as decimal separators, or the motion does not
            repeat after `period_s`.
    """
    files = (file, *further)
    layout = layout or number_columns(import_map, files)
    columns = ImportColumns.of(layout, robot)
    damaged: list[DamagedRow] = []
    optional = {numbered(j.velocity) for j in layout.joints if j.velocity is not None}
    table = read_tables(files, layout, columns.columns, damaged, optional, watch)
    refuse_grouped_digits(file, layout, table, columns.columns)
    import_map, missing = without_missing_velocities(import_map, table)
    layout, _ = without_missing_velocities(layout, table)
    columns = ImportColumns.of(layout, robot)
    read = columns.rows(table, len(import_map.joints))
    table = replace(table, values=np.empty((0, 0)))  # frees memory
    original = drop_copies(read)
    rows, notes = drop_unsound_rows(original, import_map, damaged)
    used = len(rows.row)
    share = len(damaged) / max(table.rows_read, 1)
    if share > import_map.left_out_limit or used < FEWEST_ROWS:
        needed = f"{FEWEST_ROWS} are needed"
        if used >= FEWEST_ROWS:
            needed = (
                f"{100.0 * share:.1f} % are left out, but left_out_limit in the map permits"
                f" {100.0 * import_map.left_out_limit:g} %"
            )
        cause = likely_cause_of_damage(read, damaged, columns, import_map, robot)
        raise DataQualityError(
            f"{file.name}: only {used} of {table.rows_read} rows are sound with map"
            f" {import_map.name!r} ({needed}): {_count_by_reason(damaged)}; wrong map or damaged"
            f" file: {cause}.{_first_row_of_each_reason(damaged)}",
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
    del read, original  # frees memory
    clock, used = judged.report, int(np.count_nonzero(judged.kept))
    if used < FEWEST_ROWS:
        raise DataQualityError(
            f"{file.name}: only {used} of {table.rows_read} rows have new values with map"
            f" {import_map.name!r} ({FEWEST_ROWS} are needed): {clock.repeated_rows} rows repeat"
            " the previous row although the robot moves. Record longer, or make the source update"
            " its values more often",
            code="RID-IMPORT-REPEATED-ROWS",
        )
    rows = replace(rows.keep(judged.kept), time_s=judged.time_s, position=judged.position)
    try:
        findings = check_rows(rows, columns, import_map, robot)
    except DataQualityError as error:
        raise type(error)(f"{file.name}: {error}", code=error.refusal) from None
    position_step = position_steps(rows)
    position = columns.joint_positions(refine_between_steps(rows, position_step))
    has_velocity = [joint.velocity is not None for joint in import_map.joints]
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
        travel=tuple(float(np.ptp(column)) for column in each_column(position)),
        velocity_ratio=findings.velocity_ratio,
        refined_step=tuple(
            step if measured else None
            for step, measured in zip(position_step, has_velocity, strict=True)
        ),
        rounded_step=unrefined_steps(position_step, has_velocity, columns.coupling),
        findings=(
            *table.notes,
            *missing,
            *notes,
            *clock.findings(import_map.joint_names),
            *findings.sentences,
            *of_robot,
            *torque_findings(import_map.torques),
            *_filter_findings(import_map.torque_filter, float(np.median(steps))),
        ),
        torques=import_map.torques,
        clock=clock,
        static=findings.static,
        time_origin_ns=table.origin_ns,
    )
    recording = Recording(
        joint_names=import_map.joint_names,
        time_s=lock(rows.time_s),
        position=lock(position),
        torque_nm=lock(rows.torque),
        temperature_k=lock(rows.temperature) if rows.temperature.size else None,
        velocity_command=lock(columns.joint_positions(rows.command)) if rows.command.size else None,
        valid=np.ones(used, dtype=np.bool_),
        phase=np.full(used, Phase.MAIN, dtype=np.uint8),
        sample_index=np.full(used, -1, dtype=np.int64),
        source="import",
        torque_filter=import_map.torque_filter,
        robot_name=import_map.robot,
    )
    if import_map.period_s is not None:
        recording = resample_periods(recording, import_map.period_s)
    return recording, report


def _filter_findings(torque_filter: ButterworthFilter | None, step_s: float) -> list[str]:
    """Report a torque filter that does not prevent aliasing at the recording's rate."""
    half_hz = 0.5 / step_s
    if torque_filter is None or torque_filter.cutoff_hz <= half_hz:
        return []
    return [
        f"torque_filter.cutoff_hz is {torque_filter.cutoff_hz:g} Hz, above half the rate of the"
        f" rows, {half_hz:.4g} Hz: torque between them appears at lower frequencies"
        " (aliasing). Correct it, or record at a higher rate"
    ]


def _count_by_reason(damaged: Sequence[DamagedRow]) -> str:
    """Return the number of damaged rows for each reason, as text."""
    counts = Counter(row.reason for row in damaged).most_common()
    return ", ".join(f"{count} {reason}" for reason, count in counts) or "the file is short"


def _first_row_of_each_reason(damaged: Sequence[DamagedRow]) -> str:
    """Return the first damaged row for each reason, as a sentence."""
    first: dict[str, DamagedRow] = {}
    for row in sorted(damaged, key=lambda each: each.row):
        first.setdefault(row.reason, row)
    rows = "; ".join(f"row {row.row}: {row.detail}" for row in first.values())
    which = "row of each kind of damage" if len(first) > 1 else "damaged row"
    last = max(row.row for row in damaged) if damaged else 0
    return f" The first {which} is {rows}; the last damaged row is row {last}" if rows else ""
