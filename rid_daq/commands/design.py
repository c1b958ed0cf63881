"""`rid-daq design`: choose an excitation, verify it, write the motion file."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import typer

from acquisition.motion.kinds.constant_velocity import ConstantVelocityMotion
from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.samples import MotionSamples
from compensation.loops.multisine_motion import MultisineOptions
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from identification.design.two_harmonic import TwoHarmonicOptions
from rid_daq.jobs.design_job import Designed, DesignRequest, Kind, design_motion
from rid_daq.jobs.excitation_search import SearchOptions
from rid_daq.report.sections.section import units
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.session.cells import CellName
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.inapplicable_options import is_given, refuse_inapplicable
from rid_daq.terminal.output_file import Overwrite, refuse_output

DEFAULT_PERIOD_S = 10.0
DEFAULT_PERIODS = 16


class Grid(StrEnum):
    """Which lines of its band a multisine has."""

    ODD = "odd"
    RANDOM_ODD = "random_odd"
    FULL = "full"


class Phases(StrEnum):
    """Where the phases start before the crest factor is made small."""

    RANDOM = "random"
    SCHROEDER = "schroeder"


class Method(StrEnum):
    """How the excitation is found."""

    OPTIMAL = "optimal"
    TWO_HARMONIC = "two-harmonic"


class CriterionName(StrEnum):
    """What is optimal."""

    CONDITION = "condition"
    D_OPTIMAL = "d-optimal"


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
            help="Excitation; friction alone: runs at constant speed, or the excitation there and"
            " back in time; or a multisine for the velocity loops."
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
            "--period", min=0.1, max=3600.0, help="Period [s], whole cycles; 10, multisines 8."
        ),
    ] = None,
    periods: Annotated[
        int | None, typer.Option(min=2, help="Periods that count; 16, multisines 4.")
    ] = None,
    highest_harmonic: Annotated[
        int | None,
        typer.Option(
            "--harmonics", min=2, max=100, help="The highest harmonic used; 5, heuristic 8."
        ),
    ] = None,
    starts: Annotated[int, typer.Option(min=1, help="Starts that are refined (optimal).")] = 12,
    budget_s: Annotated[
        float | None,
        typer.Option(
            "--budget", min=1.0, help="End after the start that is ready after this time [s]."
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="A Dask scheduler to compute on, as tcp://host:8786."),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(metavar="MODEL", help="A model file to hold torque limits by."),
    ] = None,
    given: Annotated[
        list[Path] | None,
        typer.Option(metavar="MODEL", help="Models of earlier runs, whose information counts."),
    ] = None,
    tries: Annotated[int, typer.Option(min=1, help="Motions compared (two-harmonic).")] = 200,
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
        int | None, typer.Option(min=1, max=100, help="Multisines: draws of the phases; 4.")
    ] = None,
    slow: Annotated[
        bool, typer.Option("--slow/--no-slow", help="Multisines: a slow sine beneath.")
    ] = True,
    seed: Annotated[int, typer.Option(min=0, help="Where they are drawn from.")] = 0,
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
    _refuse_inapplicable(context, kind, method)
    names = tuple(name.strip() for name in wanted.split(",") if name.strip())
    if names and is_given(context, "criterion"):
        raise ConfigError("--for takes the place of --criterion: leave one of them out")
    excitation: SearchOptions | TwoHarmonicOptions = SearchOptions(
        period_s=period_s or DEFAULT_PERIOD_S,
        periods=periods or DEFAULT_PERIODS,
        harmonics=highest_harmonic or 5,
        criterion=criterion.value,
        wanted=names,
        starts=starts,
        seed=seed,
        budget_s=budget_s,
        scheduler=scheduler,
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
    here_or_there(service, JobKind.DESIGN, request, Console(as_json), perform)


def perform(request: DesignRequest, console: Console) -> None:
    """Design, and say what is in the motion file; exit codes as the command has them."""
    refuse_output(request.output, request.overwrite)
    designed = design_motion(request, console)
    _print(console, designed, request)
    then = ", then rid-daq loop latest" if request.kind is Kind.MULTISINE else ""
    then = ", then rid-daq loop latest" if request.kind is Kind.MULTISINE else ""
    console.next_step("record", request.cell, request.output, then=then)
    if designed.found is not None and designed.found.exit_code:
        raise typer.Exit(designed.found.exit_code)


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
        lowest, highest = (float(part) for part in words.split(":"))
    except ValueError:
        advice = "give the lowest and the highest frequency in Hz, as 0.5:20"
        raise ConfigError(f"--band {words!r}: {advice}") from None
    return lowest, highest


def _print(console: Console, designed: Designed, request: DesignRequest) -> None:
    """Say what is in the motion file."""
    motion, samples, output = designed.motion, designed.samples, request.output
    told = {"motion": str(output), "kind": motion.kind, "duration_s": samples.duration_s}
    said = f"{output}: {motion.describe()} {samples.duration_s:.0f} s in all."
    match motion:
        case FourierMotion():
            _print_excitation(console, designed, motion, output)
        case MultisineMotion():
            axes = _axes(designed, motion)
            band = [motion.lowest_hz, motion.highest_hz]
            console.document(told | {"band_hz": band, "axes": axes})
            console.say(said)
            _print_multisine(console, axes)
            if not request.multisine.slow:
                console.say("Without the slow sine friction sticks: wrong inertia and margins.")
        case _:
            console.document(told)
            console.say(said)
            if isinstance(motion, ConstantVelocityMotion):
                _print_speeds(console, motion)


def _print_speeds(console: Console, motion: ConstantVelocityMotion) -> None:
    console.table(
        ("axis", "from", "to", "speeds"),
        [
            (
                spec.joint,
                f"{spec.low:.3f}",
                f"{spec.high:.3f}",
                ", ".join(f"{speed:g}" for speed in spec.speeds),
            )
            for spec in motion.joints
        ],
    )


def _axes(designed: Designed, motion: MultisineMotion) -> list[dict[str, Any]]:
    """Return what each axis does in a multisine."""
    robot = designed.cell.robot
    assert designed.use is not None
    return [
        {
            "joint": joint.name,
            "unit": units(joint)[0],
            "lines": len(own),
            "rms_velocity": settings.velocity,
            "crest_factor": crest,
            "slow_amplitude": settings.slow_amplitude,
            "velocity_percent": 100.0 * float(shares[0]),
            "acceleration_percent": 100.0 * float(shares[1]),
            "torque_percent": 100.0 * float(shares[2]) if shares[2] > 0.0 else None,
        }
        for joint, own, settings, crest, shares in zip(
            robot.joints,
            motion.excited_lines(robot),
            motion.joints,
            motion.crest_factors(robot),
            designed.use,
            strict=True,
        )
    ]


def _print_multisine(console: Console, axes: list[dict[str, Any]]) -> None:
    speed = "of limits: speed"
    console.table(
        (
            "axis",
            "lines",
            "RMS speed",
            "crest factor",
            "slow sine",
            speed,
            "acceleration",
            "torque",
        ),
        [
            (
                axis["joint"],
                str(axis["lines"]),
                f"{axis['rms_velocity']:.3g} {axis['unit']}/s",
                f"{axis['crest_factor']:.2f}",
                f"{axis['slow_amplitude']:.3g} {axis['unit']}",
                f"{axis['velocity_percent']:.0f} %",
                f"{axis['acceleration_percent']:.0f} %",
                "not told" if axis["torque_percent"] is None else f"{axis['torque_percent']:.0f} %",
            )
            for axis in axes
        ],
    )
    if any(axis["torque_percent"] is None for axis in axes):
        console.say("Torque is told where the robot file has `cad`, or a --model is given.")


def _print_excitation(
    console: Console, designed: Designed, motion: FourierMotion, output: Path
) -> None:
    samples, condition, found = designed.samples, designed.condition, designed.found
    axes = _use_of_limits(samples, designed.cell.robot)
    document: dict[str, object] = {
        "motion": str(output),
        "condition_number": condition,
        "duration_s": samples.duration_s,
        "axes": axes,
    }
    if found is not None:
        document["limits"] = [asdict(use) for use in found.best.check.uses]
        document["trials"] = [
            {
                "elapsed_s": trial.elapsed_s,
                "seed": trial.seed,
                "worth": trial.objective,
                "broken": trial.broken,
            }
            for trial in found.trials
        ]
        document["interrupted"] = found.interrupted_by is not None
    console.document(document)
    if found is not None and found.interrupted_by is not None:
        console.verdict(None, "Interrupted: this is the best motion found so far.")
    console.say(
        f"{output}: {motion.periods} periods of {motion.period_s:g} s,"
        f" {samples.duration_s:.1f} s in all, condition number {condition:.4g}. Verified between"
        " the samples too."
    )
    console.table(
        ("axis", "range", "max speed", "of limit", "max acceleration", "of limit"),
        [
            (
                axis["joint"],
                f"{axis['position_min']:.3f} … {axis['position_max']:.3f} {axis['unit']}",
                f"{axis['velocity']:.3f} {axis['unit']}/s",
                f"{axis['velocity_percent']:.0f} %",
                f"{axis['acceleration']:.3f} {axis['unit']}/s²",
                f"{axis['acceleration_percent']:.0f} %",
            )
            for axis in axes
        ],
    )
    if found is not None:
        found.print(console, designed.cell.config)


def _use_of_limits(samples: MotionSamples, robot: RobotDescription) -> list[dict[str, Any]]:
    velocity = np.abs(samples.velocity).max(axis=0)
    acceleration = np.abs(samples.acceleration).max(axis=0)
    return [
        {
            "joint": joint.name,
            "unit": units(joint)[0],
            "position_min": float(samples.position[:, column].min()),
            "position_max": float(samples.position[:, column].max()),
            "velocity": float(velocity[column]),
            "velocity_percent": float(100.0 * velocity[column] / joint.limits.velocity),
            "acceleration": float(acceleration[column]),
            "acceleration_percent": float(100.0 * acceleration[column] / joint.limits.acceleration),
        }
        for column, joint in enumerate(robot.joints)
    ]
