"""`rid-daq plate`: the force plate under the robot. `zero` finds its offsets."""

from __future__ import annotations

from typing import Annotated

import typer

from config.errors import ConfigError
from config.formats.number import parse_numbers
from config.ranges import ReadingS, SettleS, least, most
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.console import Console
from rid_daq.terminal.option_sections import SectionedCommand
from rid_daq.terminal.options import (
    DEFAULT_RUNS,
    AsJson,
    CellName,
    Cleared,
    Pace,
    Practise,
    Realtime,
    RunsFolder,
    Seed,
    Service,
    WithoutAxisTest,
)

plate = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    no_args_is_help=True,
    help="The force plate under the robot.",
)


@plate.callback()
def _plate() -> None:
    pass


@plate.command(
    "zero",
    cls=SectionedCommand,
    short_help="the plate's offsets: read, turn axis 1 by half a turn, read",
)
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
        float,
        typer.Option(
            "--read",
            min=least(ReadingS),
            max=most(ReadingS),
            help="How long each reading lasts [s].",
        ),
    ] = 5.0,
    settle_s: Annotated[
        float,
        typer.Option(
            "--settle", min=least(SettleS), max=most(SettleS), help="Rest before each reading [s]."
        ),
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
    practise: Practise = False,
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
    from rid_daq.performers.plate import perform
    from rid_daq.preflight.axis_test import AxisTestRule
    from rid_daq.recording.plate_zero_job import PlateZeroRequest
    from rid_daq.session.cells import Simulation

    request = PlateZeroRequest(
        cell=cell,
        runs=runs,
        pose=_pose(pose),
        read_s=read_s,
        settle_s=settle_s,
        write=write,
        cleared=cleared,
        practise=practise,
        axis_test=AxisTestRule.unless(without_axis_test),
        label=label,
        simulation=Simulation(realtime=realtime, pace=pace, seed=seed),
    )
    here_or_there(service, JobKind.PLATE_ZERO, request, Console(as_json), perform)


def _pose(text: str | None) -> list[float] | None:
    if text is None:
        return None
    try:
        return list(parse_numbers(text))
    except ConfigError:
        raise ConfigError(
            f"--pose {text}: give one number a joint, such as 0,0.2,-0.4", code="RID-OPTION-SYNTAX"
        ) from None
