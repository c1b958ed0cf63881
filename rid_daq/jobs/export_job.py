"""`rid-daq export`: an identified model, or a run's recording, in the format of other programs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from acquisition.recording.files import RecordingFormat, recording_bytes
from acquisition.recording.table import RecordingTable, recording_table
from acquisition.runs.folder import RunFolder
from config.errors import ConfigError, EstimationError
from config.formats.whole_file import write_whole
from config.ranges import Ranged
from identification.consistency.closest_robot import consistent
from identification.consistency.consistency_test import ConsistencyTest
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate
from identification.export.description import pinocchio_model, sdf, urdf
from identification.export.function import c_function, python_function
from identification.export.model import ExportModel
from identification.export.table import csv_table, json_table
from identification.model.still_joints import refuse_still
from identification.regression.fit_grade import Grade
from rid_daq.runs.run_data import RunData, report_lacks
from rid_daq.terminal.choices import MODEL, Format
from rid_daq.terminal.console import Console

RECORDINGS: Final = tuple(Format(form.value) for form in RecordingFormat)
TABLES: Final[dict[Format, Callable[[Estimate, ExportModel | None], str]]] = {
    Format.CSV: csv_table,
    Format.JSON: json_table,
}
FUNCTIONS: Final[dict[Format, Callable[[ExportModel], str]]] = {
    Format.C: c_function,
    Format.PYTHON: python_function,
}
DESCRIPTIONS: Final[dict[Format, Callable[[ExportModel], str]]] = {
    Format.URDF: urdf,
    Format.SDF: sdf,
    Format.PINOCCHIO: pinocchio_model,
}
NEED_NO_LINKS: Final = (*FUNCTIONS, *TABLES)


@dataclass(frozen=True)
class ExportRequest(Ranged):
    """What `rid-daq export` was asked for.

    Attributes
    ----------
    what : str
        A model file, or a run.
    to : Format
        As what it is written.
    output : Path
        The file to write.
    runs : Path
        The folder of the run folders.
    as_identified, despite_misfit : bool
        Whether parameters stay as identified, and whether a robot is written that the data speak
        against.
    unfinished : bool
        Whether a run that was never finished will do.
    overwrite : bool
        Whether the file may be there already.
    """

    what: str
    to: Format
    output: Path
    runs: Path
    as_identified: bool = False
    despite_misfit: bool = False
    unfinished: bool = False
    overwrite: bool = False

    @property
    def is_model(self) -> bool:
        """Whether a model file is meant: a file that is there; all else means a run."""
        return Path(self.what).is_file()


@dataclass(frozen=True)
class ExportedModel:
    """A model that was written: whose, how far it is from what was identified, and its test."""

    robot: str
    sentence: str
    test: ConsistencyTest | None


@dataclass(frozen=True)
class ExportedRecording:
    """A recording that was written: the run, its rows and columns, and what it lacks."""

    data: RunData
    table: RecordingTable
    notes: list[str]


def export_model(request: ExportRequest) -> ExportedModel:
    """Write an identified model.

    Raises
    ------
    ConfigError
        The format is not for models, or not for parameters as identified.
    EstimationError
        The model does not explain its own data, no robot that can exist does, or the format cannot
        say the model.
    RecordingError
        The file cannot be written.
    """
    to, as_identified = request.to, request.as_identified
    if to not in NEED_NO_LINKS and to not in DESCRIPTIONS:
        raise ConfigError(
            f"--to {to.value} is for recordings, and {request.what} is a model file",
            code="RID-EXPORT-FORMAT",
        )
    if as_identified and to not in NEED_NO_LINKS:
        raise ConfigError(
            f"--as-identified is for {', '.join(NEED_NO_LINKS)}: {to.value} describes links, and"
            " the identified parameters are sums over several",
            code="RID-EXPORT-LINKS",
        )
    estimate = read_estimate(Path(request.what))
    if not as_identified:
        refuse_still(estimate.still, request.what)
    bad = [fit.joint for fit in estimate.fit if fit.grade is Grade.BAD]
    if bad and not request.despite_misfit:
        raise EstimationError(
            f"{request.what}: does not explain the torque of {', '.join(bad)} on its own data;"
            " correct the files and identify again (`rid-daq identify` says what is wrong), or"
            " accept it (--despite-misfit)",
            code="RID-MODEL-MISFIT",
        )
    if as_identified:
        chosen, sentence = ExportModel.identified(estimate), "Parameters as identified."
    else:
        found = consistent(estimate)
        chosen, sentence = ExportModel.consistent(found), found.sentence
        if not (found.test.is_consistent or request.despite_misfit):
            also = ", write what was identified (--as-identified)" if to in NEED_NO_LINKS else ""
            raise EstimationError(
                f"{sentence} The model lacks something, or the intervals are too narrow: compare"
                f" models and measure with another motion{also}, or accept it (--despite-misfit)",
                code="RID-MODEL-INCONSISTENT",
            )
    if to in TABLES:
        text = TABLES[to](estimate, None if as_identified else chosen)
    else:
        text = (FUNCTIONS | DESCRIPTIONS)[to](chosen)
    write_whole(request.output, text.encode())
    return ExportedModel(estimate.robot.name, sentence, chosen.test)


def export_recording(
    request: ExportRequest, folder: RunFolder, console: Console
) -> ExportedRecording:
    """Write everything that a run has recorded, row by row.

    Raises
    ------
    ConfigError
        The format is for models, or needs a library that is not installed.
    RidDaqError
        The run cannot be used, or the file not be written.
    """
    to = request.to
    if to not in RECORDINGS:
        model = folder.path / MODEL
        raise ConfigError(
            f"--to {to.value} is for models: give a model file"
            + (f", as {model}" if model.exists() else " of `rid-daq identify`"),
            code="RID-EXPORT-FORMAT",
        )
    data = RunData.load(folder, unfinished=request.unfinished)
    notes = report_lacks(console, [data])
    table = recording_table(data.recording, data.robot)
    write_whole(request.output, recording_bytes(table, RecordingFormat(to.value)))
    return ExportedRecording(data, table, notes)
