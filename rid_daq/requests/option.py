"""`Option`: presentation of a request's field on the command line, in schemas and in forms."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal, NamedTuple

from pydantic import Field, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from config.plausible import Plausible
from rid_daq.terminal.choices import DEFAULT_RUNS as DEFAULT_RUNS

OPTIONS: Final = "Options"
FILES: Final = "Files and services"


class FurtherNumber(NamedTuple):
    """A number of a tuple that has its own option on the command line."""

    flag: str
    default: float
    description: str


@dataclass(frozen=True)
class Option:
    """Presentation of a request's field; the field itself has its type and its description.

    Attributes:
        group: Section of the help and of a form.
        unit: Unit of the value; empty for texts and ratios.
        metavar: Placeholder of the value in the help.
        flag: Name on the command line without dashes, if it differs from the field's name.
        short: One-letter name on the command line.
        positional: True if the command line takes the field as an argument.
        negatable: True if `--no-FLAG` exists too.
        file: Role of a path, input or output; empty if a client of the service cannot name it.
        endings: Allowed endings of an output file's name; any ending if empty.
        owned: True if only the service sets the field, not a client.
        needs: Name of the field without which this one has no effect.
        unused_with: Names of the fields with which this one has no effect.
        hidden: True if the command line does not offer the field.
        separator: Separator of several values in one word of the command line.
        value: Value of the field if its option is given; the option then takes no value.
        further: Numbers of a tuple after its first one, each with its own option.
    """

    group: str = OPTIONS
    unit: str = ""
    metavar: str = ""
    flag: str = ""
    short: str = ""
    positional: bool = False
    negatable: bool = False
    file: Literal["", "input", "output"] = ""
    endings: tuple[str, ...] = ()
    owned: bool = False
    needs: str = ""
    unused_with: tuple[str, ...] = ()
    hidden: bool = False
    separator: str = ""
    value: object = None
    further: tuple[FurtherNumber, ...] = ()

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Add unit, section, file role and dependency to the JSON schema of the field."""
        own = {
            "x-group": self.group,
            "x-unit": self.unit,
            "x-file": self.file,
            "x-needs": self.needs,
            "x-unused-with": list(self.unused_with),
        }
        return {**handler(schema), **{key: value for key, value in own.items() if value}}


CellName = Annotated[
    str,
    Field(description="Bundled cell, such as ir361 or kr15, or a cell file."),
    Option(positional=True, metavar="CELL", owned=True),
]

Overwrite = Annotated[
    bool,
    Field(description="Replace existing output files of the same kind."),
    Option(group=FILES, negatable=True),
]

RunName = Annotated[
    str,
    Field(description="Run: a folder, an id, a label, or `latest`."),
    Option(positional=True, metavar="RUN"),
]

RunNames = Annotated[
    tuple[str, ...],
    Field(min_length=1, description="Runs: folders, ids, labels, or `latest`."),
    Option(positional=True, metavar="RUN..."),
]

RunsFolder = Annotated[
    Path,
    Field(description="Folder of the run folders."),
    Option(group=FILES, metavar="FOLDER", owned=True),
]

_StatedPayload = Annotated[
    str | None,
    Field(
        description="What the robot carries: a payload file; a YAML file with known `bodies` on any"
        " link; a run or session with a payload; `model` for the payload in the model; or `none`."
        " Required if the model contains a payload (identified with --loaded)."
    ),
]
CarriedPayload = Annotated[_StatedPayload, Option(metavar="PAYLOAD", file="input")]
CarriedPayloadOfModel = Annotated[
    _StatedPayload, Option(metavar="PAYLOAD", file="input", needs="model")
]
"""As `CarriedPayload`, for a request whose model is optional; without a model it has no effect."""

_LoadChanges = Annotated[
    Path | None,
    Field(
        description="Load-change file: payloads that the robot takes up or puts down during the"
        " motion, with their times and load-transfer times. --payload states the payload before"
        " the first change."
    ),
]
LoadChangeFile = Annotated[_LoadChanges, Option(metavar="FILE", file="input")]
LoadChangeFileOfModel = Annotated[_LoadChanges, Option(metavar="FILE", file="input", needs="model")]

_DespiteMisfit = Annotated[
    bool,
    Field(description="Use a model that `identify` rejected; notes show the reasons."),
]
DespiteMisfit = Annotated[_DespiteMisfit, Option()]
DespiteMisfitOfModel = Annotated[_DespiteMisfit, Option(needs="model")]

Coordinate = Annotated[float, Field(ge=-100.0, le=100.0), Plausible(0.0, 20.0, "m")]
MeasuredPoint = Annotated[
    tuple[Coordinate, Coordinate, Coordinate] | None,
    Field(
        description="Nominal place of the measured point in the frame of the last link; the robot"
        " file's tool point if not set."
    ),
    Option(metavar="X,Y,Z", unit="m", separator=","),
]

Unfinished = Annotated[
    bool,
    Field(
        description="Use also a run that was never finished, for example because its program was"
        " killed; the report says so."
    ),
    Option(group=FILES),
]
