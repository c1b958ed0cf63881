"""What a run folder holds, as the objects that the commands work on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from acquisition.import_csv import import_csv
from acquisition.import_report import ImportReport
from acquisition.journal import read_journal
from acquisition.journal_file import being_written
from acquisition.monitor_stream import as_warm_as_measured
from acquisition.plate_alignment import with_plate
from acquisition.plate_journal import PLATE_RECORDING, read_plate_journal
from acquisition.recording import Recording
from acquisition.run_folder import RECORDING, RunFolder, RunStatus
from config.errors import DataQualityError, LockedError, RecordingError
from config.import_map import ImportMap
from config.load import load_bundled_or_path, load_robot
from config.robot import RobotDescription
from rid_daq.console import Console
from rid_daq.result import RESULT, Result, new_result, read_result
from rid_daq.sections import run_section

SOURCE = "source.csv"
MAP = "map.yaml"
ROBOT = "robot.yaml"


@dataclass(frozen=True)
class RunData:
    """A run's recording and robot.

    Attributes
    ----------
    folder : RunFolder
        Where they come from.
    recording : Recording
        What was measured, or imported.
    robot : RobotDescription
        The robot as used in that run.
    import_report : ImportReport or None
        What the import left out, for an imported run.
    damage : tuple of str
        What the recording has lost, one sentence each.
    """

    folder: RunFolder
    recording: Recording
    robot: RobotDescription
    import_report: ImportReport | None = None
    damage: tuple[str, ...] = ()

    @property
    def is_periodic(self) -> bool:
        """Whether the recording holds whole periods to average."""
        return self.recording.samples_per_period is not None


def read_run(folder: RunFolder) -> RunData:
    """Read a run's recording and robot.

    An imported run keeps the file as it came, with its map, and is read by them every time. Where
    the drives told their temperatures, torques are those of warm torque constants.

    Raises
    ------
    RecordingError
        The folder holds no recording, or it cannot be read.
    LockedError
        It is still being recorded.
    ConfigError, DataQualityError
        The robot or map file in it was changed so that it cannot be meant.
    """
    if not (folder.file(RECORDING).exists() or folder.file(SOURCE).exists()):
        raise RecordingError(
            f"{folder.path}: holds neither {RECORDING} nor {SOURCE}; nothing was recorded in this"
            " run"
        )
    robot = load_robot(str(folder.file(ROBOT)))
    if folder.file(RECORDING).exists():
        if being_written(folder.file(RECORDING)):
            raise LockedError(f"{folder.path}: is still being recorded; wait until it has ended")
        journal = read_journal(folder.file(RECORDING))
        recording, cold = as_warm_as_measured(journal.recording(), folder.path, robot)
        recording, notes = _with_plate(folder, recording)
        notes = (*cold, *notes)
        return RunData(folder, recording, robot, damage=(*journal.damage.notes, *notes))
    import_map = load_bundled_or_path(str(folder.file(MAP)), "maps", ImportMap)
    recording, report = import_csv(folder.file(SOURCE), import_map, robot, run_id=folder.run_id)
    return RunData(folder, replace(recording, robot_name=robot.name), robot, report)


def tell_lacks(console: Console, runs: Sequence[RunData]) -> None:
    """Say what runs lack: that one was stopped before its end, rows that are lost."""
    for data in runs:
        name = data.folder.manifest().label or data.folder.run_id
        if data.folder.manifest().status == RunStatus.STOPPED:
            console.say(f"note: {name}: was stopped before its end")
        for note in data.damage:
            console.say(f"note: {name}: {note}")


def _with_plate(folder: RunFolder, recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """Return a recording with its force plate's side, and what that has lost."""
    path = folder.file(PLATE_RECORDING)
    if not path.exists():
        return recording, ()
    try:
        rows = read_plate_journal(path)
        return with_plate(recording, rows), tuple(
            f"force plate: {note}" for note in rows.damage.notes
        )
    except (DataQualityError, RecordingError) as error:
        return recording, (f"force plate: not used: {error}",)


def result_of(data: RunData) -> Result:
    """Return a run's result document, or a first one where it has none yet.

    Raises
    ------
    RecordingError
        There is one, and it cannot be read.
    """
    if data.folder.file(RESULT).exists():
        return read_result(data.folder)
    manifest = data.folder.manifest()
    result = new_result(f"Run {manifest.label}", data.robot.name)
    section = run_section("recording", "As recorded.", data.recording, data.robot)
    if data.import_report is not None:
        report = data.import_report
        section["sentence"] = "; ".join(report.lines()[:2]) + "."
        section["bad_rows"] = [
            {
                "rows": f"{rows.first}-{rows.last}" if rows.last > rows.first else str(rows.first),
                "count": rows.count,
                "reason": ", ".join(
                    f"{count} {reason} (row {example.row}: {example.detail})"
                    for (reason, count), example in zip(rows.counts, rows.examples, strict=True)
                ),
            }
            for rows in report.damaged
        ]
    result["runs"] = [section]
    result["timing"] = {"created_utc": manifest.created_utc, "run_ids": [manifest.run_id]}
    return result
