"""What a run folder holds, as the objects that the commands work on.

Whatever reads a run reads it by `RunData.load`: files that do not belong to it are refused, and a
run that was never finished is used only where that is asked for.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from acquisition.clock.repeat_counter import RepeatCounter
from acquisition.clock.report import ClockReport
from acquisition.imports.report import ImportReport
from acquisition.journal.cycle_reader import CycleReader
from acquisition.journal.header import JournalHeader
from acquisition.journal.mcap_writer import being_written
from acquisition.journal.monitor import (
    MONITOR,
    MonitorStream,
    monitored,
    with_temperature_compensation,
)
from acquisition.journal.plate import PLATE_RECORDING, read_plate_journal
from acquisition.processing.held_torque import held_sentence
from acquisition.processing.periods import PeriodAverage, average_table
from acquisition.processing.plate_alignment import with_plate
from acquisition.processing.recording_tally import RecordingTally
from acquisition.recording.recording import Recording, concatenate_recordings
from acquisition.runs.catalogue import list_runs
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RECORDING, RunStatus
from config.cell.cell import CellConfig
from config.errors import ConfigError, DataQualityError, LockedError, RecordingError
from config.load import load_bundled_or_path, load_robot
from config.robot.robot import RobotDescription
from rid_daq.report.result import Result
from rid_daq.report.result_file import RESULT, read_result
from rid_daq.report.sections.runs import ClockSection, RunSection
from rid_daq.report.sections.timing import Timing
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
PLANT = "plant.yaml"
SESSION = "session.json"
READ = (
    *(RECORDING, PLATE_RECORDING, MONITOR, *SOURCES, MAP, IMPORT),
    *(ROBOT, CELL, MOTION, FEEDFORWARD, ONLINE_MODEL, ONLINE_LOOPS, PLANT, ORIGINS),
)
"""What commands read of a run: it must be what the run was made with."""


@dataclass(frozen=True)
class RunData:
    """A run's recording and robot.

    Attributes:
        folder: Where they come from.
        robot: The robot as used in that run.
        tally: What was measured, or imported, as far as memory does not grow with it.
        import_report: What the import left out, for an imported run.
        damage: What the recording has lost, one sentence each.
        held: All of it, where it was imported or has a force plate's side.
        monitor: What the drives told of themselves.
        recorded_clock: Repeated rows of a run that was recorded here.
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
        """Whether the recording holds whole periods to average."""
        return self.tally.head.samples_per_period is not None

    @property
    def clock(self) -> ClockReport | None:
        """What was found of the clock; None where it was not judged."""
        report = self.import_report
        return self.recorded_clock if report is None else report.clock

    @property
    def has_plate(self) -> bool:
        """Whether there is a force plate's side."""
        return self.held is not None and self.held.reaction is not None

    @classmethod
    def of(
        cls,
        folder: RunFolder,
        recording: Recording,
        robot: RobotDescription,
        import_report: ImportReport | None,
    ) -> RunData:
        """Return a run whose recording was imported."""
        return cls(folder, robot, RecordingTally(recording), import_report, held=recording)

    @classmethod
    def load(cls, folder: RunFolder, *, unfinished: bool = False) -> RunData:
        """Read a run's recording and robot, once and in pieces.

        If the drives told their temperatures, torques are those of warm torque constants.

        Args:
            folder: The run.
            unfinished: Whether a run that was never finished will do.

        Raises:
            RecordingError: The folder holds no recording, or it cannot be read; or a file in it is
                not the run's own.
            LockedError: It is still being recorded.
            DataQualityError: The run was never finished, and `unfinished` is not set.
        """
        _require_readable(folder, unfinished)
        require_own(folder)
        robot = load_robot(str(folder.file(ROBOT)))
        with CycleReader(folder.file(RECORDING)) as reader:
            parts = reader.recordings()
            first = next(parts, None)
            _require_header(folder, reader.header, robot)
            assert first is not None  # there is no header without a row
            if first.source == "import":
                report = ImportReport.from_json(folder.read(IMPORT), str(folder.file(IMPORT)))
                data = cls.of(folder, concatenate_recordings([first, *parts]), robot, report)
                return replace(data, damage=reader.damage.notes)
            monitor, cold = monitored(first, folder.path)
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
        """Yield the recording in parts, of which few need be in memory at a time.

        Raises:
            RecordingError: It cannot be read any more.
        """
        if self.held is not None:
            yield self.held
            return
        with CycleReader(self.folder.file(RECORDING)) as reader:
            for part in reader.recordings():
                yield with_temperature_compensation(part, self.monitor, self.robot)

    @cached_property
    def recording(self) -> Recording:
        """All of the recording, for whoever cannot do with its parts; it is read once more."""
        return concatenate_recordings(self.parts()) if self.held is None else self.held

    @cached_property
    def cell(self) -> CellConfig | None:
        """The cell as used; None of a recording from elsewhere.

        Raises:
            ConfigError: Its file is damaged.
        """
        path = self.folder.file(CELL)
        return load_bundled_or_path(str(path), "cells", CellConfig) if path.exists() else None

    @cached_property
    def average(self) -> PeriodAverage:
        """The mean period.

        Raises:
            DataQualityError: The run is not periodic, or not good enough.
        """
        return average_table(self.tally.cutter.table(), self.held)


