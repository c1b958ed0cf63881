"""`CellSection`, `RunSection`, `ClockSection`: the cell, what was recorded, and its clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from rid_daq.report.sections.section import Numbers, Section, units
from rid_daq.report.sections.stop import StopCurve

if TYPE_CHECKING:
    from acquisition.clock.report import ClockReport
    from acquisition.imports.report import ImportReport
    from acquisition.processing.recording_tally import RecordingTally


class CellSection(Section):
    """The cell, as the report's head names it.

    Attributes:
        simulated: Whether no hardware moved.
        cycle_time_ms: Of the cyclic task [ms].
        bus: Interface and channel.
    """

    name: str
    simulated: bool
    cycle_time_ms: int
    bus: str

    @classmethod
    def of(cls, cell: CellConfig) -> CellSection:
        """Return what the report says of a cell."""
        return cls.from_attributes(cell, bus=f"{cell.can.interface}:{cell.can.channel}")


class AxisExtremes(Section):
    """How far, fast and hard an axis went in a run.

    Attributes:
        joint, unit, torque_unit: Its name, and the units of its position and torque.
        position_min, position_max: In `unit`.
        max_velocity: In `unit` per second.
        max_torque: In `torque_unit`.
        max_torque_percent: Of the robot file's limit [%].
        max_following_error: In `unit`; None where the recording has no set-points.
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


class BadRows(Section):
    """Neighbouring rows of an imported file that were left out.

    Attributes:
        rows: Which: "7", or "2-20".
        count: How many.
        reason: Why.
    """

    rows: str
    count: int
    reason: str

    @classmethod
    def of(cls, report: ImportReport) -> tuple[BadRows, ...]:
        """Return all that an import left out."""
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
    """The clock of a run.

    Attributes:
        clock: "confirmed" by velocities, "rebuilt" from them, "unverified", or "unknown".
        rows, repeated_rows, missing_rows: Rows looked at, those that repeat the one before although
            the robot moves, and those that the time stamps leave room for.
        repeated_percent: Repeated rows in percent of the rows [%].
        longest_repeat: Rows in the longest run of equal ones; 1 if none repeat.
        jitter_rms_ms: How far steps of the stamps are from whole multiples of the median step, RMS
            [ms].
        held_percent: Of each joint's positions, those of the row before although the joint moves
            [%].
        corrected_rms_ms: How far rebuilt times are from the stamps, after the best shift and rate,
            RMS [ms].
        rate: Duration of the rebuilt times over that of the stamps; 1 if they are kept.
        tick_ms: What all rebuilt steps are whole multiples of [ms].
        doubt: Why the clock is unknown.
        run: Id of the run.
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
        """Return what a result says of a clock."""
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
    """What was run: extremes of every axis, lost rows, and why it stopped early.

    Attributes:
        role: What the run was for.
        sentence: What was asked for, and what became of it.
        stop: Why the motion was stopped, where it was.
        rows, invalid_rows: Recorded, and those without a valid answer.
        duration_s: Of the recording [s].
        axes: One an axis; none where fewer than two rows are valid.
        bad_rows: What an import left out.
        left_out: How many rows it left out for which reason.
        findings: What is odd about the rows that it used.
        clock: Its clock, where that was judged.
        stop_curve: What the joint did that it was stopped for; left out where it was for no joint.
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
    clock: ClockSection | None = None
    stop_curve: StopCurve | None = None

    @classmethod
    def of(
        cls,
        role: str,
        sentence: str,
        tally: RecordingTally,
        robot: RobotDescription,
        stop: str | None = None,
    ) -> RunSection:
        """Return what was run.

        Args:
            role: What the run was for.
            sentence: What was asked for.
            tally: What was measured.
            robot: The robot, for limits and units.
            stop: Why the motion was stopped, where it was.
        """
        invalid, duration_s = tally.rows - tally.valid_rows, tally.duration_s
        lost = "no row is missing" if invalid == 0 else f"{invalid} rows have no valid answer"
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

    def imported(self, report: ImportReport) -> RunSection:
        """Return what was run with what an import says of it."""
        found: dict[str, object] = {
            "sentence": "; ".join(report.lines()[:2]) + ".",
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
        unit=[units(joint)[0] for joint in robot.joints],
        torque_unit=[units(joint)[1] for joint in robot.joints],
        position_min=tally.position_min,
        position_max=tally.position_max,
        max_velocity=tally.speed,
        max_torque=tally.torque,
        max_torque_percent=100.0 * tally.torque / limit,
        max_following_error=[None] * len(robot.joints) if error is None else error.tolist(),
    )
