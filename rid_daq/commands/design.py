"""`rid-daq design`: choose an excitation, verify it, write the motion file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from config.errors import ConfigError
from config.formats.number import parse_number
from config.ranges import (
    BudgetS,
    Harmonics,
    PeriodS,
    Periods,
    Realisations,
    Seed,
    Starts,
    Tries,
    least,
    most,
)
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.choices import CriterionName, Grid, Kind, Method, Phases
from rid_daq.terminal.console import Console
from rid_daq.terminal.inapplicable_options import is_given, refuse_inapplicable
from rid_daq.terminal.options import AsJson, CellName, Overwrite, Scheduler, Service

DEFAULT_PERIOD_S = 10.0
DEFAULT_PERIODS = 16


_PERIODIC: Final = frozenset({"period_s", "periods"})
_OF_OPTIMAL: Final = frozenset({"criterion", "starts", "budget_s", "scheduler", "given", "wanted"})
_OF_MULTISINES: Final = frozenset({"band", "grid", "phases", "realisations", "slow"})
_OF_EXCITATIONS: Final = frozenset({"method", "tries", "highest_harmonic"}) | _OF_OPTIMAL


def design(
    context: typer.Context,
    cell: CellName,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="MOTION", help="The motion file to write.")
    ],
    kind: Annotated[
        Kind,
        typer.Option(
            help="An excitation shows a robot's parameters; runs at constant speed, or an"
            " excitation there and back in time (reversed), show friction alone; a multisine shows"
            " the velocity loops."
        ),
    ] = Kind.EXCITATION,
    method: Annotated[
        Method, typer.Option(help="By gradients from many starts, or the quick heuristic (3.22).")
    ] = Method.OPTIMAL,
    criterion: Annotated[
        CriterionName, typer.Option(help="Smallest condition number, or largest information.")
    ] = CriterionName.D_OPTIMAL,
    period_s: Annotated[
        float | None,
        typer.Option(
            "--period",
            min=least(PeriodS),
            max=most(PeriodS),
            help="Period [s], whole cycles; 10, multisines 8.",
        ),
    ] = None,
    periods: Annotated[
        int | None,
        typer.Option(
            min=least(Periods), max=most(Periods), help="Periods that count; 16, multisines 4."
        ),
    ] = None,
    highest_harmonic: Annotated[
        int | None,
        typer.Option(
            "--harmonics",
            min=least(Harmonics),
            max=most(Harmonics),
            help="The highest harmonic used; 5, heuristic 8.",
        ),
    ] = None,
    starts: Annotated[
        int,
        typer.Option(
            min=least(Starts), max=most(Starts), help="Starts that are refined (optimal)."
        ),
    ] = 12,
    budget_s: Annotated[
        float | None,
        typer.Option(
            "--budget",
            min=least(BudgetS),
            max=most(BudgetS),
            help="End after the start that is ready after this time [s].",
        ),
    ] = None,
    scheduler: Scheduler = None,
    model: Annotated[
        Path | None,
        typer.Option(metavar="MODEL", help="A model file to hold torque limits by."),
    ] = None,
    given: Annotated[
        list[Path] | None,
        typer.Option(metavar="MODEL", help="Models of earlier runs, whose information counts."),
    ] = None,
    tries: Annotated[
        int,
        typer.Option(min=least(Tries), max=most(Tries), help="Motions compared (two-harmonic)."),
    ] = 200,
    wanted: Annotated[
        str,
        typer.Option(
            "--for",
            metavar="NAMES",
            help="What is to be known best instead of --criterion: parameters as sx3,Izz1, torque.",
        ),
    ] = "",
    band: Annotated[
        str | None,
        typer.Option(metavar="LOW:HIGH", help="Multisines: band [Hz]; the cell file's."),
    ] = None,
    grid: Annotated[
        Grid, typer.Option(help="Multisines: which lines of the band are excited.")
    ] = Grid.RANDOM_ODD,
    phases: Annotated[
        Phases, typer.Option(help="Multisines: phases to start the search for low peaks from.")
    ] = Phases.RANDOM,
    realisations: Annotated[
        int | None,
        typer.Option(
            min=least(Realisations),
            max=most(Realisations),
            help="Multisines: draws of the phases; 4.",
        ),
    ] = None,
    slow: Annotated[
        bool, typer.Option("--slow/--no-slow", help="Multisines: a slow sine beneath.")
    ] = True,
    seed: Annotated[
        int,
        typer.Option(
            min=least(Seed), max=most(Seed), help="What is drawn by chance comes from it."
        ),
    ] = 0,
    overwrite: Overwrite = False,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Choose an excitation and verify it densely.

    `optimal` refines random starts by exact gradients, on all cores, within the limits on
    position, speed, acceleration, torque, workspace and self-collision; the same seed and starts
    give the same motion. `two-harmonic` takes the best of many draws of one low and one high
    harmonic an axis. The motion written has passed the check of every limit, ramps included.
    """
    from compensation.loops.multisine_motion import MultisineOptions
    from identification.design.two_harmonic import TwoHarmonicOptions
    from rid_daq.jobs.design_job import DesignRequest
    from rid_daq.jobs.excitation_search import SearchOptions
    from rid_daq.performers.design import perform

    _refuse_inapplicable(context, kind, method)
    names = tuple(name.strip() for name in wanted.split(",") if name.strip())
    if names and is_given(context, "criterion"):
        raise ConfigError(
            "--for takes the place of --criterion: leave one of them out",
            code="RID-OPTION-EXCLUSIVE",
        )
    excitation: SearchOptions | TwoHarmonicOptions = SearchOptions(
        period_s=period_s or DEFAULT_PERIOD_S,
        periods=periods or DEFAULT_PERIODS,
        harmonics=highest_harmonic or 5,
        criterion=criterion.value,
        wanted=names,
        starts=starts,
        seed=seed,
        budget_s=budget_s,
    )
    if method is Method.TWO_HARMONIC:
        excitation = TwoHarmonicOptions(
            period_s=period_s or DEFAULT_PERIOD_S,
            periods=periods or DEFAULT_PERIODS,
            highest_harmonic=highest_harmonic or 8,
            tries=tries,
            seed=seed,
        )
    request = DesignRequest(
        cell=cell,
        output=output,
        kind=kind,
        excitation=excitation,
        multisine=MultisineOptions(
            band_hz=None if band is None else _band(band),
            period_s=period_s,
            periods=periods or 4,
            realisations=realisations or (1 if phases is Phases.SCHROEDER else 4),
            grid=grid.value,
            phases=phases.value,
            slow=slow,
            seed=seed,
        ),
        model=model,
        given=tuple(given or ()),
        seed=seed,
        overwrite=overwrite,
    )
    if service is not None and scheduler is not None:
        raise ConfigError(
            "--scheduler does not go with --service: a service computes on its own computer",
            code="RID-DESIGN-SCHEDULER",
        )
    here_or_there(
        service,
        JobKind.DESIGN,
        request,
        Console(as_json),
        lambda request, console: perform(request, console, scheduler),
    )


def _refuse_inapplicable(context: typer.Context, kind: Kind, method: Method) -> None:
    """Refuse what the kind, or the method, of this motion does not know."""
    by = f"with --kind {kind.value}"
    if kind is Kind.CONSTANT_VELOCITY:
        refuse_inapplicable(context, _PERIODIC | _OF_MULTISINES | _OF_EXCITATIONS | {"model"}, by)
    elif kind is Kind.MULTISINE:
        refuse_inapplicable(context, _OF_EXCITATIONS, by)
    else:
        refuse_inapplicable(context, _OF_MULTISINES, by)
        others = {"tries"} if method is Method.OPTIMAL else _OF_OPTIMAL | {"model"}
        refuse_inapplicable(context, others, f"with --method {method.value}")


def _band(words: str) -> tuple[float, float]:
    try:
        lowest, highest = (parse_number(part) for part in words.split(":"))
    except (ConfigError, ValueError):
        advice = "give the lowest and the highest frequency in Hz, as 0.5:20"
        raise ConfigError(f"--band {words!r}: {advice}", code="RID-MOTION-BAND") from None
    return lowest, highest