def _require_readable(folder: RunFolder, unfinished: bool) -> None:
    """Refuse a run that cannot be read yet, or not without being asked for."""
    if not folder.file(RECORDING).exists():
        words = f"{folder.path}: holds no {RECORDING}; nothing was recorded or imported in this run"
        raise RecordingError(words, code="RID-RECORDING-EMPTY")
    if being_written(folder.file(RECORDING)):
        words = f"{folder.path}: is still being recorded; wait until it has ended"
        raise LockedError(words, code="RID-RUN-OPEN")
    if not unfinished and folder.manifest().status == RunStatus.UNFINISHED:
        raise DataQualityError(
            f"{folder.path}: was never finished: the program ended before the run did. Write what"
            f" is readable as a new run: `rid-daq recover {folder.path}`; or use it as it is:"
            " --unfinished",
            code="RID-RUN-UNFINISHED",
        )


def require_own(folder: RunFolder) -> None:
    """Refuse a run with a file that is not the one it was made with.

    Raises:
        RecordingError: There is one; the message names it, whose it is where that is known, and
            what to do.
    """
    for name, what in folder.find_changes(READ).items():
        path = folder.file(name)
        whose = _whose(folder, name)
        words = f"{path}: {what}{whose}."
        if "put into" in what:
            raise RecordingError(f"{words} Take it out of the folder", code="RID-RUN-MIXED")
        again = "import" if folder.file(SOURCE).exists() else "record"
        advice = f"; if the new one is right, {again} a run with it"
        if path.suffix == ".mcap" and path.exists() and not whose:
            again = f"`rid-daq recover {folder.path}`"
            advice = f", or write what is readable of it as a new run: {again}"
        raise RecordingError(f"{words} Put the original back{advice}", code="RID-RUN-CHANGED")


def _whose(folder: RunFolder, name: str) -> str:
    """Say which run beside this one has the file; empty where none has."""
    if not folder.file(name).exists():
        return ""
    for other, manifest in list_runs(folder.path.parent):
        if other.run_id != folder.run_id and name in manifest.files:
            if not (folder.is_unchanged(name, manifest.files[name])):
                continue
            return f"; it is that of run {other.run_id} ({manifest.label})"
    return ""


def _require_run(folder: RunFolder, name: str, run_id: str) -> None:
    """Refuse a recording whose header does not name the run."""
    if run_id != folder.run_id:
        raise RecordingError(
            f"{folder.file(name)}: belongs to {f'run {run_id}' if run_id else 'no run'}, not to"
            f" {folder.run_id}: put the original back",
            code="RID-RUN-MIXED",
        )


