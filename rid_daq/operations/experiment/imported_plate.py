"""`align_plate`: the readings of an imported force plate at the times of its recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

from acquisition.imports.header import number_columns
from acquisition.imports.plate_report import NORMAL_95, PlateReport
from acquisition.imports.plate_table import PlateTable, read_plate
from acquisition.imports.report import ImportReport
from acquisition.maps.import_map import ImportMap
from acquisition.recording.recording import Recording
from config.arrays import FloatArray
from config.errors import DataQualityError
from config.robot.robot import RobotDescription

if TYPE_CHECKING:
    from identification.calibration.plate_timing import PlateTiming

DELAY_STEPS: Final = 0.5
"""A delay that exceeds its interval by more than this is a finding [row periods of the plate]."""


def align_plate(
    files: Sequence[Path],
    layout: ImportMap,
    robot: RobotDescription,
    recording: Recording,
    report: ImportReport,
) -> tuple[Recording, ImportReport]:
    """Return a recording with the plate that its map describes, and the completed report.

    Args:
        files: The first file, then the `further_files` of the map.
        layout: Map of these files, with names or numbers of columns.
        robot: Robot of the map.
        recording: The recording without the plate.
        report: Report on the recording.

    Raises:
        ConfigError: A file cannot be read.
        DataQualityError: The plate's rows cannot be used, or its delay cannot be estimated although
            the map asks for it.
    """
    if layout.plate is None:
        return recording, report
    # a large import that recordings without a plate do not need
    from identification.calibration.plate_timing import estimate_plate_timing

    table = read_plate(files, number_columns(layout, files), report.time_origin_ns)
    plate, findings = table.plate, list(table.findings)
    timing: PlateTiming | None = None
    try:
        timing = estimate_plate_timing(
            recording,
            robot,
            table.time_s,
            table.readings,
            table.valid,
            plate.low_pass,
            own_clock=plate.clock == "own",
        )
    except DataQualityError as error:
        if plate.is_estimated:
            raise
        findings.append(f"Force plate: the delay is not checked: {error}")
    if timing is not None and plate.is_estimated:
        row_s, lag_s = timing.to_recording(table.time_s), timing.lag_s
        first_s = timing.to_stamp(float(recording.time_s[0]))
    else:
        lag_s = 0.0 if plate.lag_s == "estimate" else plate.lag_s
        row_s, first_s = table.time_s - lag_s, float(recording.time_s[0]) + lag_s
        findings += _delay_findings(timing, lag_s, table)
    table, offset = table.without_offset(first_s)
    reaction = table.reaction(row_s, recording.time_s)
    usable = float(reaction.valid.all(axis=1).mean())
    if usable == 0.0:
        raise DataQualityError(
            f"no row of the recording ({recording.time_s[0]:.6g} to {recording.time_s[-1]:.6g} s)"
            f" has valid readings of the force plate ({row_s[0]:.6g} to {row_s[-1]:.6g} s): check"
            " the time stamps, `clock` and `saturation` in the map",
            code="RID-PLATE-CLOCK",
        )
    if recording.samples_per_period is None:
        findings.append(
            "Force plate: the map has no period_s, so `identify` cannot use the plate; `validate`"
            " can if the rows are uniform in time"
        )
    elif not reaction.valid[[0, -1]].all():
        findings.append(
            "Force plate: its readings are not valid in the first or last row of the recording: use"
            " rows that begin after the plate's first row and end before its last one"
        )
    plate_report = _report(table, timing, offset, lag_s, usable)
    findings = [*report.findings, *findings]
    return (
        replace(recording, reaction=reaction),
        replace(report, plate=plate_report, findings=tuple(findings)),
    )


def _delay_findings(timing: PlateTiming | None, lag_s: float, table: PlateTable) -> list[str]:
    """Return a finding if the motion contradicts the stated delay."""
    if timing is None:
        return []
    off_s, half_s = timing.lag_s - lag_s, NORMAL_95 * timing.lag_std_s
    if abs(off_s) <= half_s + DELAY_STEPS * table.step_s:
        return []
    return [
        f"Force plate: its signals are {1e3 * timing.lag_s:.2f} ± {1e3 * half_s:.2f} ms late, but"
        f" the map states {1e3 * lag_s:.2f} ms: correct plate.lag_s, or set it to `estimate`"
    ]


def _report(
    table: PlateTable,
    timing: PlateTiming | None,
    offset: FloatArray | None,
    lag_s: float,
    usable: float,
) -> PlateReport:
    plate = table.plate
    rule: Literal["rest", "stated", "estimated"] = "estimated"
    if offset is not None:
        rule = "rest" if plate.rest_s is not None else "stated"
    own = timing if plate.clock == "own" else None
    return PlateReport(
        names=plate.reading_names,
        rows_read=table.rows_read,
        rows_used=len(table.time_s),
        step_s=table.step_s,
        gaps=table.gaps,
        saturated_share=tuple(table.saturated_share.tolist()),
        offset_rule=rule,
        offset=() if offset is None else tuple(offset.tolist()),
        clock=plate.clock,
        lag_s=lag_s,
        lag_found_s=None if timing is None else timing.lag_s,
        lag_std_s=None if timing is None else timing.lag_std_s,
        drift_ppm=None if own is None else 1e6 * own.rate,
        drift_std_ppm=None if own is None else 1e6 * own.rate_std,
        explained_share=None if timing is None else timing.explained_share,
        usable_share=usable,
    )
