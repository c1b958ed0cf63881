"""`rid-daq plate`: the force plate under the robot. `zero` finds its offsets."""

from __future__ import annotations

from typing import Annotated

import typer

from config.cell.plate import PlateZero
from config.errors import ConfigError
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.recording.plate_zero_job import PlateZeroed, PlateZeroRequest, zero_plate
from rid_daq.recording.recorded_run import stop_document
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.session.cells import CellName, Pace, Realtime, Seed, Simulation
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.clearance import Cleared, WithoutAxisTest
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode

plate = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    no_args_is_help=True,
    help="The force plate under the robot.",
)


@plate.callback()
def _plate() -> None:
    pass


@plate.command("zero")
def zero(
    cell: CellName,
    pose: Annotated[
        str | None,
        typer.Option(
            metavar="RAD,...",
            help="The pose about which axis 1 is turned; the middle of every range if not given.",
        ),
    ] = None,
    read_s: Annotated[
        float, typer.Option("--read", min=1.0, max=600.0, help="How long each reading lasts [s].")
    ] = 5.0,
    settle_s: Annotated[
        float, typer.Option("--settle", min=0.0, max=600.0, help="Rest before each reading [s].")
    ] = 2.0,
    write: Annotated[
        bool,
        typer.Option(
            "--write", help="Put the zero into the cell file; everything else in it is kept."
        ),
    ] = False,
    label: Annotated[str, typer.Option(help="What to call the run.")] = "plate zero",
    realtime: Realtime = False,
    pace: Pace = None,
    seed: Seed = 0,
    cleared: Cleared = False,
    without_axis_test: WithoutAxisTest = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Find the plate's offsets: read it, turn axis 1 by half a turn, read it, go back, read it.

    The robot moves. The amplifier is reset at rest in the first pose, and operates from then on.
    Half the sum of the readings is the offset, half their difference the moment of gravity; the
    third reading tells the drift. The lines for the cell file are printed. Exit code 1 where the
    zero does not hold.
    """
    request = PlateZeroRequest(
        cell=cell,
        runs=runs,
        pose=_pose(pose),
        read_s=read_s,
        settle_s=settle_s,
        write=write,
        cleared=cleared,
        axis_test=AxisTestRule.unless(without_axis_test),
        label=label,
        simulation=Simulation(realtime=realtime, pace=pace, seed=seed),
    )
    here_or_there(service, JobKind.PLATE_ZERO, request, Console(as_json), perform)


def perform(request: PlateZeroRequest, console: Console) -> None:
    """Zero the plate, and say how well; exit codes as the command has them."""
    zeroed = zero_plate(request, console)
    if zeroed.zero is None:
        _print_stop(console, zeroed)
        raise typer.Exit(zeroed.run.exit_code)
    _print(console, zeroed, zeroed.zero)
    if not zeroed.run.result.verdict.passed:
        raise typer.Exit(ExitCode.VERDICT_FAILED)


def _pose(text: str | None) -> list[float] | None:
    if text is None:
        return None
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        raise ConfigError(f"--pose {text}: give one number a joint, such as 0,0.2,-0.4") from None


def _print_stop(console: Console, zeroed: PlateZeroed) -> None:
    run = zeroed.run
    kept = {} if zeroed.approach_only else {"folder": str(run.folder.path)}
    console.document(kept | stop_document(run.outcome))
    console.verdict(False, run.stop_sentence)
    if not zeroed.approach_only:
        console.say("The plate is not zeroed: start again, or `record` measures from a wrong zero.")
        console.say(f"Report: {run.report}")


def _print(console: Console, zeroed: PlateZeroed, zero: PlateZero) -> None:
    run, written = zeroed.run, zeroed.written
    section, judged = run.result.plate_zero, run.result.verdict
    assert section is not None
    console.document(
        {
            "folder": str(run.folder.path),
            "report": str(run.report),
            "zero": zero.model_dump(mode="json"),
            "plate_zero": section,
            "verdict": judged,
            "written": None if written is None else str(written),
        }
    )
    section.print(console)
    console.verdict(judged.passed, f"{judged.headline}. {judged.sentence}")
    console.say(f"Report: {run.report}")
    if written is not None:
        console.say(f"4 of 4: written into {written}")
    elif judged.passed:
        console.say("4 of 4: put these lines under `plate:` in the cell file (--write does it):")
        console.say(zeroed.lines.rstrip("\n"))
