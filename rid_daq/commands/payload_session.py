"""`rid-daq payload CELL`: a guided session from preflight to a payload with its verdict."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from config.ranges import Periods, Repeats, Seed, WarmUpPeriods, least, most
from identification.choices import (
    PayloadLimits,
    RehearsalPercent,
    UntilMassKg,
    WarmUpPercent,
)
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.console import Console
from rid_daq.terminal.estimate_options import CentreLimit, InertiaLimit, MassLimit, ResidualLimit
from rid_daq.terminal.options import (
    DEFAULT_LISTEN,
    DEFAULT_RUNS,
    AsJson,
    CellName,
    Certificate,
    Listen,
    Live,
    Pace,
    Practise,
    RunsFolder,
    Service,
    Token,
    WithoutAxisTest,
)
from rid_daq.terminal.plausible_option import plausible_as

_KEPT: Final = {
    name: name
    for name in (
        *("repeats", "model", "payload", "known", "until_mass_kg", "rehearsal_percent"),
        *("warm_up_percent", "warm_up_periods", "label", "seed"),
    )
} | {
    "mass_limit_percent": "mass_percent",
    "centre_limit_mm": "centre_mm",
    "inertia_limit_percent": "inertia_percent",
    "residual_limit_percent": "residual_percent",
}
"""Options that a session keeps from its beginning, unless they are given again: as `given` says."""


def session(
    context: typer.Context,
    cell: CellName,
    motion: Annotated[
        Path | None,
        typer.Option(metavar="MOTION", help="A periodic motion; one is searched if not given."),
    ] = None,
    periods: Annotated[
        int,
        typer.Option(
            min=least(Periods), max=most(Periods), help="Periods measured in each run at most."
        ),
    ] = 18,
    repeats: Annotated[
        int, typer.Option(min=least(Repeats), max=most(Repeats), help="Runs with the payload.")
    ] = 1,
    model: Annotated[
        Path | None,
        typer.Option(metavar="MODEL", help="The unloaded robot, in place of the unloaded run."),
    ] = None,
    payload: Annotated[
        str | None,
        typer.Option(help="What is hung on a simulated robot, by its name in the plant file."),
    ] = None,
    known: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE[+-SIGMA]", help="Known otherwise, as m=2.805+-0.005."),
    ] = None,
    until_mass_kg: Annotated[
        float | None,
        typer.Option(
            "--until-mass",
            min=least(UntilMassKg),
            callback=plausible_as(UntilMassKg),
            help="End the loaded run at this 2σ of the mass.",
        ),
    ] = None,
    rehearsal_percent: Annotated[
        float,
        typer.Option(
            "--rehearsal",
            min=least(RehearsalPercent),
            max=100.0,
            callback=plausible_as(RehearsalPercent),
            help="Speed of a first, slow period [%]; 0 skips it.",
        ),
    ] = 25.0,
    warm_up_percent: Annotated[
        float,
        typer.Option(
            "--warm-up",
            min=least(WarmUpPercent),
            callback=plausible_as(WarmUpPercent),
            help="Warm where friction changes less a period [%]; 0 skips it.",
        ),
    ] = 1.0,
    warm_up_periods: Annotated[
        int,
        typer.Option(
            "--warm-up-periods",
            min=least(WarmUpPeriods),
            max=most(WarmUpPeriods),
            help="Periods of the warm-up at most.",
        ),
    ] = 30,
    mass_limit_percent: MassLimit = PayloadLimits.mass_percent,
    centre_limit_mm: CentreLimit = PayloadLimits.centre_mm,
    inertia_limit_percent: InertiaLimit = PayloadLimits.inertia_percent,
    residual_limit_percent: ResidualLimit = PayloadLimits.residual_percent,
    label: Annotated[str, typer.Option(help="What to call the session and its runs.")] = "payload",
    resume: Annotated[
        str | None,
        typer.Option(
            metavar="SESSION",
            help="Go on with an interrupted session: its folder, id or label, or `latest`.",
        ),
    ] = None,
    yes: Annotated[
        bool,
        typer.Option(
            "--yes",
            help="Every question is answered with yes: the cell is clear, the payload is attached.",
        ),
    ] = False,
    practise: Practise = False,
    pace: Pace = None,
    seed: Annotated[
        int,
        typer.Option(min=least(Seed), max=most(Seed), help="Of the motion and a simulated cell."),
    ] = 0,
    without_axis_test: WithoutAxisTest = False,
    live: Live = False,
    listen: Listen = DEFAULT_LISTEN,
    token: Token = None,
    certificate: Certificate = None,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Lead through a payload session: check, rehearse, warm up, run, attach, run, identify.

    An interrupted session goes on with --resume: what was recorded counts, and what it was begun
    with holds unless it is said anew.
    """
    from rid_daq.jobs.payload.payload_job import known_quantity
    from rid_daq.live.live_page import LiveOptions
    from rid_daq.performers.payload.session import perform
    from rid_daq.preflight.axis_test import AxisTestRule
    from rid_daq.recording.payload_session_request import PayloadSessionRequest

    request = PayloadSessionRequest(
        cell=cell,
        runs=runs,
        motion=motion,
        periods=periods,
        repeats=repeats,
        model=model,
        payload=payload,
        known=tuple(known_quantity(text) for text in known or []),
        until_mass_kg=until_mass_kg,
        rehearsal_percent=rehearsal_percent,
        warm_up_percent=warm_up_percent,
        warm_up_periods=warm_up_periods,
        limits=PayloadLimits(
            mass_limit_percent, centre_limit_mm, inertia_limit_percent, residual_limit_percent
        ),
        label=label,
        resume=resume,
        yes=yes,
        practise=practise,
        given=tuple(name for option, name in _KEPT.items() if is_given(context, option)),
        seed=seed,
        axis_test=AxisTestRule.unless(without_axis_test),
        pace=pace,
        live=LiveOptions(live, listen, token, certificate),
    )
    here_or_there(service, JobKind.PAYLOAD, request, Console(as_json), perform)


def is_given(context: typer.Context, name: str) -> bool:
    """Return True if a parameter is on the command line."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"
