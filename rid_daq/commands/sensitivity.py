"""`rid-daq sensitivity`: what wrong knowledge of a robot does to a payload's estimate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rid_daq.terminal.choices import Against
from rid_daq.terminal.console import Console
from rid_daq.terminal.inapplicable_options import refuse_inapplicable
from rid_daq.terminal.options import AsJson, Overwrite, Scheduler
from rid_daq.terminal.plausible_option import SHARE, plausible

PAYLOAD = "medium"


def sensitivity(
    context: typer.Context,
    cell: Annotated[
        str, typer.Argument(metavar="CELL", help="A bundled cell, or a path to a cell file.")
    ] = "kr15",
    payload: Annotated[
        str,
        typer.Option(
            help="A payload of the simulated cell by name, or a file of payload identify."
        ),
    ] = PAYLOAD,
    against: Annotated[
        Against | None,
        typer.Option(
            help="Less a model of the unloaded robot, or less a run without the payload; torque"
            " constants by the latter and all else by the former if not given."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL", help="A model file of identify: the robot, where it is not simulated."
        ),
    ] = None,
    motion: Annotated[
        str | None,
        typer.Option(
            metavar="MOTION", help="A periodic motion; harmonics 1 and 20 of 30 s if not given."
        ),
    ] = None,
    share_percent: Annotated[
        float,
        typer.Option(
            "--share", min=0.001, max=90.0, callback=SHARE, help="How wrong beliefs are [%]."
        ),
    ] = 10.0,
    bias_nm: Annotated[
        float,
        typer.Option(
            "--bias",
            callback=plausible(1e-2, 1e4, "N m"),
            help="Torque bias of axis 3 in the table [N m].",
        ),
    ] = -12.0,
    draws: Annotated[
        int,
        typer.Option(min=0, max=10_000_000, help="Monte Carlo over noise and doubts; 0 for none."),
    ] = 0,
    doubt_torque_percent: Annotated[
        float,
        typer.Option(
            "--doubt-torque-constants",
            min=0.0,
            callback=SHARE,
            help="Each torque constant's 1 σ [%].",
        ),
    ] = 0.0,
    doubt_links_percent: Annotated[
        float,
        typer.Option(
            "--doubt-links", min=0.0, callback=SHARE, help="Each link parameter's 1 σ [%]."
        ),
    ] = 0.0,
    doubt_rotors_percent: Annotated[
        float,
        typer.Option(
            "--doubt-rotors", min=0.0, callback=SHARE, help="Each rotor inertia's 1 σ [%]."
        ),
    ] = 0.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the draws.")] = 0,
    scheduler: Scheduler = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="CSV", help="The table as CSV.")
    ] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Tell what wrong torque constants, links, rotors, coupling or gears do to a payload.

    Each row simulates the robot with one thing different from what is assumed, estimates the
    payload as if all were right, and gives the deviation in percent of the true value. With
    --draws, noise and doubts are drawn by chance, on all cores or on a Dask cluster.
    """
    from identification.sensitivity.monte_carlo import PriorUncertainty
    from rid_daq.jobs.sensitivity_job import SensitivityRequest
    from rid_daq.performers.sensitivity import perform
    from rid_daq.runs import made_file
    from rid_daq.runs.output_file import refuse_output

    console = Console(as_json)
    refuse_output(output, overwrite, made_file.TABLE)
    if not draws:
        doubts = {"doubt_torque_percent", "doubt_links_percent", "doubt_rotors_percent"}
        refuse_inapplicable(context, doubts | {"seed", "scheduler"}, "without draws")
    request = SensitivityRequest(
        cell=cell,
        payload=payload,
        against=None if against is None else against.value,
        model=model,
        motion=motion,
        share=share_percent / 100.0,
        bias_nm=bias_nm,
        draws=draws,
        seed=seed,
        prior=PriorUncertainty(
            torque_constants=doubt_torque_percent / 100.0,
            links=doubt_links_percent / 100.0,
            rotors=doubt_rotors_percent / 100.0,
        ),
        scheduler=scheduler,
        output=output,
    )
    perform(request, console)
