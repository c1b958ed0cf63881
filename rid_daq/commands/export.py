"""`rid-daq export`: an identified model, or a run's recording, for other programs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from acquisition.recording.files import RecordingFormat, recording_bytes
from acquisition.recording.table import recording_table
from acquisition.runs.catalogue import find_run
from acquisition.runs.folder import RunFolder
from config.errors import ConfigError, EstimationError
from config.formats.whole_file import write_whole
from identification.consistency.closest_robot import ConsistentEstimate, consistent
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate
from identification.export.description import pinocchio_model, sdf, urdf
from identification.export.function import c_function, python_function
from identification.export.model import ExportModel
from identification.export.table import csv_table, json_table
from rid_daq.runs.run_data import RunData, Unfinished, report_lacks
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.inapplicable_options import refuse_inapplicable
from rid_daq.terminal.output_file import Overwrite, refuse_output


class Format(StrEnum):
    """What can be written."""

    URDF = "urdf"
    SDF = "sdf"
    PINOCCHIO = "pinocchio"
    C = "c"
    PYTHON = "python"
    CSV = "csv"
    JSON = "json"
    PARQUET = "parquet"
    MAT = "mat"
    MDF4 = "mdf4"


_RECORDINGS: Final = tuple(Format(form.value) for form in RecordingFormat)
_RECORDINGS_ONLY: Final = (Format.PARQUET, Format.MAT, Format.MDF4)
_NEED_NO_LINKS: Final = (Format.C, Format.PYTHON, Format.CSV, Format.JSON)


def export(
    context: typer.Context,
    what: Annotated[
        str,
        typer.Argument(
            metavar="MODEL|RUN", help="A model file of identify; or a run folder, its id or label."
        ),
    ],
    to: Annotated[
        Format,
        typer.Option(
            "--to",
            help="Of a model: urdf, sdf, pinocchio: a robot description with inertias; c, python: a"
            " function for inverse dynamics; csv, json: a table of the parameters. Of a run: csv,"
            " parquet, mat, mdf4: everything recorded, a column a quantity and joint.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The file to write.")
    ],
    as_identified: Annotated[
        bool,
        typer.Option(
            "--as-identified",
            help="Functions and tables with the identified parameters alone, not those of a robot"
            " that can exist: the same torques as the model file, but a mass matrix that need not"
            " be positive.",
        ),
    ] = False,
    despite_misfit: Annotated[
        bool,
        typer.Option(
            "--despite-misfit",
            help="Write the nearest robot that can exist although the data speak against it; the"
            " file says so.",
        ),
    ] = False,
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Write an identified model, or a run's recording, for other programs.

    Of a model the parameters are those that real bodies can have and that are closest to the
    identified ones; where no such robot explains the data, nothing is written. What a format cannot
    say stands at its top. Tables hold both, with the identified parameters' intervals. Of a run
    every row is written as it was recorded.
    """
    console = Console(as_json)
    refuse_output(output, overwrite)
    if not _is_model(what):
        refuse_inapplicable(context, {"as_identified", "despite_misfit"}, "with a recording")
        data = _recorded(find_run(runs, what), to, unfinished)
        _export_recording(console, data, to, output)
        return
    refuse_inapplicable(context, {"unfinished"}, "with a model file")
    if to in _RECORDINGS_ONLY:
        raise ConfigError(f"--to {to.value} is for recordings, and {what} is a model file")
    if as_identified and to not in _NEED_NO_LINKS:
        raise ConfigError(
            f"--as-identified is for {', '.join(_NEED_NO_LINKS)}: {to.value} describes links, and"
            " the identified parameters are sums over several"
        )
    estimate = read_estimate(Path(what))
    if as_identified:
        refuse_inapplicable(context, {"despite_misfit"}, "with --as-identified")
        chosen, sentence = _identified(estimate), "Parameters as identified."
    else:
        found = consistent(estimate)
        sentence = _distance(found)
        _refuse_misfit(found, to, despite_misfit)
        chosen = _consistent(found, sentence)
    write_whole(output, _text(estimate, chosen, to, as_identified).encode())
    console.document(
        {
            "file": str(output),
            "format": to.value,
            "robot": estimate.robot.name,
            "parameters": "identified" if as_identified else "consistent",
            "sentence": sentence,
        }
    )
    console.say(sentence)
    console.verdict(True, f"Wrote {output}")


