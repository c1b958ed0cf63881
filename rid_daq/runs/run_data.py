"""Content of a run folder as objects for operations.

Operations read a recording with `RunData.load`: it refuses files that do not belong to the run, and
accepts an unfinished run only if requested.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

from acquisition.clock.repeat_counter import RepeatCounter
from acquisition.clock.report import ClockReport
from acquisition.imports.report import ImportReport
from acquisition.journal.cycle_reader import CycleReader
from acquisition.journal.header import JournalHeader
from acquisition.journal.imported_plate import read_imported_plate
from acquisition.journal.mcap_writer import is_being_written
from acquisition.journal.monitor import (
    MONITOR,
    MonitorStream,
    read_run_temperatures,
    with_temperature_compensation,
)
from acquisition.journal.plate import PLATE_RECORDING, read_plate_journal
from acquisition.maps.import_map import ImportMap
from acquisition.processing.periods import PeriodAverage, average_table
from acquisition.processing.plate_alignment import plate_defects, with_plate
from acquisition.processing.recording_tally import RecordingTally
from acquisition.processing.repeated_torque import repeated_torque_sentence
from acquisition.recording.recording import Recording, stored_recording
from acquisition.runs.catalogue import list_runs
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RECORDING, RunStatus
from config.cell.cell import CellConfig
from config.cell.plate import PlatePlace
from config.errors import DataQualityError, LockedError, RecordingError
from config.formats.yaml_tree import parse_yaml
from config.load import load_bundled_or_path, load_robot, validate
from config.robot.robot import RobotDescription
from rid_daq.report.result import Result
from rid_daq.report.result_file import RESULT, read_result
from rid_daq.report.sections.runs import ClockSection, RunSection
from rid_daq.report.sections.timing import Timing
from rid_daq.runs.changed_load import LOAD_CHANGES, load_change_notes, refuse_changed_load
from rid_daq.terminal.context import Context

SOURCES = ("source.csv", "source_2.csv", "source_3.csv", "source_4.csv")
SOURCE = SOURCES[0]
MAP = "map.yaml"
IMPORT = "import.json"
ROBOT = "robot.yaml"
CELL = "cell.yaml"
MOTION = "motion.yaml"
ORIGINS = "origins.json"
FEEDFORWARD = "feedforward.json"
ONLINE_MODEL = "online_model.json"
ONLINE_LOOPS = "online_loops.json"
ONLINE_PAYLOAD = "online_payload.json"
PLANT = "plant.yaml"
SESSION = "session.json"
READ = (
    *(RECORDING, PLATE_RECORDING, MONITOR, *SOURCES, MAP, IMPORT),
    *(ROBOT, CELL, MOTION, FEEDFORWARD, ONLINE_MODEL, ONLINE_LOOPS, ONLINE_PAYLOAD, PLANT, ORIGINS),
    LOAD_CHANGES,
)
"""Files of a run that operations read; they must be unchanged since the run."""


@dataclass(frozen=True)
class RunData:
    """Recording and robot of a run.

    Attributes:
        folder: Run folder.
        robot: The robot as used in the run.
        tally: Statistics and periods of the recording; their size in memory is bounded.
        import_report: Report of the import, for an imported run.
        damage: Defects of the recording, one sentence each.
        held: The whole recording in memory, if it was imported or has a force plate; otherwise
            None.
        monitor: Temperatures and other data of the drive monitor.
        recorded_clock: Report on repeated rows, for a run that rid-daq recorded.
    """

    folder: RunFolder
    robot: RobotDescription
    tally: RecordingTally
    import_report: ImportReport | None = None
    damage: tuple[str, ...] = ()
    held: Recording | None = None
    monitor: MonitorStream | None = None
    recorded_clock: ClockReport | None = None

    @property
    def is_periodic(self) -> bool:
        """True if the recording has whole periods that can be averaged."""
        return self.tally.head.samples_per_period is not None

    @property
    def clock(self) -> ClockReport | None:
        """Report on the stamps of an import, or on repeated rows of a recording."""
        report = self.import_report
        return self.recorded_clock if report is None else report.clock

    @property
    def has_plate(self) -> bool:
        """True if the recording has the data of a force plate."""
        return self.held is not None and self.held.reaction is not None

    @classmethod
    def of(
        cls,
        folder: RunFolder,
        recording: Recording,
        robot: RobotDescription,
        import_report: ImportReport | None,
    ) -> RunData:
        """Return the data of an imported recording."""
        return cls(folder, robot, RecordingTally(recording), import_report, held=recording)

    @classmethod
    def load(
        cls, folder: RunFolder, *, unfinished: bool = False, changing_load: bool = False
    ) -> RunData:
        """Read a run's recording and robot, once and in parts.

        If the drives reported temperatures, the torques are corrected for warm torque constants.

        Args:
            folder: The run.
            unfinished: True to accept a run that was never finished.
            changing_load: True to accept a run during which the payload changed.

        Raises:
            ConfigError, RecordingError: The folder contains no recording, or a file is damaged or
                does not belong to the run.
            LockedError: The run is still being recorded.
            DataQualityError: The run was never finished, and `unfinished` is False; or its payload
                changed, and `changing_load` is False.
        """
        _require_readable(folder, unfinished)
        require_own(folder)
        if not changing_load:
            refuse_changed_load(folder)
        robot = load_robot(str(folder.file(ROBOT)))
        with CycleReader(folder.file(RECORDING)) as reader:
            parts = reader.recordings()
            first = next(parts, None)
            _require_header(folder, reader.header, robot)
            assert first is not None  # a journal with a header has at least one row
            if first.source == "import":
                report = ImportReport.from_json(folder.read(IMPORT), str(folder.file(IMPORT)))
                whole = stored_recording(chain([first], parts), reader.most_rows)
                recording = _with_imported_plate(folder, whole)
                data = cls.of(folder, recording, robot, report)
                return replace(data, damage=reader.damage.notes)
            monitor, cold = read_run_temperatures(first, folder.path)
            repeats = RepeatCounter()
            first = repeats.add(first)
            tally = RecordingTally(with_temperature_compensation(first, monitor, robot))
            for part in map(repeats.add, parts):
                tally.add(with_temperature_compensation(part, monitor, robot))
            notes = (*reader.damage.notes, *cold, *repeats.notes())
            data = cls(folder, robot, tally, None, notes, None, monitor, repeats.report())
        if not folder.file(PLATE_RECORDING).exists():
            return data
        held, lost = _with_plate(folder, data.recording)
        return replace(data, held=held, damage=(*data.damage, *lost))

    def parts(self) -> Iterator[Recording]:
        """Yield the recording in parts, of which only a few are in memory at a time.

        Raises:
            RecordingError: The recording can no longer be read.
        """
        if self.held is not None:
            yield self.held
            return
        with CycleReader(self.folder.file(RECORDING)) as reader:
            for part in reader.recordings():
                yield with_temperature_compensation(part, self.monitor, self.robot)

    @cached_property
    def recording(self) -> Recording:
        """The whole recording, for callers that cannot use `parts`; the file is read again."""
        return stored_recording(self.parts(), self.tally.rows) if self.held is None else self.held

    @cached_property
    def cell(self) -> CellConfig | None:
        """The cell as it was in the run; None for an imported recording.

        Raises:
            ConfigError, RecordingError: The cell file is damaged.
        """
        path = self.folder.file(CELL)
        return load_bundled_or_path(str(path), "cells", CellConfig) if path.exists() else None

    @cached_property
    def import_map(self) -> ImportMap | None:
        """The map with which the run was imported; None for a run of a cell.

        Raises:
            ConfigError, RecordingError: The map is damaged.
        """
        path = self.folder.file(MAP)
        if not path.exists():
            return None
        return validate(parse_yaml(self.folder.read(MAP), str(path)), ImportMap)

    @cached_property
    def plate(self) -> PlatePlace | None:
        """Description of the force plate in the cell file or the import map; None without any.

        Raises:
            ConfigError, RecordingError: The file is damaged.
        """
        if self.cell is not None:
            return self.cell.plate
        plate = None if self.import_map is None else self.import_map.plate
        return None if plate is None else plate.description

    @cached_property
    def average(self) -> PeriodAverage:
        """Mean period.

        Raises:
            DataQualityError: The run is not periodic, or not good enough.
        """
        return average_table(self.tally.cutter.table(), self.held)


def _require_readable(folder: RunFolder, unfinished: bool) -> None:
    """Refuse a run that is still open, and an unfinished run unless `unfinished` is True."""
    if not folder.file(RECORDING).exists():
        words = (
            f"{folder.path}: the folder contains no {RECORDING}, because no row was recorded"
            " or imported in this run"
        )
        raise RecordingError(words, code="RID-RECORDING-EMPTY")
    if is_being_written(folder.file(RECORDING)):
        words = f"{folder.path}: the run is still being recorded; wait until it has ended"
        raise LockedError(words, code="RID-RUN-OPEN")
    if not unfinished and folder.manifest().status == RunStatus.UNFINISHED:
        raise DataQualityError(
            f"{folder.path}: the run was never finished, because the program ended first. Write"
            f" its readable part as a new run: `rid-daq recover {folder.path}`; or use it as it"
            " is: --unfinished",
            code="RID-RUN-UNFINISHED",
        )


def require_own(folder: RunFolder) -> None:
    """Refuse a run with a file that was changed or does not belong to it.

    Raises:
        RecordingError: There is such a file; the message names it, its own run if known, and the
            remedy.
    """
    entries = folder.manifest().files
    for name, what in folder.find_changes(READ).items():
        path = folder.file(name)
        whose = _owner_phrase(folder, name)
        words = f"{path}: {what}{whose}."
        if name not in entries:
            raise RecordingError(f"{words} Remove it from the folder", code="RID-RUN-MIXED")
        again = "import" if folder.file(SOURCE).exists() else "record"
        advice = f"; if the new file is right, {again} a run with it"
        if path.suffix == ".mcap" and path.exists() and not whose:
            again = f"`rid-daq recover {folder.path}`"
            advice = f", or write its readable part as a new run: {again}"
        raise RecordingError(f"{words} Restore the original file{advice}", code="RID-RUN-CHANGED")


def _owner_phrase(folder: RunFolder, name: str) -> str:
    """Return a phrase on the neighbouring run that contains the same file; empty if none does."""
    if not folder.file(name).exists():
        return ""
    for other, manifest in list_runs(folder.path.parent):
        if other.run_id != folder.run_id and name in manifest.files:
            if not (folder.is_unchanged(name, manifest.files[name])):
                continue
            return f"; it is the file of run {other.run_id} ({manifest.label})"
    return ""


def _require_run(folder: RunFolder, name: str, run_id: str) -> None:
    """Refuse a recording that names another run in its header."""
    if run_id != folder.run_id:
        raise RecordingError(
            f"{folder.file(name)}: belongs to {f'run {run_id}' if run_id else 'no run'}, not to"
            f" {folder.run_id}: restore the original file",
            code="RID-RUN-MIXED",
        )


def _require_header(folder: RunFolder, header: JournalHeader, robot: RobotDescription) -> None:
    """Refuse a recording whose header names another run or robot."""
    _require_run(folder, RECORDING, header.run_id)
    path = folder.file(RECORDING)
    if header.joint_names != robot.joint_names or header.robot_name not in ("", robot.name):
        raise RecordingError(
            f"{path}: is of robot {header.robot_name!r} with the joints"
            f" {', '.join(header.joint_names)}, but {ROBOT} in this folder describes"
            f" {robot.name!r}: restore the {ROBOT} of this recording",
            code="RID-RUN-MIXED",
        )


def clock_sections(runs: Sequence[RunData]) -> list[ClockSection]:
    """Return the reports on the runs' time stamps."""
    return [
        ClockSection.of(data.clock, data.folder.run_id) for data in runs if data.clock is not None
    ]


