"""`CellSection`, `RunSection`, `ClockSection`: the cell, a recorded run, and the run's clock."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from config.cell.cell import CellConfig
from config.cell.cycle_time import CycleTimeMs
from config.robot.robot import RobotDescription
from rid_daq.report.sections.curves import Traces
from rid_daq.report.sections.section import Numbers, Section
from rid_daq.report.sections.stop import StopCurve

if TYPE_CHECKING:
    from acquisition.clock.report import ClockReport
    from acquisition.imports.report import ImportReport
    from acquisition.processing.recording_tally import RecordingTally
    from acquisition.recording.recording import Recording


class CellSection(Section):
    """The cell, as the head of the report names it.

    Attributes:
        name: Name of the cell.
        simulated: True if no hardware moved.
        cycle_time_ms: Cycle time of the cyclic task [ms].
        bus: Interface and channel of the bus.
    """

    name: str
    simulated: bool
    cycle_time_ms: CycleTimeMs
    bus: str

    @classmethod
    def of(cls, cell: CellConfig) -> CellSection:
        """Return the section of a cell."""
        return cls.from_attributes(cell, bus=f"{cell.can.interface}:{cell.can.channel}")


class AxisExtremes(Section):
    """Extreme values of an axis in a run.

    Attributes:
        joint: Name of the joint.
        unit: Unit of the joint's position.
        torque_unit: Unit of the joint's torque.
        position_min: Lowest position, in `unit`.
        position_max: Highest position, in `unit`.
        position_start: Position at the start of the motion, in `unit`; left out if no row after
            the approach is valid.
        max_velocity: Largest speed, in `unit` per second.
        max_torque: Largest absolute torque, in `torque_unit`.
        max_torque_percent: Largest absolute torque relative to the limit in the robot file [%].
        max_following_error: Largest following error, in `unit`; null if the recording has no
            set-points.
    """

    joint: str
    unit: str
    torque_unit: str
    position_min: float
    position_max: float
    max_velocity: float
    max_torque: float
    max_torque_percent: float
    max_following_error: float | None
    position_start: float | None = None


class BadRows(Section):
    """Neighbouring rows of an imported file that were left out.

    Attributes:
        rows: Numbers of the rows: "7", or "2-20".
        count: Number of rows that were left out.
        reason: Reason for leaving them out.
    """

    rows: str
    count: int
    reason: str

    @classmethod
    def of(cls, report: ImportReport) -> tuple[BadRows, ...]:
        """Return all rows that an import left out."""
        return tuple(
            cls(
                rows=f"{rows.first}-{rows.last}" if rows.last > rows.first else str(rows.first),
                count=rows.count,
                reason=", ".join(
                    f"{count} {reason} (row {example.row}: {example.detail})"
                    for (reason, count), example in zip(rows.counts, rows.examples, strict=True)
                ),
            )
            for rows in report.damaged
        )


class ClockSection(Section):
    """Check of the time stamps of a run.

    Attributes:
        clock: "confirmed" by velocities, "rebuilt" from them, "unverified", or "unknown".
        rows: Number of checked rows.
        repeated_rows: Number of rows that repeat the row before although the robot moves.
        missing_rows: Number of rows that are missing according to the time stamps.
        repeated_percent: Repeated rows relative to all rows [%].
        longest_repeat: Number of rows in the longest sequence of equal rows; 1 if no row repeats.
        jitter_rms_ms: RMS deviation of the time steps from whole multiples of the median step [ms].
        held_percent: For each joint: positions that repeat the row before although the joint moves
            [%].
        corrected_rms_ms: RMS difference between rebuilt times and time stamps, after the best shift
            and rate [ms].
        rate: Duration of the rebuilt times divided by that of the time stamps; 1 if the stamps are
            kept.
        tick_ms: Time of which all rebuilt steps are whole multiples [ms]; left out if there is
            none.
        doubt: Reason why the clock is unknown; left out if it is known.
        run: Id of the run; left out if the check belongs to the run that contains it.
    """

    clock: str
    rows: int
    repeated_rows: int
    repeated_percent: float
    longest_repeat: int
    missing_rows: int
    jitter_rms_ms: float
    held_percent: Numbers
    corrected_rms_ms: float
    rate: float
    tick_ms: float | None = None
    doubt: str | None = None
    run: str | None = None

    @classmethod
    def of(cls, report: ClockReport, run: str | None = None) -> ClockSection:
        """Return the section of a clock report."""
        return cls(
            clock=report.clock.value,
            rows=report.rows,
            repeated_rows=report.repeated_rows,
            repeated_percent=100.0 * report.repeated_share,
            longest_repeat=report.longest_repeat,
            missing_rows=report.missing_rows,
            jitter_rms_ms=1e3 * report.jitter_rms_s,
            held_percent=tuple(100.0 * share for share in report.held_share),
            corrected_rms_ms=1e3 * report.corrected_rms_s,
            rate=report.rate,
            tick_ms=None if report.tick_s is None else 1e3 * report.tick_s,
            doubt=report.doubt or None,
            run=run,
        )


class RunSection(Section):
    """One run: extremes of every axis, lost rows, and the stop reason.

    Attributes:
        role: Purpose of the run.
        sentence: Planned motion and recorded rows, or a summary of the import.
        stop: Stop reason; null if the motion was not stopped.
        rows: Number of recorded rows.
        invalid_rows: Number of rows without a valid answer.
        duration_s: Duration of the recording [s].
        axes: Extremes of each axis; empty if fewer than two rows are valid.
        bad_rows: Rows that an import left out; empty if there are none.
        left_out: Number of rows that an import left out, by reason; left out if there are none.
        findings: Anomalies of the rows that the import used; left out if there are none.
        imported: Result of the import in one line; it stays if the report's verdict changes. Left
            out if the run was not imported.
        clock: Check of the time stamps; left out if it was not made.
        stop_curve: Curve of the joint for which the motion was stopped; left out if no joint was
            the reason, or if too few rows with set-points were recorded.
        traces: Recorded quantities over time; left out if fewer than two rows are valid, and in
            results that are based on several runs.
    """

    role: str
    sentence: str
    stop: str | None
    rows: int
    invalid_rows: int
    duration_s: float
    axes: tuple[AxisExtremes, ...]
    bad_rows: tuple[BadRows, ...]
    left_out: dict[str, int] | None = None
    findings: tuple[str, ...] | None = None
    imported: str | None = None
    clock: ClockSection | None = None
    stop_curve: StopCurve | None = None
    traces: Traces | None = None

    @classmethod
    def of(
        cls,
        role: str,
        sentence: str,
        tally: RecordingTally,
        robot: RobotDescription,
        stop: str | None = None,
    ) -> RunSection:
        """Return the section of a recorded run.

        Args:
            role: Purpose of the run.
            sentence: The planned motion.
            tally: Extremes and counts of the recording.
            robot: Robot with limits and units.
            stop: Stop reason; None if the motion was not stopped.
        """
        invalid, duration_s = tally.rows - tally.valid_rows, tally.duration_s
        lost = (
            "every row has valid answers"
            if invalid == 0
            else f"{invalid} rows have no valid answer"
        )
        return cls(
            role=role,
            sentence=f"{sentence} {tally.rows} rows in {duration_s:.1f} s; {lost}.",
            stop=stop,
            rows=tally.rows,
            invalid_rows=invalid,
            duration_s=duration_s,
            axes=_extremes(tally, robot),
            bad_rows=(),
        )

    def with_traces(self, parts: Iterable[Recording], robot: RobotDescription) -> RunSection:
        """Return the section with the traces of its recording, if two rows or more are valid.

        Args:
            parts: Consecutive parts of the recording.
            robot: Robot with the units of its joints.
        """
        valid = self.rows - self.invalid_rows
        if valid < 2:
            return self
        return self.model_copy(update={"traces": Traces.of(parts, valid, robot)})

    def with_import(self, report: ImportReport) -> RunSection:
        """Return the section with the findings of an import report."""
        of_plate = () if report.plate is None else report.plate.lines()
        found: dict[str, object] = {
            "sentence": "; ".join([*report.lines()[:2], *of_plate]) + ".",
            "imported": report.headline,
            "bad_rows": BadRows.of(report),
            "left_out": report.left_out or None,
            "findings": report.findings or None,
            "clock": None if report.clock is None else ClockSection.of(report.clock),
        }
        return self.model_copy(update=found)


def _extremes(tally: RecordingTally, robot: RobotDescription) -> tuple[AxisExtremes, ...]:
    if tally.valid_rows < 2:
        return ()
    error = tally.following_error
    limit = [joint.limits.torque for joint in robot.joints]
    return AxisExtremes.for_each(
        joint=robot.joint_names,
        unit=[joint.unit for joint in robot.joints],
        torque_unit=[joint.torque_unit for joint in robot.joints],
        position_min=tally.position_min,
        position_max=tally.position_max,
        position_start=[None] * len(robot.joints) if tally.start is None else tally.start.tolist(),
        max_velocity=tally.speed,
        max_torque=tally.torque,
        max_torque_percent=100.0 * tally.torque / limit,
        max_following_error=[None] * len(robot.joints) if error is None else error.tolist(),
    )
