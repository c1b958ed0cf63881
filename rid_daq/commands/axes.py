"""`rid-daq axes`: the axis test, before the first motion of a cell."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from rid_daq.commissioning.axis_test_job import AxesTested, AxisTestRequest, check_axes
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.session.cells import CellName, Realtime, Seed, Simulation
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.clearance import Cleared
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode


def axes(
    cell: CellName,
    joint: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Test this joint alone; repeat for more."),
    ] = None,
    unattended: Annotated[
        bool,
        typer.Option(
            "--unattended",
            help="A simulated cell is its own person: no key is held, its true axes answer.",
        ),
    ] = False,
    realtime: Realtime = False,
    seed: Seed = 0,
    cleared: Cleared = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Test direction, encoder and gear of every axis before the first motion.

    One axis at a time moves by 2 degrees (5 mm) at 2 % of its speed while SPACE is held, and stops
    when it is let go. You say which way it moved and about how far; its drive says what it counted.
    What does not fit is named, with the line of the file to change (exit code 1). Axes that pass
    are signed beside the cell file; on a real cell every other motion wants that, until the cell
    or the robot file changes.
    """
    request = AxisTestRequest(
        cell=cell,
        runs=runs,
        joints=joint or (),
        unattended=unattended,
        simulation=Simulation(realtime=realtime, seed=seed),
        cleared=cleared,
    )
    here_or_there(service, JobKind.AXES, request, Console(as_json), perform)


def perform(request: AxisTestRequest, console: Console) -> None:
    """Test the axes, and say what they do; exit codes as the command has them."""
    tested = check_axes(request, console)
    console.document(_document(tested))
    if tested.stopped is not None:
        words = tested.stopped.stop_sentence or "The test was ended."
        console.verdict(False, f"{words} The axis test is not complete.")
        raise typer.Exit(tested.stopped.exit_code or ExitCode.VERDICT_FAILED)
    if not tested.passed:
        console.verdict(False, "Not every axis does what the files say: change the lines above.")
        console.next_step("axes", request.cell)
        raise typer.Exit(ExitCode.VERDICT_FAILED)
    signed = "" if tested.signed is None else f" Signed in {tested.signed}."
    console.verdict(True, f"Every axis that was tested does what the files say.{signed}")
    console.next_step("check", request.cell)


def _document(tested: AxesTested) -> dict[str, object]:
    return {
        "cell": tested.cell,
        "passed": tested.passed,
        "axes": [
            {
                "motion": asdict(each.motion),
                "seen": asdict(each.seen),
                "passed": each.passed,
                "problems": list(each.problems),
            }
            for each in tested.verdicts
        ],
        "stopped": None if tested.stopped is None else tested.stopped.document(),
        "signed": None if tested.signed is None else str(tested.signed),
    }