def _is_model(what: str) -> bool:
    """Return whether a model file is meant: anything but a folder, or a name that is no path."""
    path = Path(what)
    return path.is_file() or (bool(path.suffix) and not path.is_dir())


def _recorded(folder: RunFolder, to: Format, unfinished: bool) -> RunData:
    """Return the run whose recording is to be written in a format for recordings."""
    if to not in _RECORDINGS:
        model = folder.path / "model.json"
        raise ConfigError(
            f"--to {to.value} is for models: give a model file"
            + (f", as {model}" if model.exists() else " of `rid-daq identify`")
        )
    return RunData.load(folder, unfinished=unfinished)


def _export_recording(console: Console, data: RunData, to: Format, output: Path) -> None:
    notes = report_lacks(console, [data])
    table = recording_table(data.recording, data.robot)
    write_whole(output, recording_bytes(table, RecordingFormat(to.value)))
    console.document(
        {
            "file": str(output),
            "format": to.value,
            "run": data.folder.run_id,
            "rows": len(data.recording),
            "columns": [{"name": each.name, "unit": each.unit} for each in table.columns],
            "damage": list(data.damage),
            "notes": notes,
        }
    )
    console.verdict(
        True, f"Wrote {output}: {len(data.recording)} rows, {len(table.columns)} columns"
    )


def _text(estimate: Estimate, chosen: ExportModel, to: Format, as_identified: bool) -> str:
    links = None if as_identified else chosen
    match to:
        case Format.PARQUET | Format.MAT | Format.MDF4:
            raise AssertionError(to)
        case Format.C:
            return c_function(chosen)
        case Format.PYTHON:
            return python_function(chosen)
        case Format.CSV:
            return csv_table(estimate, links)
        case Format.JSON:
            return json_table(estimate, links)
        case Format.URDF:
            return urdf(chosen)
        case Format.SDF:
            return sdf(chosen)
        case Format.PINOCCHIO:
            return pinocchio_model(chosen)


def _identified(estimate: Estimate) -> ExportModel:
    return ExportModel(
        estimate.robot,
        estimate.model,
        estimate.standard_values,
        (*_origin(estimate), "Parameters as identified: torques are those of the model file."),
    )


def _consistent(found: ConsistentEstimate, sentence: str) -> ExportModel:
    estimate = found.estimate
    return ExportModel(
        estimate.robot, estimate.model, found.standard_values, (*_origin(estimate), sentence)
    )


def _distance(found: ConsistentEstimate) -> str:
    """Say how far the robot that can exist is from what was identified."""
    moved = found.moved_sigmas
    worst = int(np.argmax(np.abs(moved)))
    explains = "explains" if found.can_exist else "DOES NOT explain"
    return (
        f"The nearest robot that can exist {explains} the data (p = {found.p_value:.2g}); the"
        f" parameter moved most is {found.estimate.base.names[worst]}, by"
        f" {abs(moved[worst]):.2g} standard deviations."
    )


def _refuse_misfit(found: ConsistentEstimate, to: Format, despite_misfit: bool) -> None:
    if found.can_exist or despite_misfit:
        return
    also = ", write what was identified (--as-identified)" if to in _NEED_NO_LINKS else ""
    raise EstimationError(
        f"{_distance(found)} The model lacks something, or the intervals are too narrow: compare"
        f" models and measure with another motion{also}, or accept it (--despite-misfit)"
    )


def _origin(estimate: Estimate) -> tuple[str, ...]:
    where = f", cell {estimate.cell_name}" if estimate.cell_name else ""
    runs = ", ".join(estimate.run_ids) or "unnamed runs"
    return (f"Identified from {runs}{where}.",)
