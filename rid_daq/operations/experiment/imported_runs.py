"""`import_files`: import files or a bag of another program, one run for each range of rows."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from acquisition.imports.lines import LARGEST_FILE_BYTES
from acquisition.imports.read import import_csv
from acquisition.imports.report import ImportReport
from acquisition.imports.tables import Watch
from acquisition.journal.cycles import write_imported
from acquisition.journal.imported_plate import write_imported_plate
from acquisition.journal.plate import PLATE_RECORDING
from acquisition.maps.import_map import ImportMap, RowRange, load_import_map
from acquisition.recording.recording import Recording
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RECORDING, RunStatus, require_label
from acquisition.sources.array_tables import has_named_arrays, write_array_tables
from acquisition.sources.bags import convert_bag_to_table, is_bag, with_message_names
from config.errors import ConfigError
from config.formats.bounded_file import read_pieces
from config.load import to_yaml
from config.robot.robot import RobotDescription
from rid_daq.operations.experiment.import_ import ImportRequest, first_and_last
from rid_daq.operations.experiment.imported_plate import align_plate
from rid_daq.operations.operation import Context
from rid_daq.report.sections.verdict import VerdictSection
from rid_daq.report_page.write import write_result
from rid_daq.runs.origins import write_map_origin
from rid_daq.runs.run_data import IMPORT, MAP, ROBOT, SOURCES, RunData, result_of
from rid_daq.session.session import as_label, mark_unfinished
from rid_daq.session.versions import software_versions

WATCHED_BYTES: Final = 20_000_000
"""Size of files from which the progress of the reading is shown: about 1 s of computing [bytes]."""


@dataclass(frozen=True)
class ImportedRun:
    """A run made by an import: its folder, the import report, and the path of its report page."""

    folder: RunFolder
    report: ImportReport
    page: Path


def import_files(request: ImportRequest, context: Context | None = None) -> tuple[ImportedRun, ...]:
    """Import files; all parts are read before the first run folder is made.

    Args:
        request: The files, their map, and the ranges of rows.
        context: Shows the progress, if given.

    Raises:
        ConfigError: A file or the map cannot be read, they do not match, the number of labels
            differs from the number of runs, or a label is invalid.
        DataQualityError: The recording is not good enough.
        RecordingError: A run cannot be written.
    """
    if request.map is None:
        raise ConfigError("map is missing: give an import map", code="RID-OPTION-NEEDS")
    if request.robot is not None:
        raise ConfigError(
            "--robot has no effect with --map, which names the robot: leave one of them out",
            code="RID-OPTION-NO-EFFECT",
        )
    import_map, robot = load_import_map(request.map)
    ranges = [_parse_range(rows) for rows in request.rows] or [import_map.rows]
    if request.label and len(request.label) != len(ranges):
        raise ConfigError(
            f"--label: {len(request.label)} labels for {len(ranges)} runs: give one label per run",
            code="RID-OPTION-COUNT",
        )
    for label in request.label:
        require_label(label)
    named = request.file[0]
    files, layout = request.file, import_map
    with tempfile.TemporaryDirectory(prefix="rid-daq-") as place:
        if import_map.joint_states is not None:
            if len(files) > 1:
                raise ConfigError(
                    f"{files[1]}: a bag is imported alone: leave this file out",
                    code="RID-IMPORT-FILES",
                )
            files = (Path(place) / named.name,)
            layout = convert_bag_to_table(named, import_map, robot.joint_names, files[0])
            import_map = with_message_names(layout, import_map)
        elif is_bag(named) and any(isinstance(each, int) for each in import_map.column_roles):
            raise ConfigError(
                f"{named}: is a bag, but map {import_map.name!r} is for CSV files: give a map with"
                " `joint_states: {effort: torque}`, or one that names the fields of its messages",
                code="RID-IMPORT-FILES",
            )
        elif has_named_arrays(named):
            files, layout = write_array_tables(files, import_map, Path(place))
        maps = [import_map.model_copy(update={"rows": rows}) for rows in ranges]
        layouts = [layout.model_copy(update={"rows": rows}) for rows in ranges]
        with _watched(context, files) as watch:
            read = [
                align_plate(
                    files,
                    numbered,
                    robot,
                    *import_csv(
                        files[0],
                        each,
                        robot,
                        further=files[1:],
                        layout=None if layout is import_map else numbered,
                        watch=watch,
                    ),
                )
                for each, numbered in zip(maps, layouts, strict=True)
            ]
        stem = files[0].stem
        names = [f"{stem} {rows.first}-{rows.last or ''}" for rows in ranges]
        labels = request.label or map(as_label, [stem] if len(ranges) == 1 else names)
        return tuple(
            _write_run(
                RunFolder.create(request.runs, label, kind="import", software=software_versions()),
                files,
                numbered,
                robot,
                recording,
                replace(report, file=named.name),
                request.map,
            )
            for label, numbered, (recording, report) in zip(labels, layouts, read, strict=True)
        )


@contextmanager
def _watched(context: Context | None, files: Sequence[Path]) -> Iterator[Watch | None]:
    """Yield a function that shows the progress of the reading of large files; None for others."""
    if (
        context is None
        or sum(file.stat().st_size for file in files if file.is_file()) < WATCHED_BYTES
    ):
        yield None
        return
    with context.progress("Reading", 100.0, "%") as shown:

        def show(file: Path, share: float) -> None:
            line = file.name if share < 1.0 else f"{file.name}; checking and writing the rows"
            shown.update(100.0 * min(share, 1.0), line)

        yield show


def _parse_range(rows: str) -> RowRange:
    first, last = first_and_last(rows)
    return RowRange(first=first, last=last)


def _write_run(
    folder: RunFolder,
    files: tuple[Path, ...],
    import_map: ImportMap,
    robot: RobotDescription,
    recording: Recording,
    report: ImportReport,
    reference: str,
) -> ImportedRun:
    """Write the CSV files (made from the source if it has another format), map, data and report."""
    with mark_unfinished(folder):
        names = SOURCES[: len(files)]
        for name, file in zip(names, files, strict=True):
            folder.write(name, read_pieces(file, LARGEST_FILE_BYTES))
        comment = f"Import map with which {' and '.join(names)} was read."
        folder.write(MAP, to_yaml(import_map, comment).encode())
        robot = robot.model_copy(update={"meshes": None})  # their file stays next to the robot file
        folder.write(ROBOT, to_yaml(robot, f"Robot {robot.name}, as used by the import.").encode())
        folder.write(IMPORT, report.to_json())
        write_map_origin(folder, reference)
        recording = replace(recording, robot_name=robot.name, run_id=folder.run_id)
        write_imported(folder.file(RECORDING), recording)
        if recording.reaction is not None:
            path = folder.file(PLATE_RECORDING)
            write_imported_plate(path, recording.reaction, recording.time_s, folder.run_id)
        data = RunData.of(folder, recording, robot, report)
        of_plate = () if report.plate is None else report.plate.lines()
        sentences = [*report.lines()[:2], *of_plate, *report.findings]
        result = result_of(data).with_sections(
            title=f"Import of {report.file}",
            verdict=VerdictSection.of([], report.headline, f"{'. '.join(sentences)}."),
        )
        page = write_result(folder, result)
        folder.finish(RunStatus.COMPLETE, {"robot": robot.name, "rows": report.rows_used})
    return ImportedRun(folder, report, page)
