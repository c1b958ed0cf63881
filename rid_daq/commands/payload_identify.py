"""`rid-daq payload identify`: a payload from recordings alone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from identification.choices import (
    BAND_HZ,
    REPORTED,
    STANDSTILL_RAD_S,
    PayloadLimits,
    TorqueConstantSigma,
)
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.choices import PAYLOAD, How
from rid_daq.terminal.console import Console
from rid_daq.terminal.estimate_options import (
    Band,
    CentreLimit,
    FrictionTerms,
    InertiaLimit,
    MassLimit,
    ResidualLimit,
    Rotors,
    Standstill,
)
from rid_daq.terminal.options import (
    DEFAULT_RUNS,
    AsJson,
    Overwrite,
    RunsFolder,
    Service,
    Unfinished,
)
from rid_daq.terminal.plausible_option import plausible_as


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
            metavar="MODEL",
            help="A model file of `identify`: the robot without payload. Runs of --unloaded are"
            " compared with it.",
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
        float | None,
        typer.Option(
            "--torque-constant-sigma",
            min=0.0,
            max=50.0,
            callback=plausible_as(TorqueConstantSigma, percent=True),
            metavar="PERCENT",
            help="What is not known of each torque constant (1 σ): widens the intervals. 1 % if"
            " not given; `apart` counts them as right.",
        ),
    ] = None,
    mass_limit_percent: MassLimit = PayloadLimits.mass_percent,
    centre_limit_mm: CentreLimit = PayloadLimits.centre_mm,
    inertia_limit_percent: InertiaLimit = PayloadLimits.inertia_percent,
    residual_limit_percent: ResidualLimit = PayloadLimits.residual_percent,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help=f"The payload file; {PAYLOAD} in the run if not."
        ),
    ] = None,
    band_hz: Band = BAND_HZ,
    standstill_rad_s: Standstill = STANDSTILL_RAD_S,
    rotors: Rotors = True,
    friction_terms: FrictionTerms = None,
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Identify a payload: mass, centre of gravity and inertia, from runs with and without it.

    Friction is free in every run. Exit code 1 where the payload is less sure than the limits ask
    for, 6 where the torque of an axis is not explained; what the motion does not show is named,
    with the motion that would.
    """
    from identification.model.options import ModelOptions
    from rid_daq.jobs.identification_job import friction_terms_of
    from rid_daq.jobs.payload.identify_job import PayloadIdentifyRequest
    from rid_daq.jobs.payload.payload_job import known_quantity
    from rid_daq.performers.payload.identify import perform

    request = PayloadIdentifyRequest(
        loaded=loaded,
        unloaded=unloaded or (),
        runs=runs,
        model=model,
        procedure=None if procedure is None else procedure.value,
        known=tuple(known_quantity(text) for text in known or []),
        torque_constant_sigma=None
        if torque_constant_sigma is None
        else torque_constant_sigma / 100.0,
        limits=PayloadLimits(
            mass_limit_percent, centre_limit_mm, inertia_limit_percent, residual_limit_percent
        ),
        band_hz=band_hz,
        standstill_rad_s=standstill_rad_s,
        options=ModelOptions(rotors=rotors, friction_terms=friction_terms_of(friction_terms)),
        unfinished=unfinished,
        output=output,
        overwrite=overwrite,
    )
    here_or_there(service, JobKind.PAYLOAD_IDENTIFY, request, Console(as_json), perform)
