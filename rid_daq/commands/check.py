"""`rid-daq check`: preflight. Every device and every safety setting; any red means no motion."""

from __future__ import annotations

from typing import Annotated

import typer

from config.ranges import CheckS, least, most
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.console import Console
from rid_daq.terminal.options import DEFAULT_RUNS, AsJson, CellName, Cleared, RunsFolder, Service


def check(
    cell: CellName,
    seconds: Annotated[
        float,
        typer.Option(min=least(CheckS), max=most(CheckS), help="How long answers are counted."),
    ] = 5.0,
    cleared: Cleared = False,
    all_lines: Annotated[
        bool, typer.Option("--all", help="Show every line, not one a device and what is red.")
    ] = False,
    accept_pose: Annotated[
        bool,
        typer.Option(
            "--accept-pose",
            help="Confirm that the drives' positions are right, although the robot stands elsewhere"
            " than where the last run left it.",
        ),
    ] = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Check a cell before motion: nothing moves.

    Every drive's communication is reset, every drive is configured and read back; then SYNC is sent
    for some seconds and every answer is counted and timed. Then the heartbeats are withheld once,
    each side's, to see that the other acts. The drives are switched on for that, at rest, where the
    cell file says trip_watchdog_with_power and where a drive lacks 6007h, 605Ah or 605Eh or is
    watched by life guarding: its reaction shows in no other way. A person is asked first. A force
    plate's amplifier is set as the cell file says and read back; it is not zeroed. Where the cell
    has a drive monitor, every motor's temperature and torque constant are read too. Where axes name
    EDS files, those are looked at first: no drive is asked anything where one lacks an object by
    its EDS, and nothing is written to a drive that is another than its EDS says. Positions are
    compared with the joints' limits and with the pose in which the last run left the robot. Exit
    code 3 if a line is red.
    """
    from rid_daq.performers.check import perform
    from rid_daq.preflight.preflight import CheckRequest

    request = CheckRequest(cell, runs, seconds, cleared, all_lines, accept_pose)
    here_or_there(service, JobKind.CHECK, request, Console(as_json), perform)
