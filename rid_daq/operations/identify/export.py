"""`export`: write a model, or the recording of a run, for other programs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, TypedDict

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Text, Verdict, note_blocks
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import DEFAULT_RUNS, FILES, Option, Overwrite, RunsFolder, Unfinished
from rid_daq.requests.request import Request
from rid_daq.terminal.choices import Format

if TYPE_CHECKING:
    from acquisition.recording.table import RecordingTable
    from identification.consistency.consistency_test import ConsistencyTest
    from rid_daq.operations.identify.exported_torques import ExportedTorques
    from rid_daq.operations.identify.updated_urdf import UpdatedUrdfSection
    from rid_daq.runs.run_data import RunData


ENDINGS: Final[dict[Format, tuple[str, ...]]] = {
    Format.URDF: (".urdf", ".xml"),
    Format.SDF: (".sdf",),
    Format.MJCF: (".xml",),
    Format.PINOCCHIO: (".py",),
    Format.KDL: (".yaml",),
    Format.C: (".c",),
    Format.PYTHON: (".py",),
    Format.CSV: (".csv",),
    Format.JSON: (".json",),
    Format.PARQUET: (".parquet",),
    Format.MAT: (".mat",),
    Format.MDF4: (".mf4",),
}
"""Endings of the files of each format; the command line accepts others too, such as .txt."""


class ExportRequest(Request):
    """Write an identified model, or the recording of a run, for other programs.

    For a model, the physically consistent parameters closest to the identified ones are written; if
    they do not explain the data, nothing is written unless --despite-misfit or --as-identified is
    given. If `identify` rejected the model, --despite-misfit is always needed. A comment in the
    file lists what its format cannot express. Tables contain both sets of parameters, and the
    intervals of the identified ones. For a run, every row is written. If the drives reported
    temperatures, the torques are corrected for warm torque constants.
    """

    what: Annotated[
        str,
        Field(description="Model file of `identify`; or a run: a folder, an id or a label."),
        Option(positional=True, metavar="MODEL|RUN", file="input"),
    ]
    to: Annotated[
        Format,
        Field(
            description="File format. For a model: urdf, sdf, mjcf, pinocchio (robot description"
            " with inertias); kdl (parameters of ROS 2's inverse_dynamics_solver); c, python"
            " (function of the inverse dynamics); csv, json (table of parameters). For a run: csv,"
            " parquet, mat, mdf4, with one column per quantity and joint."
        ),
        Option(metavar="FORMAT"),
    ]
    output: Annotated[
        Path,
        Field(description="File to write."),
        Option(
            short="o",
            metavar="FILE",
            group=FILES,
            file="output",
            endings=tuple(dict.fromkeys(chain.from_iterable(ENDINGS.values()))),
        ),
    ]
    urdf: Annotated[
        Path | None,
        Field(
            description="Your URDF of the robot. With --to urdf, the output is this file with the"
            " identified inertias and friction; everything else stays byte for byte. With --to"
            " kdl, the parameters are for this file."
        ),
        Option(metavar="FILE", file="input"),
    ] = None
    tip: Annotated[
        str | None,
        Field(description="Link behind the arm's last joint, if the URDF has several equal arms."),
        Option(metavar="LINK", needs="urdf"),
    ] = None
    as_identified: Annotated[
        bool,
        Field(
            description="Write functions and tables with the identified parameters only, not"
            " with physically consistent ones. The torques are those of the model"
            " file, but the mass matrix can lose positive definiteness."
        ),
    ] = False
    despite_misfit: Annotated[
        bool,
        Field(
            description="Write the closest physically consistent model even if it contradicts"
            " the data (the file says so), or a model that `identify` rejected."
        ),
    ] = False
    overwrite: Overwrite = False
    unfinished: Unfinished = False
    runs: RunsFolder = DEFAULT_RUNS


class ExportedModelDocument(TypedDict):
    """A written model."""

    file: str
    format: str
    robot: str
    parameters: str
    sentence: str
    consistency: object
    torques: list[object]
    urdf: object
    notes: list[str]


@dataclass(frozen=True)
class ExportedModel:
    """A model that was written.

    Attributes:
        request: The request.
        sentence: Sentence on the distance of the written parameters from the identified ones.
        test: Test of the consistent parameters against the data.
        torques: Comparison of the file's torques with the model's; only for robot descriptions.
        urdf: The changes of a user's URDF, if one was updated.
        notes: What the file, or a solver that reads it, leaves out.
    """

    request: ExportRequest
    robot: str
    sentence: str
    test: ConsistencyTest | None
    torques: tuple[ExportedTorques, ...] = ()
    urdf: UpdatedUrdfSection | None = None
    notes: tuple[str, ...] = ()

    def document(self) -> ExportedModelDocument:
        """Return the properties of the written model."""
        from rid_daq.report.consistency_entry import ConsistencyEntry

        return {
            "file": str(self.request.output),
            "format": self.request.to.value,
            "robot": self.robot,
            "parameters": "identified" if self.request.as_identified else "consistent",
            "sentence": self.sentence,
            "consistency": None if self.test is None else ConsistencyEntry.of(self.test),
            "torques": list(self.torques),
            "urdf": self.urdf,
            "notes": list(self.notes),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the sentence, changes of a URDF, torques, notes and the file name."""
        yield Text(text=self.sentence)
        if self.urdf is not None:
            yield from self.urdf.blocks()
        if self.torques:
            from rid_daq.operations.identify.exported_torques import torque_blocks

            yield from torque_blocks(self.torques)
        yield from note_blocks(self.notes)
        yield Verdict(passed=True, text=f"Wrote {self.request.output}")


class ExportedRecordingDocument(TypedDict):
    """A written recording."""

    file: str
    format: str
    run: str
    rows: int
    columns: list[dict[str, str]]
    damage: list[str]
    notes: list[str]


@dataclass(frozen=True)
class ExportedRecording:
    """A recording that was written.

    Attributes:
        request: The request.
        data: The run.
        table: Columns of the file.
        notes: Defects of the run's data.
    """

    request: ExportRequest
    data: RunData
    table: RecordingTable
    notes: list[str]

    def document(self) -> ExportedRecordingDocument:
        """Return the properties of the written recording."""
        return {
            "file": str(self.request.output),
            "format": self.request.to.value,
            "run": self.data.folder.run_id,
            "rows": len(self.data.recording),
            "columns": [{"name": each.name, "unit": each.unit} for each in self.table.columns],
            "damage": list(self.data.damage),
            "notes": self.notes,
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the notes, and the numbers of rows and columns."""
        yield from note_blocks(self.notes)
        size = f"{len(self.data.recording)} rows, {len(self.table.columns)} columns"
        yield Verdict(passed=True, text=f"Wrote {self.request.output}: {size}")


def run(request: ExportRequest, _context: Context) -> ExportedModel | ExportedRecording:
    """Write the model or the recording."""
    from rid_daq.operations.identify.exported_files import export_file

    return export_file(request)


OPERATION: Final = Operation(
    name="export",
    label="Export a model or a recording",
    request=ExportRequest,
    run=run,
    examples=(
        "export model.json --to urdf --output robot.urdf",
        "export model.json --to urdf --urdf arm.urdf --output identified.urdf",
        "export latest --to parquet --output recording.parquet --overwrite",
    ),
    module="rid_daq.operations.identify.exported_files",
)
