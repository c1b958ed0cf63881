"""`rid-daq compensate`: the feedforward that makes a motion accurate, from model and loops."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.estimate_options import LoopsFile, ModelFile, Temperature
from rid_daq.terminal.options import DEFAULT_RUNS, CellName, Overwrite, RunsFolder, Unfinished


def compensate(
    cell: CellName,
    motion: Annotated[Path, typer.Argument(metavar="MOTION", help="A motion file.")],
    model: ModelFile,
    loop: LoopsFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FEEDFORWARD", help="The file to write.")
    ],
    reference: Annotated[
        str | None,
        typer.Option(
            metavar="RUN",
            help="Tune scale and delay of every axis by this run of a periodic motion.",
        ),
    ] = None,
    temperature: Temperature = None,
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Compute the speeds that make the drives produce the torques that the motion takes.

    A reference run, of this or another periodic motion and with or without compensation, tunes what
    model, loops and transport delay get wrong together; it is averaged over its periods. Nothing
    moves. `rid-daq record CELL MOTION --feedforward FEEDFORWARD` runs the motion with it.
    """
    from rid_daq.jobs.feedforward_job import CompensateRequest
    from rid_daq.performers.compensation.compensate import perform

    request = CompensateRequest(
        cell, motion, model, loop, output, runs, reference, temperature, overwrite, unfinished
    )
    here_or_there(service, JobKind.COMPENSATE, request, Console(as_json), perform)
