"""`rid-daq export`: an identified model for other programs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from config.errors import ConfigError
from config.whole_file import write_whole
from identification.estimate import Estimate
from identification.estimate_file import read_estimate
from identification.export_description import pinocchio_model, sdf, urdf
from identification.export_function import c_function, python_function
from identification.export_model import ExportModel
from identification.export_table import csv_table, json_table
from rid_daq.console import AsJson, Console


class Format(StrEnum):
    """What can be written."""

    URDF = "urdf"
    SDF = "sdf"
    PINOCCHIO = "pinocchio"
    C = "c"
    PYTHON = "python"
    CSV = "csv"
    JSON = "json"


def export(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="A model file of identify.")],
    to: Annotated[
        Format,
        typer.Option(
            "--to",
            help="urdf, sdf, pinocchio: a robot description with inertias; c, python: a function"
            " for inverse dynamics; csv, json: a table of the parameters.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The file to write.")
    ],
    overwrite: Annotated[bool, typer.Option(help="Replace FILE if it is there.")] = False,
    as_json: AsJson = False,
) -> None:
    """Write an identified model for simulators, controllers and tables.

    Robot descriptions hold the physically consistent links and are refused where there are none.
    Functions hold every term of the model. What a format cannot say stands at its top.
    """
    console = Console(as_json)
    if output.exists() and not overwrite:
        raise ConfigError(f"{output}: is already there; give another name, or --overwrite")
    estimate = read_estimate(model)
    text = _text(estimate, to)
    write_whole(output, text.encode())
    console.document({"file": str(output), "format": to.value, "robot": estimate.robot.name})
    console.verdict(True, f"Wrote {output}")


def _text(estimate: Estimate, to: Format) -> str:
    match to:
        case Format.C:
            return c_function(_identified(estimate))
        case Format.PYTHON:
            return python_function(_identified(estimate))
        case Format.CSV:
            return csv_table(estimate)
        case Format.JSON:
            return json_table(estimate)
        case Format.URDF:
            return urdf(_identified(estimate))
        case Format.SDF:
            return sdf(_identified(estimate))
        case Format.PINOCCHIO:
            return pinocchio_model(_identified(estimate))


def _identified(estimate: Estimate) -> ExportModel:
    return ExportModel(
        estimate.robot,
        estimate.model,
        estimate.standard_values,
        (*_origin(estimate), "Parameters as identified: torques are those of the model file."),
    )


def _origin(estimate: Estimate) -> tuple[str, ...]:
    where = f", cell {estimate.cell_name}" if estimate.cell_name else ""
    runs = ", ".join(estimate.run_ids) or "unnamed runs"
    return (f"Identified from {runs}{where}.",)