def _require_header(folder: RunFolder, header: JournalHeader, robot: RobotDescription) -> None:
    """Refuse a recording that says that it is of another run or robot."""
    _require_run(folder, RECORDING, header.run_id)
    path = folder.file(RECORDING)
    if header.joint_names != robot.joint_names or header.robot_name not in ("", robot.name):
        raise RecordingError(
            f"{path}: is of robot {header.robot_name!r} with the joints"
            f" {', '.join(header.joint_names)}; {ROBOT} beside it describes {robot.name!r}:"
            f" put the {ROBOT} back that it was recorded with",
            code="RID-RUN-MIXED",
        )


def clocks_of(runs: Sequence[RunData]) -> list[ClockSection]:
    """Return what is known of the runs' clocks."""
    return [
        ClockSection.of(data.clock, data.folder.run_id) for data in runs if data.clock is not None
    ]


def lacks(runs: Sequence[RunData]) -> list[str]:
    """Return what runs lack, one sentence each: their end, rows that are lost, sound imports."""
    said = []
    for data in runs:
        manifest = data.folder.manifest()
        name = manifest.label or data.folder.run_id
        match manifest.status:
            case RunStatus.UNFINISHED:
                said.append(f"{name}: was never finished: its end is missing")
            case RunStatus.STOPPED:
                said.append(f"{name}: was stopped before its end")
            case RunStatus.RECOVERED:
                lost = manifest.facts.get("rows_lost", 0)
                said.append(f"{name}: was recovered; {lost} rows are known to be lost")
        found = () if data.import_report is None else data.import_report.findings
        held = held_sentence(next(data.parts()))
        said += [f"{name}: {note}" for note in (*data.damage, *found, *([held] if held else ()))]
    return said


def every_lack(runs: Sequence[RunData]) -> list[str]:
    """Return what runs lack, and what their robot's kinematics lack."""
    return [*lacks(runs), *(runs[0].robot.kinematics.notes if runs else ())]


def report_lacks(context: Context, runs: Sequence[RunData]) -> list[str]:
    """Say what runs lack, and return it."""
    said = every_lack(runs)
    for note in said:
        context.say(f"note: {note}")
    return said


def _with_plate(folder: RunFolder, recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """Return a recording with its force plate's side, and what that has lost."""
    path = folder.file(PLATE_RECORDING)
    try:
        rows = read_plate_journal(path)
        both = with_plate(recording, rows)
    except (DataQualityError, RecordingError) as error:
        return recording, (f"force plate: not used: {error}",)
    _require_run(folder, PLATE_RECORDING, rows.header.run_id)
    return both, tuple(f"force plate: {note}" for note in rows.damage.notes)


def note_output(folder: RunFolder, output: Path) -> None:
    """Note a file that was written in the manifest, where it is a file of the run's folder.

    Raises:
        RecordingError: It cannot be read or noted.
    """
    if output.resolve().parent == folder.path.resolve():
        with contextlib.suppress(ConfigError):  # no name of a run's file: a stray
            folder.write(output.name, output.read_bytes())


def result_of(data: RunData, notes: Sequence[str] = ()) -> Result:
    """Return a run's result document, or a first one where it has none yet.

    Args:
        data: The run.
        notes: What the runs lack that the new part of the document rests on.

    Raises:
        RecordingError: There is one, and it cannot be read.
    """
    result = read_result(data.folder) if data.folder.file(RESULT).exists() else _first_result(data)
    return result.updated(notes=tuple(notes) or None)


def _first_result(data: RunData) -> Result:
    manifest, report = data.folder.manifest(), data.import_report
    section = RunSection.of("recording", "As recorded.", data.tally, data.robot)
    if report is not None:
        section = section.with_import(report)
    return Result.new(f"Run {manifest.label}", data.robot.name).updated(
        runs=(section,),
        timing=Timing(created_utc=manifest.created_utc, run_ids=(manifest.run_id,)),
    )