def data_defects(runs: Sequence[RunData]) -> list[str]:
    """Return remarks on the data of runs, such as lost rows, load changes or import findings."""
    said = []
    for data in runs:
        manifest = data.folder.manifest()
        name = manifest.label or data.folder.run_id
        match manifest.status:
            case RunStatus.UNFINISHED:
                said.append(f"{name}: the run was never finished, so its end is missing")
            case RunStatus.STOPPED:
                said.append(f"{name}: the run was stopped before its end")
            case RunStatus.RECOVERED:
                lost = manifest.facts.get("rows_lost", 0)
                said.append(f"{name}: the run was recovered; {lost} rows are known to be lost")
        step_s = data.tally.head.sample_period_s
        reached_s = math.inf if step_s is None else data.tally.last_row * step_s
        said += load_change_notes(data.folder, name, reached_s)
        found = () if data.import_report is None else data.import_report.findings
        held = repeated_torque_sentence(next(data.parts()))
        said += [f"{name}: {note}" for note in (*data.damage, *found, *([held] if held else ()))]
    return said


def all_defects(runs: Sequence[RunData]) -> list[str]:
    """Return the remarks of `data_defects`, and notes on the kinematics of the first robot."""
    return [*data_defects(runs), *(runs[0].robot.kinematics.notes if runs else ())]


