"""`rid-daq payload identify`: a payload from recordings alone."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final, get_args

import typer

from acquisition.runs.catalogue import find_runs
from config.errors import ConfigError
from identification.estimation.file import read_estimate
from identification.estimation.options import BAND_HZ, STANDSTILL_RAD_S
from identification.model.options import ModelOptions
from identification.payload.body import REPORTED
from identification.payload.equations import Procedure
from identification.payload.file import write_payload
from identification.payload.procedures import PayloadOptions
from identification.payload.verdict import PayloadLimits
from rid_daq.jobs.payload_job import PAYLOAD, PayloadRequest, known_quantity, payload_from_runs
from rid_daq.report.result_file import write_result
from rid_daq.report.sections.payload import PayloadSection, payload_verdict
from rid_daq.runs.flange import compared
from rid_daq.runs.run_data import RunData, Unfinished, note_output, report_lacks, result_of
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.output_file import Overwrite, refuse_output


class How(StrEnum):
    """How the robot is told from what it carries."""

    TOGETHER = "together"
    DIFFERENCE = "difference"
    MODEL = "model"
    APART = "apart"


_PROCEDURES: Final[dict[str, Procedure]] = {name: name for name in get_args(Procedure)}


def identify(
    loaded: Annotated[
        list[str],
        typer.Option("--loaded", metavar="RUN", help="A run with the payload; repeat for more."),
    ],
    unloaded: Annotated[
        list[str] | None,
        typer.Option("--unloaded", metavar="RUN", help="A run without it; repeat for more."),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL", help="A model file of `identify`: the robot without payload."
        ),
    ] = None,
    procedure: Annotated[
        How | None,
        typer.Option(
            help="together: robot and payload at once; difference: torques of one motion,"
            " subtracted; model: less the robot of --model; apart: two robots, subtracted."
            " together if not given, model with --model.",
        ),
    ] = None,
    known: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE[±SIGMA]",
            help="Known otherwise, as m=2.805+-0.005 (1 σ; held without one):"
            f" {', '.join(REPORTED)} [kg, m, kg m^2 about the centre of gravity].",
        ),
    ] = None,
    torque_constant_sigma: Annotated[
        float,
        typer.Option(
            "--torque-constant-sigma",
            min=0.0,
            max=50.0,
            metavar="PERCENT",
            help="What is not known of each torque constant (1 σ): widens the intervals.",
        ),
    ] = 0.0,
    mass_limit_percent: Annotated[
        float, typer.Option("--mass-limit", min=0.0, help="2σ of the mass at most [%].")
    ] = PayloadLimits.mass_percent,
    centre_limit_mm: Annotated[
        float, typer.Option("--centre-limit", min=0.0, help="2σ of the centre at most [mm].")
    ] = PayloadLimits.centre_mm,
    inertia_limit_percent: Annotated[
        float,
        typer.Option(
            "--inertia-limit", min=0.0, help="2σ of inertia at most, of that about the flange [%]."
        ),
    ] = PayloadLimits.inertia_percent,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help=f"The payload file; {PAYLOAD} in the run if not."
        ),
    ] = None,
    band_hz: Annotated[
        float, typer.Option("--band", min=0.01, help="Highest frequency used [Hz].")
    ] = BAND_HZ,
    standstill_rad_s: Annotated[
        float, typer.Option("--standstill", min=0.0, help="Lowest speed used for friction [rad/s].")
    ] = STANDSTILL_RAD_S,
    rotors: Annotated[bool, typer.Option(help="Rotors with their coupling.")] = True,
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Identify a payload: mass, centre of gravity and inertia, from runs with and without it.

    Friction is free in every run. Exit code 1 where the payload is less sure than the limits ask
    for; what the motion does not show is named, with the motion that would.
    """
    console = Console(as_json)
    refuse_output(output, overwrite)
    names = [*(unloaded or []), *loaded]
    data = [RunData.load(folder, unfinished=unfinished) for folder in find_runs(runs, names)]
    notes = report_lacks(console, data)
    flags = [False] * (len(names) - len(loaded)) + [True] * len(loaded)
    robot = None if model is None else read_estimate(model)
    if procedure is None:
        procedure = How.TOGETHER if model is None else How.MODEL
    if procedure is How.MODEL and robot is None:
        raise ConfigError("--procedure model needs the robot without payload: --model MODEL")
    if procedure in (How.TOGETHER, How.DIFFERENCE) and robot is not None:
        raise ConfigError(f"--procedure {procedure.value} takes no --model: leave one of them out")
    payload_request = PayloadRequest(
        how=PayloadOptions(
            procedure=_PROCEDURES[procedure.value],
            options=ModelOptions(rotors=rotors),
            robot=robot,
            known=tuple(known_quantity(text) for text in known or []),
            torque_constant_sigma=torque_constant_sigma / 100.0,
        ),
        limits=PayloadLimits(mass_limit_percent, centre_limit_mm, inertia_limit_percent),
        band_hz=band_hz,
        standstill_rad_s=standstill_rad_s,
    )
    payload, repeats = payload_from_runs(data, flags, payload_request)
    first = data[flags.index(True)]
    output = output or first.folder.file(PAYLOAD)
    write_payload(output, payload)
    note_output(first.folder, output)
    section = PayloadSection.of(payload, repeats, compared(data, flags, payload))
    judged = payload_verdict(payload)
    result = result_of(first, notes).updated(
        title=f"Payload on {first.robot.name}", payload=section, verdict=judged
    )
    path = write_result(first.folder, result)
    console.document(
        {
            "file": str(output),
            "payload": section,
            "verdict": judged,
            "notes": notes,
            "report": str(path),
        }
    )
    section.print(console)
    console.verdict(payload.passed, judged.headline)
    console.say(f"Payload: {output}")
    console.say(f"Report: {path}")
    if payload.passed:
        console.next_step("payload", "export", output, "--to", "FORMAT", "-o", "FILE")
    else:
        raise typer.Exit(ExitCode.VERDICT_FAILED)
