"""`rid-daq payload read-back`: what a controller holds, against what was measured."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from config.errors import ConfigError
from config.formats.bounded_file import read_file
from identification.payload.body import REPORTED, REPORTED_UNITS
from identification.payload.controllers.formats import LoadFormat, deviation, read_load_data
from identification.payload.file import read_payload
from rid_daq.report.formats import number
from rid_daq.report.sections.verdict import Check, Verdict
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode

LARGEST_FILE_BYTES = 1_000_000


def read_back(
    payload: Annotated[
        Path, typer.Argument(metavar="PAYLOAD", help="A payload file of `payload identify`.")
    ],
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Load data, as exported or saved from the robot.")
    ],
    form: Annotated[LoadFormat, typer.Option("--from", help="Whose controller it comes from.")],
    tolerance_percent: Annotated[
        float,
        typer.Option(
            "--tolerance", min=0.0, help="Largest difference [%]: controllers round what they hold."
        ),
    ] = 0.1,
    as_json: AsJson = False,
) -> None:
    """Parse load data and compare them with a payload; exit code 1 where they differ.

    Compared are the mass, the centre of gravity (as a share of its distance from the flange) and
    the inertia (as a share of its largest moment).
    """
    console = Console(as_json)
    body = read_payload(payload).estimate.body
    try:
        text = read_file(file, LARGEST_FILE_BYTES).decode("utf-8", errors="replace")
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read: {error.strerror}") from error
    try:
        found = read_load_data(text, form)
    except ConfigError as error:
        raise ConfigError(f"{file}: {error}") from None
    difference = 100.0 * deviation(body, found, form)
    line = Check.of("largest difference", difference, "≤", tolerance_percent, "%")
    passed = line.passed
    headline = (
        f"Passed: {file} holds the payload"
        if passed
        else f"Failed: {file} differs from the payload by {number(difference, 3)} %"
    )
    console.document(
        {
            "file": str(file),
            "format": form.value,
            "verdict": Verdict.of([line], headline, "Compared with what was measured."),
            "read": dict(zip(REPORTED, (float(x) for x in found.reported), strict=True)),
        }
    )
    console.table(
        ("parameter", "measured", "read", "unit"),
        [
            (name, number(float(wanted), 6), number(float(held), 6), unit)
            for name, unit, wanted, held in zip(
                REPORTED, REPORTED_UNITS, body.reported, found.reported, strict=True
            )
        ],
    )
    console.verdict(passed, headline)
    if not passed:
        raise typer.Exit(ExitCode.VERDICT_FAILED)
