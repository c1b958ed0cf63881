"""`rid-daq design`: choose an excitation, verify it, write the motion file."""

from __future__ import annotations

import signal
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import typer

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.samples import MotionSamples
from config.errors import ConfigError
from config.formats.whole_file import write_whole
from config.load import LoadedCell, load_cell, to_yaml
from config.robot.robot import RobotDescription
from identification.design.two_harmonic import (
    TwoHarmonicOptions,
    condition_number,
    design_two_harmonic,
)
from identification.estimation.file import read_estimate
from identification.friction.motions import constant_velocity_motion, reversed_motion
from rid_daq.jobs.design_job import Search, chosen_criterion, excitation_problem, search
from rid_daq.jobs.friction_motion import say_speeds, write_friction_motion
from rid_daq.jobs.multisine_job import Grid, Phases, write_multisine
from rid_daq.report.sections.section import units
from rid_daq.session.cells import CellName
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.inapplicable_options import is_given, refuse_inapplicable
from rid_daq.terminal.output_file import Overwrite, refuse_output

DEFAULT_PERIOD_S = 10.0
DEFAULT_PERIODS = 16


class Kind(StrEnum):
    """What the motion is for."""

    EXCITATION = "excitation"
    CONSTANT_VELOCITY = "constant-velocity"
    REVERSED = "reversed"
    MULTISINE = "multisine"


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
    as_json: AsJson = False,
) -> None:
    """Choose an excitation and verify it densely.

    `optimal` refines random starts by exact gradients, on all cores, within the limits on
    position, speed, acceleration, torque, workspace and self-collision; the same seed and starts
    give the same motion. `two-harmonic` takes the best of many draws of one low and one high
    harmonic an axis. The motion written has passed the check of every limit, ramps included.
    """
    console = Console(as_json)
    _refuse_inapplicable(context, kind, method)
    refuse_output(output, overwrite)
    loaded = load_cell(cell)
    robot = loaded.robot
    if kind is Kind.CONSTANT_VELOCITY:
        steady = constant_velocity_motion(robot, loaded.config.workspace, seed=seed)
        write_friction_motion(console, loaded, steady, output)
        say_speeds(console, steady)
        console.next_step("record", cell, output)
        return
    if kind is Kind.MULTISINE:
        write_multisine(
            console,
            loaded,
            output,
            band=band,
            grid=grid,
            phases=phases,
            realisations=realisations,
            slow=slow,
            period_s=period_s,
            periods=periods,
            model=model,
            seed=seed,
        )
        console.next_step("record", cell, output, then=", then rid-daq loop latest")
        return
    found: Search | None = None
    period_s, periods = period_s or DEFAULT_PERIOD_S, periods or DEFAULT_PERIODS
    if method is Method.OPTIMAL:
        names = [name.strip() for name in wanted.split(",") if name.strip()]
        if names and is_given(context, "criterion"):
            raise ConfigError("--for takes the place of --criterion: leave one of them out")
        problem = excitation_problem(
            loaded.config,
            robot,
            period_s=period_s,
            harmonics=highest_harmonic or 5,
            criterion=chosen_criterion(robot, criterion.value, names),
            model=None if model is None else read_estimate(model),
            given=[read_estimate(path) for path in given or ()],
        )
        found = search(
            problem,
            loaded.config,
            console,
            seed=seed,
            starts=starts,
            periods=periods,
            budget_s=budget_s,
            scheduler=scheduler,
        )
        motion = found.best.motion
        origin = (
            f"start {found.best.seed} was the best of {len(found.trials)} from seed {seed} for"
            f" {', '.join(names) or criterion.value}:"
            f" {problem.criterion.describe(found.best.check.objective)}."
        )
    else:
        motion = design_two_harmonic(
            robot,
            TwoHarmonicOptions(
                period_s,
                highest_harmonic=highest_harmonic or 8,
                tries=tries,
                seed=seed,
                periods=periods,
            ),
            loaded.config.cycle_time_s,
            workspace=loaded.config.workspace,
        )
        origin = f"the best of {tries} draws of two harmonics from seed {seed}."
    if kind is Kind.REVERSED:
        write_friction_motion(console, loaded, reversed_motion(motion), output)
    else:
        _write(console, loaded, motion, output, origin, found)
    console.next_step("record", cell, output)
    if found is not None and found.interrupted_by is not None:
        interrupted = found.interrupted_by is signal.SIGINT
        raise typer.Exit(ExitCode.INTERRUPTED if interrupted else ExitCode.TERMINATED)


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


def _write(
    console: Console,
    loaded: LoadedCell,
    motion: FourierMotion,
    output: Path,
    origin: str,
    found: Search | None,
) -> None:
    """Write the motion file, and say what is in it."""
    samples = motion.plan(loaded.robot, loaded.config.cycle_time_s)
    condition = condition_number(loaded.robot, motion)
    axes = _use_of_limits(samples, loaded.robot)
    comment = (
        f"Excitation for robot {loaded.robot.name}, verified within its limits at"
        f" {loaded.config.cycle_time_ms} ms.\nCondition number {condition:.4g}; {origin}"
    )
    write_whole(output, to_yaml(motion, comment).encode())
    document: dict[str, object] = {
        "motion": str(output),
        "condition_number": condition,
        "duration_s": samples.duration_s,
        "axes": axes,
    }
    if found is not None:
        document["limits"] = [asdict(use) for use in found.best.check.uses]
        document["trials"] = [asdict(trial) for trial in found.trials]
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
        _say_search(console, loaded, found)


def _say_search(console: Console, loaded: LoadedCell, found: Search) -> None:
    """Say how the search went, and what the motion's torques and distances are."""
    curve = "; ".join(
        f"{found.criterion.describe(trial.objective)} after {trial.elapsed_s:.1f} s"
        for trial in found.curve
    )
    broken = sum(bool(trial.broken) for trial in found.trials)
    console.say(f"{len(found.trials)} starts, {broken} of them in vain. The best so far: {curve}.")
    uses = found.best.check.uses
    torques = [use for use in uses if use.what.startswith("torque")]
    shares = ", ".join(f"{100.0 * use.used / use.limit:.0f}" for use in torques)
    console.say(
        f"Largest torque expected, axis by axis: {shares} % of the limit."
        if torques
        else "Torque is not checked: the robot file has no `cad`, and no --model is given."
    )
    limits = None if loaded.config.plate is None else loaded.config.plate.limits
    if limits is not None:
        base = [use for use in uses if use.what.endswith("on the base")]
        shares = ", ".join(f"{100.0 * use.used / use.limit:.0f}" for use in base)
        console.say(
            f"Largest reaction on the base expected, Fx to Mz: {shares} % of the limit."
            if base
            else "The reaction on the base is not checked: give a combined model by --model."
        )
    nearest = min(
        (use for use in uses if use.unit == "m" and use.what.startswith("distance")),
        key=lambda use: use.used,
        default=None,
    )
    console.say(
        f"Nearest approach: {1000.0 * nearest.used:.0f} mm, {nearest.what}."
        if nearest is not None
        else "Collisions are not checked: neither `bodies` nor a `workspace` is stated."
    )
    active = [use.what for use in uses if use.active]
    console.say(f"What holds the motion back: {', '.join(active) or 'nothing'}.")


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
