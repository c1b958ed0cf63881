"""`rid-daq retime`: a motion's path as fast as the torques of a model allow."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from config.ranges import Confidence, FreeShare, Rate, least, most
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.terminal.choices import DEFAULT_CONFIDENCE
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.estimate_options import BaseMass, ModelFile, Temperature
from rid_daq.terminal.inapplicable_options import refuse_inapplicable
from rid_daq.terminal.options import CellName, Overwrite


def retime(
    context: typer.Context,
    cell: CellName,
    motion: Annotated[
        Path, typer.Argument(metavar="MOTION", help="A motion file: a path of any kind.")
    ],
    model: ModelFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="MOTION", help="The motion file to write.")
    ],
    confidence: Annotated[
        float,
        typer.Option(
            min=least(Confidence),
            max=most(Confidence),
            help="With which probability the robot's torques keep to their limits at any instant;"
            " 0: the model's alone.",
        ),
    ] = DEFAULT_CONFIDENCE,
    margin: Annotated[
        float,
        typer.Option(
            min=least(FreeShare),
            max=most(FreeShare),
            help="Share of torques and base wrench that is kept free besides.",
        ),
    ] = 0.0,
    payload: Annotated[
        Path | None, typer.Option(metavar="PAYLOAD", help="What it carries, by `payload`.")
    ] = None,
    torque_rate: Annotated[
        list[float] | None,
        typer.Option(
            min=least(Rate),
            max=most(Rate),
            metavar="NM_S",
            help="How fast torques may change [N m/s]; one, or repeat for each.",
        ),
    ] = None,
    jerk: Annotated[
        list[float] | None,
        typer.Option(
            min=least(Rate),
            max=most(Rate),
            metavar="RAD_S3",
            help="How fast accelerations may change [rad/s³]; one, or repeat for each joint.",
        ),
    ] = None,
    rms_torque: Annotated[
        list[float] | None,
        typer.Option(
            min=least(Rate),
            max=most(Rate),
            metavar="NM",
            help="Largest root mean square of the torques [N m]; one, or repeat for each joint.",
        ),
    ] = None,
    base: Annotated[
        bool,
        typer.Option(
            "--base-limits",
            help="Keep the reaction on the base to the limits of the cell's plate; needs a combined"
            " model.",
        ),
    ] = False,
    mass_kg: BaseMass = None,
    temperature: Temperature = None,
    report: Annotated[
        Path | None, typer.Option(metavar="PAGE", help="A page with the pictures to write.")
    ] = None,
    overwrite: Overwrite = False,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Drive a motion's path as fast as the torques of a model allow.

    Joints, speeds, accelerations and torques keep to the robot file's limits; the path stays as it
    is, and what was asked of its speed is left aside. Every row is held against the model. Nothing
    moves: the result is a motion file for this cell's cycle time. Limits that cannot be kept to are
    named with joint and pose (exit code 3).
    """
    from rid_daq.jobs.retime_job import RetimeRequest
    from rid_daq.performers.compensation.retime import perform

    if not base:
        refuse_inapplicable(context, {"mass_kg"}, "without --base-limits")
    request = RetimeRequest(
        cell=cell,
        motion=motion,
        model=model,
        output=output,
        payload=payload,
        confidence=confidence,
        margin=margin,
        torque_rate=tuple(torque_rate or ()),
        jerk=tuple(jerk or ()),
        torque_rms=tuple(rms_torque or ()),
        base=base,
        mass_kg=mass_kg,
        temperature=temperature,
        report=report,
        overwrite=overwrite,
    )
    here_or_there(service, JobKind.RETIME, request, Console(as_json), perform)