def show_defects(context: Context, runs: Sequence[RunData]) -> list[str]:
    """Show the defects of runs, and return them."""
    said = all_defects(runs)
    for note in said:
        context.say(f"note: {note}")
    return said


def _with_imported_plate(folder: RunFolder, recording: Recording) -> Recording:
    """Return an imported recording with its force plate, if it has one."""
    path = folder.file(PLATE_RECORDING)
    if not path.exists():
        return recording
    return replace(recording, reaction=read_imported_plate(path, len(recording), folder.run_id))


def _with_plate(folder: RunFolder, recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """Return a recording with its force plate data, and the defects of these data."""
    path = folder.file(PLATE_RECORDING)
    try:
        rows = read_plate_journal(path)
        both = with_plate(recording, rows)
    except (DataQualityError, RecordingError) as error:
        return recording, (f"force plate: not used: {error}",)
    _require_run(folder, PLATE_RECORDING, rows.header.run_id)
    notes = (*rows.damage.notes, *plate_defects(recording, rows))
    return both, tuple(f"force plate: {note}" for note in notes)


def result_of(data: RunData, notes: Sequence[str] = ()) -> Result:
    """Return a run's result document; a new one if it has none yet.

    Args:
        data: The run.
        notes: Defects of the runs on which the new part of the document is based.

    Raises:
        RecordingError: There is a document that cannot be read.
    """
    result = read_result(data.folder) if data.folder.file(RESULT).exists() else _first_result(data)
    return result.with_sections(notes=tuple(notes) or None)


def _first_result(data: RunData) -> Result:
    manifest, report = data.folder.manifest(), data.import_report
    section = RunSection.of("recording", "As recorded.", data.tally, data.robot)
    section = section.with_traces(data.parts(), data.robot)
    if report is not None:
        section = section.with_import(report)
    return Result.new(f"Run {manifest.label}", data.robot.name).with_sections(
        runs=(section,),
        timing=Timing(created_utc=manifest.created_utc, run_ids=(manifest.run_id,)),
    )
